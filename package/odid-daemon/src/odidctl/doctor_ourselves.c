/* The doctor's probes of Remote ID itself: a second one, its priority, what a container keeps from
 * it. */
#include <stdio.h>
#include <string.h>

#include "odidctl/doctor.h"

#define UNITS "/etc/systemd/system"
#define POLICY_FIELD 41 /* of /proc/PID/stat */
#define POLICY_FIFO 1

/* ---- another one ---- */

static bool is_remote_id(const char *words)
{
    static const char *const names[] = {"remoteid",    "remote-id", "remote_id",
                                        "opendroneid", "droneid",   "odid"};

    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        if (strcasestr(words, names[i]) != NULL) {
            return true;
        }
    }
    return false;
}

/* This package's. (An access point's configuration is in our folder.) */
static bool is_ours(const struct doctor_process *process)
{
    static const char *const names[] = {"odid-keeper",  "odidctl",       "hostapd",
                                        "odid-beacons", "odid-recorder", "odid-clock",
                                        "odid-update",  "odid-web"};

    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        if (strcmp(process->name, names[i]) == 0) {
            return true;
        }
    }
    return false;
}

/* The program, and what it interprets; not what else is said to it: an editor may have our file. */
static bool runs_remote_id(const struct doctor_process *process)
{
    static const char *const interpreters[] = {"python", "node", "java", "perl"};
    char program[DOCTOR_LINE_SIZE];

    if (is_remote_id(process->name)) {
        return true;
    }
    for (size_t i = 0; i < sizeof(interpreters) / sizeof(interpreters[0]); i++) {
        if (strncmp(process->name, interpreters[i], strlen(interpreters[i])) == 0) {
            return is_remote_id(process->command);
        }
    }
    snprintf(program, sizeof(program), "%s", process->command);
    program[strcspn(program, " ")] = '\0';
    return is_remote_id(program);
}

static bool is_installed(const struct doctor_process *process)
{
    return strncmp(process->command, "odid-daemon", 11) == 0 ||
           strncmp(process->command, "/usr/sbin/odid-daemon", 21) == 0;
}

struct starter {
    const struct doctor *doctor;
    char where[DOCTOR_PATH_SIZE];
    unsigned line;
};

static bool take_unit_line(void *context, const char *line, unsigned number)
{
    struct starter *starter = context;

    if (strncmp(line, "ExecStart=", 10) == 0 && is_remote_id(line)) {
        starter->line = number;
    }
    return starter->line == 0;
}

static bool take_unit(void *context, const char *name)
{
    struct starter *starter = context;

    if (strstr(name, ".service") != NULL && strncmp(name, "odid", 4) != 0) {
        snprintf(starter->where, sizeof(starter->where), UNITS "/%.200s", name);
        doctor_lines(starter->doctor, starter->where, take_unit_line, starter);
    }
    return starter->line == 0;
}

void doctor_other_daemons(struct doctor *doctor)
{
    struct starter starter = {.doctor = doctor};
    unsigned daemons = 0;
    bool told = false;
    char remedy[DOCTOR_PATH_SIZE + 60];

    doctor_names(doctor, UNITS, take_unit, &starter);
    if (starter.line > 0) {
        snprintf(remedy, sizeof(remedy), "systemctl disable --now %s",
                 strrchr(starter.where, '/') + 1);
    } else {
        snprintf(remedy, sizeof(remedy), "end it, and take away what starts it");
    }
    for (size_t i = 0; i < doctor->count; i++) {
        const struct doctor_process *process = &doctor->processes[i];

        if (is_ours(process) || !runs_remote_id(process) ||
            (is_installed(process) && ++daemons == 1)) {
            continue;
        }
        doctor_tell(doctor, starter.line > 0 ? starter.where : NULL, starter.line, remedy,
                    "Another Remote ID program runs (%s, process %d): receivers see two aircraft, "
                    "and the two change each other's advertising.",
                    process->command[0] != '\0' ? process->command : process->name, process->pid);
        told = true;
    }
    if (starter.line > 0 && !told) {
        doctor_tell(doctor, starter.where, starter.line, remedy,
                    "A unit of yours starts another Remote ID program.");
    }
}

/* ---- priority ---- */

/* -1: it can't be read. */
static int policy_of(const struct doctor *doctor, int pid)
{
    char line[DOCTOR_LINE_SIZE * 2], path[DOCTOR_PATH_SIZE], *at;
    FILE *file = fopen(doctor_path(doctor, path, "/proc/%d/stat", pid), "re");
    int policy = -1;

    if (file != NULL && fgets(line, sizeof(line), file) != NULL) {
        at = strrchr(line, ')'); /* the second field may have blanks in it */
        for (int field = 2; at != NULL && field < POLICY_FIELD; field++) {
            at = strchr(at + 1, ' ');
        }
        if (at != NULL && sscanf(at, "%d", &policy) != 1) {
            policy = -1;
        }
    }
    if (file != NULL) {
        fclose(file);
    }
    return policy;
}

void doctor_realtime(struct doctor *doctor)
{
    const struct doctor_process *process = doctor_process(doctor, "odid-daemon");
    const char *unit = doctor_unit(doctor, "odid.service");
    int policy;

    if (process == NULL) {
        doctor_tell(doctor, unit, 0, "systemctl start odid, and what journalctl -u odid says",
                    "The Remote ID daemon isn't running.");
        return;
    }
    policy = policy_of(doctor, process->pid);
    if (policy < 0 || policy == POLICY_FIFO) {
        return;
    }
    doctor_tell(doctor, doctor->contained || unit == NULL ? NULL : unit,
                doctor->contained || unit == NULL
                    ? 0
                    : doctor_line_beginning(doctor, unit, "CPUSchedulingPolicy="),
                doctor->contained
                    ? "start the container with --ulimit rtprio=20 --ulimit memlock=-1"
                    : "CPUSchedulingPolicy=fifo in the unit, unchanged by a drop-in (systemctl "
                      "cat odid)",
                "The daemon was refused real-time priority: under load it is late.");
}

/* ---- in a container ---- */

void doctor_container(struct doctor *doctor)
{
    if (!doctor->contained) {
        return;
    }
    if (!doctor_exists(doctor, "/dev/rfkill")) {
        doctor_tell(
            doctor, NULL, 0, "--device /dev/rfkill, or rfkill unblock all around it",
            "In this container nobody can switch a radio on that is switched off by software.");
    }
    if (doctor->config->wifi_beacon_enabled &&
        !doctor_exists(doctor, "%s/%s", doctor->config->hostapd_dir, doctor->config->wifi_iface)) {
        char remedy[CONFIG_PATH_SIZE + 80];

        snprintf(remedy, sizeof(remedy),
                 "run hostapd around it, and give its folder in: -v /run/hostapd:%s",
                 doctor->config->hostapd_dir);
        doctor_tell(doctor, NULL, 0, remedy,
                    "In this container hostapd's control socket isn't there: nothing is on the air "
                    "by Wi-Fi.");
    }
    puts("In a container neither firmware nor other programs are seen: what loads the one and who "
         "the others are, the computer around it has to see to.");
}
