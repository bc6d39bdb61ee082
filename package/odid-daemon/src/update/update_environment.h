/*
 * U-Boot's environment: where it is on the disk, and its variables, by
 * libubootenv. Variables: board/common/boot.cmd.
 */
#ifndef ODID_UPDATE_ENVIRONMENT_H
#define ODID_UPDATE_ENVIRONMENT_H

#include <stdbool.h>
#include <stddef.h>

/*
 * Writes libubootenv's configuration: where on the volume (a FAT partition)
 * its two files lie. By places on the disk, rather than as files, one of them
 * is overwritten in place and nothing else is touched: the other one, the
 * volume's tables, its directory. Mounts the volume read-only at mount_point
 * for that. Returns true, or false with a sentence in problem.
 */
bool update_environment_find(const char *volume, const char *mount_point, const char *config,
                             char *problem, size_t problem_size);

struct update_variables {
    char slot, trial, trial_failed; /* 'a', 'b', or '\0' for none */
    char unverified; /* likewise: the slot that is written to, where /data keeps no record of it */
    char trial_reason[32]; /* why boot.cmd gave trial_failed up; only read */
    bool upgrade_available;
    unsigned restarts; /* that weren't power-ons, as boot.cmd counts them */
};

/*
 * Reads the variables. When both files are damaged (their checksums are wrong),
 * U-Boot starts from its defaults: then they are written anew from `defaults`
 * (NULL: they are not), with `running` as the slot, and *repaired is set. One
 * that can't be read at all is no reason to write. Returns 0 or -errno.
 */
int update_variables_read(const char *config, const char *defaults, char running,
                          struct update_variables *variables, bool *repaired);

/* What SWUpdate's hawkBit client is to report when it starts: it finds it in the variable ustate,
 * which is only written where SWUpdate has made it. */
enum update_report {
    UPDATE_REPORT_AS_IT_IS = '\0', /* what stands there already, but no trial that isn't to come */
    UPDATE_REPORT_NOTHING = '0',
    UPDATE_REPORT_GOOD = '2',
    UPDATE_REPORT_FAILED,
};

/* Writes all of them at once, and flushes: all or none. bootcount becomes 0, and there is no
 * trial_reason any more. Returns 0 or -errno. */
int update_variables_write(const char *config, const struct update_variables *variables,
                           enum update_report report);

#endif
