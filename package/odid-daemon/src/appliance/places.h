/* Where the appliance keeps everything, for those who may be told otherwise. */
#ifndef ODID_PLACES_H
#define ODID_PLACES_H

#define PLACES_PATH_SIZE 300

/* Where everything is; other places are for tests. */
struct places {
    const char *run_dir; /* the daemon's status socket: /run/odid */
    const char *data;    /* what outlasts power-off: /data */
    const char *faults;  /* a file for each fault of the appliance: /run/faults */
    const char *state;   /* the appliance's state: /run/odid-appliance */
    const char *apply;   /* makes a changed configuration count: /lib/odid/apply-configuration */
    const char *config;  /* the configuration file; NULL: data's */
};

/* data's odid/odid.conf, or the file that was named. */
void places_config(const struct places *places, char path[PLACES_PATH_SIZE]);

#endif
