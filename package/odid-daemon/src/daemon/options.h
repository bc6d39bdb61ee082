/*
 * The command line: the field study's flags, kept, and the configuration that
 * results from file, environment and flags.
 */
#ifndef ODID_OPTIONS_H
#define ODID_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "config/config.h"

#define OPTIONS_REPORTS 8

struct options {
    struct config config;
    bool check;               /* validate and exit */
    bool version;             /* print and exit */
    bool seccomp_log;         /* the filter only logs */
    bool appliance;           /* some places are the image's, and the run directory nobody else's */
    uint8_t expected_vehicle; /* MAVLink system id that was the vehicle's at the last power-on; 0:
                                 none */
    uint64_t said;            /* fingerprint() of the sentences so far */
    uint64_t file;            /* config_fingerprint of the configuration file */
    unsigned errors, warnings;
    unsigned reports; /* sentences kept below, for the status */
    char report[OPTIONS_REPORTS][CONFIG_PROBLEM_SIZE];
};

/*
 * Reads everything; each report sentence is logged, the first ones are kept.
 * Returns false on a wrong command line, which was explained on stderr.
 */
bool options_read(struct options *options, int argc, char *const argv[]);

#endif
