#include "appliance/places.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "appliance/appliance_marks.h"

static void fill(const char **place, const char *root, const char *path)
{
    char *below;

    if (*place != NULL) {
        return;
    }
    if (asprintf(&below, "%s%s", root, path) < 0) {
        abort(); /* no memory at the very start; and no other root is the one that was meant */
    }
    *place = below;
}

void places_under(struct places *places, const char *root)
{
    fill(&places->root, root, "");
    fill(&places->run_dir, root, PLACES_RUN_DIR);
    fill(&places->faults, root, PLACES_FAULTS);
    fill(&places->state, root, PLACES_STATE);
    fill(&places->swupdate, root, PLACES_SWUPDATE);
    fill(&places->data, root, PLACES_DATA);
    fill(&places->config, root, PLACES_CONFIG);
    fill(&places->in_force, root, PLACES_STATE "/odid.conf");
    fill(&places->flights, root, PLACES_DATA "/odid/flights");
    fill(&places->clock, root, PLACES_DATA "/clock");
    fill(&places->release, root, "/etc/odid-release");
    fill(&places->version, root, PLACES_VERSION);
    fill(&places->boot_id, root, "/proc/sys/kernel/random/boot_id");
    fill(&places->apply, root, "/lib/odid/apply-configuration");
    fill(&places->board_test, root, "/lib/odid/board-test");
    fill(&places->page, root, "/usr/share/odid-web");
}

const char *places_config_in_force(const struct places *places)
{
    bool copied = !places->other_config && access(places->in_force, F_OK) == 0;

    return copied ? places->in_force : places->config;
}

bool places_data_in_memory(const struct places *places)
{
    char path[PLACES_PATH_SIZE];

    snprintf(path, sizeof(path), "%s/" APPLIANCE_IN_MEMORY, places->state);
    return access(path, F_OK) == 0;
}
