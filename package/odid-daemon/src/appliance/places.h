/* Where everything is on the appliance: its programs have it from here. On a companion computer
 * (Debian's package) there is no appliance around the daemon: a few places are others. */
#ifndef ODID_PLACES_H
#define ODID_PLACES_H

#include <stdbool.h>

#include "config/config.h"

#define PLACES_PATH_SIZE 300

/* Also for those who are never below another root. */
#define PLACES_RUN_DIR "/run/odid"
#define PLACES_STATE "/run/odid-appliance"
#define PLACES_SWUPDATE "/run/swupdate"
#define PLACES_DATA "/data"
#ifdef ODID_COMPANION
#define PLACES_COMPANION true
#define PLACES_FAULTS "/run/odid_faults"
#define PLACES_CONFIG CONFIG_FILE
#else
#define PLACES_COMPANION false
#define PLACES_FAULTS "/run/faults"
#define PLACES_CONFIG PLACES_DATA "/odid/odid.conf"
#endif
#define PLACES_VERSION "/etc/odid/version"

struct places {
    const char *root;     /* what all the others are below: "" on the appliance */
    const char *run_dir;  /* the daemon's: its status socket, and what it keeps */
    const char *faults;   /* a file for each fault of the appliance */
    const char *state;    /* the appliance's state */
    const char *swupdate; /* SWUpdate's sockets */
    const char *data;     /* what outlasts power-off */
    const char *config;   /* the configuration, as it is saved */
    const char *in_force; /* its copy of when it was made to count last */
    bool other_config;    /* it was named, and isn't the appliance's */
    const char *flights;  /* the flight records */
    const char *clock;    /* the last saved time */
    const char *release;  /* what was built, and when */
    const char *version;  /* of the image, one line */
    const char *boot_id;  /* the kernel's */
    const char *apply;    /* makes a changed configuration count */
    const char *board_test;
    const char *page; /* the technician's page */
};

/* Fills in all that isn't named yet, below that folder; "": as on the appliance. For good. */
void places_under(struct places *places, const char *root);

/* The configuration that counts until power-off: what is saved in flight waits for the next one. */
const char *places_config_in_force(const struct places *places);

/* Is what is written to data lost at power-off? */
bool places_data_in_memory(const struct places *places);

#endif
