/* The doctor's probes of the autopilot's serial port: who else opens it. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "odidctl/doctor.h"

/* From a port up to its USB device at most. */
#define PARENTS 6

typedef void port_fn(struct doctor *doctor, const char *port);

struct each {
    struct doctor *doctor;
    port_fn *look;
};

static bool take_port(void *context, const char *name)
{
    struct each *each = context;

    if (strncmp(name, "ttyACM", 6) == 0) {
        each->look(each->doctor, name);
    }
    return true;
}

/* The daemon's own port; where another program has it, each one that an autopilot's USB can be. */
static void each_port(struct doctor *doctor, port_fn *look)
{
    char path[DOCTOR_PATH_SIZE], real[PATH_MAX], *name;
    struct each each = {.doctor = doctor, .look = look};

    if (doctor->config->source == MAVLINK_SOURCE_UDP) {
        doctor_names(doctor, "/sys/class/tty", take_port, &each);
        return;
    }
    /* A name of /dev/serial/by-id is a link. */
    if (realpath(doctor_path(doctor, path, "%s", doctor->config->device), real) == NULL) {
        snprintf(real, sizeof(real), "%s", doctor->config->device);
    }
    name = strrchr(real, '/');
    look(doctor, name == NULL ? real : name + 1);
}

/* ---- ModemManager ---- */

/* What udev knows of a device: its properties, a line each. */
static bool udev_says(const struct doctor *doctor, const char *device, const char *what)
{
    char number[DOCTOR_LINE_SIZE], path[DOCTOR_PATH_SIZE];

    doctor_line(doctor, number, "%s/dev", device);
    snprintf(path, sizeof(path), "/run/udev/data/c%.20s", number);
    return number[0] != '\0' && doctor_line_beginning(doctor, path, what) > 0;
}

static bool is_ignored(const struct doctor *doctor, const char *port)
{
    char device[DOCTOR_PATH_SIZE], *slash;

    snprintf(device, sizeof(device), "/sys/class/tty/%.60s", port);
    if (udev_says(doctor, device, "E:ID_MM_DEVICE_IGNORE=1") ||
        udev_says(doctor, device, "E:ID_MM_PORT_IGNORE=1")) {
        return true;
    }
    snprintf(device, sizeof(device), "/sys/class/tty/%.60s/device/..", port);
    for (int i = 0; i < PARENTS && (slash = device + strlen(device)) != NULL; i++) {
        if (udev_says(doctor, device, "E:ID_MM_DEVICE_IGNORE=1")) {
            return true;
        }
        snprintf(slash, sizeof(device) - (size_t)(slash - device), "/..");
    }
    return false;
}

static void judge_modem_manager(struct doctor *doctor, const char *port)
{
    const char *rules = "/etc/udev/rules.d/60-odid.rules";
    char remedy[400];

    if ((strncmp(port, "ttyACM", 6) != 0 && strncmp(port, "ttyUSB", 6) != 0) ||
        !doctor_exists(doctor, "/sys/class/tty/%.60s", port) || is_ignored(doctor, port)) {
        return;
    }
    snprintf(
        remedy, sizeof(remedy),
        "put SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"VVVV\", ENV{ID_MM_DEVICE_IGNORE}=\"1\" into "
        "%s, with VVVV as lsusb has it, and udevadm control --reload; plug it in again",
        rules);
    doctor_tell(
        doctor, rules, doctor_line_beginning(doctor, rules, "SUBSYSTEM"), remedy,
        "ModemManager looks on /dev/%s for a modem: what it says there goes to the autopilot.",
        port);
}

void doctor_modem_manager(struct doctor *doctor)
{
    if (doctor_process(doctor, "ModemManager") != NULL) {
        each_port(doctor, judge_modem_manager);
    }
}

/* ---- gpsd ---- */

#define GPSD_FILE "/etc/default/gpsd"

struct gpsd {
    const char *port, *device;
    unsigned line;
};

static bool take_gpsd_line(void *context, const char *line, unsigned number)
{
    struct gpsd *gpsd = context;

    if (strncmp(line, "DEVICES=", 8) == 0 &&
        (strstr(line, gpsd->port) != NULL || strstr(line, gpsd->device) != NULL)) {
        gpsd->line = number;
    }
    if (strncmp(line, "USBAUTO=\"true\"", 14) == 0 && strncmp(gpsd->port, "tty", 3) == 0 &&
        gpsd->line == 0) {
        gpsd->line = number;
    }
    return true;
}

static void judge_gpsd(struct doctor *doctor, const char *port)
{
    struct gpsd gpsd = {.port = port, .device = doctor->config->device};
    const struct doctor_process *process = doctor_process(doctor, "gpsd");

    doctor_lines(doctor, GPSD_FILE, take_gpsd_line, &gpsd);
    if (gpsd.line > 0 || strstr(process->command, port) != NULL) {
        doctor_tell(doctor, GPSD_FILE, gpsd.line,
                    "name the receiver's own port in DEVICES, and set USBAUTO=\"false\"",
                    "gpsd (process %d) opens /dev/%s, or each serial port that is plugged in.",
                    process->pid, port);
    }
}

void doctor_gpsd(struct doctor *doctor)
{
    if (doctor_process(doctor, "gpsd") != NULL) {
        each_port(doctor, judge_gpsd);
    }
}

/* ---- whoever has it open ---- */

struct holder {
    struct doctor *doctor;
    const struct doctor_process *process;
    char port[80]; /* /dev/ttyACM0 */
    bool holds;
};

static bool take_descriptor(void *context, const char *name)
{
    struct holder *holder = context;
    char path[DOCTOR_PATH_SIZE], target[DOCTOR_PATH_SIZE];
    ssize_t length =
        readlink(doctor_path(holder->doctor, path, "/proc/%d/fd/%.20s", holder->process->pid, name),
                 target, sizeof(target) - 1);

    target[length < 0 ? 0 : length] = '\0';
    holder->holds = strcmp(target, holder->port) == 0;
    return !holder->holds;
}

static void judge_holders(struct doctor *doctor, const char *port)
{
    struct holder holder = {.doctor = doctor};
    char folder[40];

    snprintf(holder.port, sizeof(holder.port), "/dev/%.60s", port);
    for (size_t i = 0; i < doctor->count; i++) {
        holder.process = &doctor->processes[i];
        holder.holds = false;
        if (strncmp(holder.process->name, "odid", 4) == 0) {
            continue;
        }
        snprintf(folder, sizeof(folder), "/proc/%d/fd", holder.process->pid);
        doctor_names(doctor, folder, take_descriptor, &holder);
        if (holder.holds) {
            doctor_tell(doctor, NULL, 0,
                        "end it; or, if it is a router of MAVLink, let it send to 127.0.0.1:14550 "
                        "and set [mavlink] source = udp in odid.conf",
                        "%s (process %d) has %s open, and takes what the autopilot says.",
                        holder.process->name, holder.process->pid, holder.port);
        }
    }
}

struct console {
    char word[80];
    bool there;
};

/* With its speed, or without. */
static bool take_command_line(void *context, const char *line, unsigned number)
{
    struct console *console = context;
    size_t length = strlen(console->word);

    (void)number;
    for (const char *at = line; (at = strstr(at, console->word)) != NULL; at += length) {
        console->there = console->there || at[length] == '\0' || strchr(", ", at[length]) != NULL;
    }
    return false;
}

static void judge_console(struct doctor *doctor, const char *port)
{
    struct console console = {.there = false};

    snprintf(console.word, sizeof(console.word), "console=%.60s", port);
    doctor_lines(doctor, "/proc/cmdline", take_command_line, &console);
    if (console.there) {
        doctor_tell(doctor, "/boot/firmware/cmdline.txt", 1, "take that word out, and start anew",
                    "The kernel writes its messages to the autopilot's port (%s).", console.word);
    }
}

static void judge_port(struct doctor *doctor, const char *port)
{
    judge_holders(doctor, port);
    judge_console(doctor, port);
}

void doctor_port(struct doctor *doctor)
{
    if (doctor->config->source == MAVLINK_SOURCE_SERIAL) { /* else it is for others to have open */
        each_port(doctor, judge_port);
    }
}
