/* odidctl radios: how the radios that are configured are, for the script that binds their drivers.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "appliance/status_fetch.h"
#include "config/config.h"
#include "odidctl/odidctl.h"

enum look { LOOK_UNUSED, LOOK_OFF, LOOK_STUCK, LOOK_ON_AIR };

struct radio_look {
    const char *name;
    enum look look;
    double seconds; /* on the air: for so long */
};

static struct json_object *field_of(struct json_object *channel, const char *name)
{
    return json_object_object_get(channel, name);
}

/* Two channels may share a radio: one that is on the air with either isn't to be disturbed. */
static void look_at(struct radio_look *radio, struct json_object *status, const char *name)
{
    struct json_object *channel =
        json_object_object_get(json_object_object_get(status, "channels"), name);
    const char *state = json_object_get_string(field_of(channel, "state"));
    struct json_object *stuck = field_of(channel, "stuck");
    enum look look = LOOK_OFF;

    if (state != NULL && strcmp(state, "disabled") == 0) {
        return;
    }
    if (state != NULL && strcmp(state, "on air") == 0) {
        look = LOOK_ON_AIR;
        radio->seconds = fmax(radio->seconds, json_object_get_double(field_of(channel, "since_s")));
    } else if (json_object_is_type(stuck, json_type_boolean) && json_object_get_boolean(stuck)) {
        look = LOOK_STUCK;
    }
    radio->look = look > radio->look ? look : radio->look;
}

static void print_radio(const struct radio_look *radio)
{
    static const char *const words[] = {
        [LOOK_OFF] = "off", [LOOK_STUCK] = "stuck", [LOOK_ON_AIR] = "on-air"};
    double seconds = fmin(fmax(radio->seconds, 0), 1e9);

    if (radio->name[0] != '\0' && radio->look != LOOK_UNUSED) {
        printf("%s %s %.0f\n", radio->name, words[radio->look], floor(seconds));
    }
}

/* What is wrong in there is told by others. */
static void say_nothing(void *context, enum config_severity severity, const char *sentence)
{
    (void)context;
    (void)severity;
    (void)sentence;
}

int odidctl_radios(const struct places *places)
{
    int error = 0;
    struct json_object *status = status_fetch(places->run_dir, &error);
    struct config config;
    struct radio_look radios[3] = {0};
    bool two;

    if (status == NULL) {
        return ODIDCTL_NO_ANSWER;
    }
    config_defaults(&config);
    config_read_file(&config, places_config_in_force(places), say_nothing, NULL);
    two = config.bt5_adapter[0] != '\0' && strcmp(config.bt5_adapter, config.bt_adapter) != 0;
    radios[0].name = config.bt_adapter;
    radios[1].name = two ? config.bt5_adapter : "";
    radios[2].name = config.wifi_iface;
    look_at(&radios[0], status, "bt4");
    look_at(&radios[two], status, "bt5");
    look_at(&radios[2], status, "wifi");
    json_object_put(status);
    for (size_t i = 0; i < sizeof(radios) / sizeof(radios[0]); i++) {
        print_radio(&radios[i]);
    }
    explicit_bzero(&config, sizeof(config));
    return ODIDCTL_GOOD;
}
