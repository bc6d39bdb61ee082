/*
 * odidctl doctor: who else lives on this computer and disturbs Remote ID. Each
 * probe looks at files of /proc, /sys, /run, /etc and /usr/lib only, in a
 * process of its own that has a few seconds: what the kernel holds up costs one
 * answer, not the others.
 */
#ifndef ODID_DOCTOR_H
#define ODID_DOCTOR_H

#include <json-c/json_object.h>
#include <stdbool.h>
#include <stddef.h>

#include "config/config.h"

#define DOCTOR_PATH_SIZE 512
#define DOCTOR_LINE_SIZE 256

struct doctor_process {
    int pid;
    char name[16];                  /* the kernel's, cut to 15 characters */
    char command[DOCTOR_LINE_SIZE]; /* its words, a blank between two */
};

struct doctor {
    const char *root;
    const struct config *config;
    struct json_object *status; /* the daemon's; NULL: it doesn't answer */
    struct doctor_process *processes;
    size_t count;
    bool contained; /* in a container: of the computer around it little is seen */
    unsigned found;
};

/* ---- what probes look with: paths are as on the computer, without root ---- */

/* The path below root. */
const char *doctor_path(const struct doctor *doctor, char path[DOCTOR_PATH_SIZE],
                        const char *format, ...) __attribute__((format(printf, 3, 4)));
bool doctor_exists(const struct doctor *doctor, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* A file's first line; "": there is none. */
void doctor_line(const struct doctor *doctor, char line[DOCTOR_LINE_SIZE], const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Called with each line of a file, trimmed, and its number; false ends it. */
typedef bool doctor_line_fn(void *context, const char *line, unsigned number);
/* Regular files of at most 64 KiB. */
void doctor_lines(const struct doctor *doctor, const char *path, doctor_line_fn *take,
                  void *context);
/* The number of the first line that begins so; 0: none. */
unsigned doctor_line_beginning(const struct doctor *doctor, const char *path, const char *begin);

/* The names in a folder, sorted, 1000 at most; false ends it. */
typedef bool doctor_name_fn(void *context, const char *name);
void doctor_names(const struct doctor *doctor, const char *folder, doctor_name_fn *take,
                  void *context);

/* The first process of that name; NULL: none. */
const struct doctor_process *doctor_process(const struct doctor *doctor, const char *name);

/* The file in which systemd finds that unit; NULL: in none. In a buffer of its own. */
const char *doctor_unit(const struct doctor *doctor, const char *unit);

/* ---- what they say ---- */

/* Something disturbs. where: the file that says so, or NULL; line 0: all of it. */
void doctor_tell(struct doctor *doctor, const char *where, unsigned line, const char *remedy,
                 const char *format, ...) __attribute__((format(printf, 5, 6)));

/* ---- the probes ---- */

void doctor_bluetoothd(struct doctor *doctor);
void doctor_blocks(struct doctor *doctor);
void doctor_hardware(struct doctor *doctor);
void doctor_hostapd(struct doctor *doctor);
void doctor_network_manager(struct doctor *doctor);
void doctor_other_wireless(struct doctor *doctor);
void doctor_modem_manager(struct doctor *doctor);
void doctor_gpsd(struct doctor *doctor);
void doctor_port(struct doctor *doctor);
void doctor_other_daemons(struct doctor *doctor);
void doctor_realtime(struct doctor *doctor);
void doctor_container(struct doctor *doctor);

#endif
