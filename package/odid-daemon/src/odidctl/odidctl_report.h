/* odid-report.txt: what odidctl import found, for a person with any computer. */
#ifndef ODID_ODIDCTL_REPORT_H
#define ODID_ODIDCTL_REPORT_H

#include "config/config.h"

#define ODIDCTL_REPORT_NAME "odid-report.txt"

struct odidctl_report;

/* NULL without memory. */
struct odidctl_report *odidctl_report_begin(void);
void odidctl_report_end(struct odidctl_report *report);

void odidctl_report_line(struct odidctl_report *report, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Who the aircraft is, and what else is in force. */
void odidctl_report_in_force(struct odidctl_report *report, const struct config *config,
                             const char *password);

/*
 * Writes it, unless the same stands there already (flash wears). The date is
 * in it only when the daemon knows the time: the board has no clock. Returns 0
 * or -errno.
 */
int odidctl_report_write(struct odidctl_report *report, const char *path, const char *run_dir);

#endif
