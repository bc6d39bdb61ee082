#include "keeper/keeper_config.h"

#include <stdlib.h>
#include <string.h>

static const char *environment(const char *name)
{
    return getenv(name);
}

/* The flag's name behind one hyphen or two; NULL: it is none. */
static const char *flag_name(const char *word)
{
    if (word[0] != '-') {
        return NULL;
    }
    return word[1] == '-' ? word + 2 : word + 1;
}

void keeper_config_read(struct config *config, char *const command[])
{
    const char *file = CONFIG_FILE;
    bool no_wifi = false, no_bt = false, appliance = false;

    for (int i = 1; command[0] != NULL && command[i] != NULL; i++) {
        const char *name = flag_name(command[i]);

        if (name == NULL) {
            continue;
        }
        if (strcmp(name, "config") == 0 && command[i + 1] != NULL) {
            file = command[++i];
        } else if (strncmp(name, "config=", strlen("config=")) == 0) {
            file = name + strlen("config=");
        }
        no_wifi = no_wifi || strcmp(name, "no-wifi") == 0;
        no_bt = no_bt || strcmp(name, "no-bt") == 0;
        appliance = appliance || strcmp(name, "appliance") == 0;
    }
    config_defaults(config);
    config_read_file(config, file, config_ignore_sentence, NULL);
    config_read_environment(config, environment, config_ignore_sentence, NULL);
    if (appliance) {
        config_keep_appliance(config, config_ignore_sentence, NULL);
    }
    config->wifi_beacon_enabled = config->wifi_beacon_enabled && !no_wifi;
    config->bt4_enabled = config->bt4_enabled && !no_bt;
    config->bt5_enabled = config->bt5_enabled && !no_bt;
}
