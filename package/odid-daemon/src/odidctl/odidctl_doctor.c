/* odidctl doctor: runs the probes, one after the other. */
#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "appliance/status_fetch.h"
#include "odidctl/doctor.h"
#include "odidctl/odidctl.h"

#define PATIENCE_MS 3000
#define PROCESSES_MAX 4096

static const struct {
    const char *about;
    void (*look)(struct doctor *doctor);
} probes[] = {
    {"bluetoothd", doctor_bluetoothd},
    {"switched-off radios", doctor_blocks},
    {"radios and their firmware", doctor_hardware},
    {"hostapd", doctor_hostapd},
    {"NetworkManager", doctor_network_manager},
    {"wpa_supplicant and the like", doctor_other_wireless},
    {"ModemManager", doctor_modem_manager},
    {"gpsd", doctor_gpsd},
    {"the autopilot's port", doctor_port},
    {"other Remote ID programs", doctor_other_daemons},
    {"real-time priority", doctor_realtime},
    {"what a container can't do", doctor_container},
};

/* ---- processes ---- */

static void read_command(const struct doctor *doctor, struct doctor_process *process)
{
    char path[DOCTOR_PATH_SIZE];
    FILE *file = fopen(doctor_path(doctor, path, "/proc/%d/cmdline", process->pid), "re");
    size_t length = 0;

    if (file != NULL) {
        length = fread(process->command, 1, sizeof(process->command) - 1, file);
        fclose(file);
    }
    for (size_t i = 0; i + 1 < length; i++) {
        process->command[i] = process->command[i] == '\0' ? ' ' : process->command[i];
    }
    process->command[length] = '\0';
}

/* /proc is a folder for each process, among others; all of them by number. */
static void read_processes(struct doctor *doctor)
{
    char path[DOCTOR_PATH_SIZE], name[DOCTOR_LINE_SIZE];
    DIR *folder = opendir(doctor_path(doctor, path, "/proc"));
    struct dirent *entry;

    doctor->processes = calloc(PROCESSES_MAX, sizeof(*doctor->processes));
    while (folder != NULL && doctor->processes != NULL && doctor->count < PROCESSES_MAX &&
           (entry = readdir(folder)) != NULL) {
        struct doctor_process *process = &doctor->processes[doctor->count];

        process->pid = atoi(entry->d_name);
        if (process->pid <= 0) {
            continue;
        }
        doctor_line(doctor, name, "/proc/%d/comm", process->pid);
        snprintf(process->name, sizeof(process->name), "%.15s", name);
        read_command(doctor, process);
        doctor->count += name[0] != '\0';
    }
    if (folder != NULL) {
        closedir(folder);
    }
}

/* ---- each in a process of its own ---- */

/* Returns how much it found. */
static unsigned run_probe(struct doctor *doctor, const char *about,
                          void (*look)(struct doctor *doctor))
{
    struct pollfd ended = {.events = POLLIN};
    int status = 0;
    pid_t child;

    fflush(stdout);
    child = fork();
    if (child == 0) {
        doctor->found = 0;
        look(doctor);
        fflush(stdout);
        _exit(doctor->found > 100 ? 100 : (int)doctor->found);
    }
    ended.fd = child < 0 ? -1 : (int)syscall(SYS_pidfd_open, child, 0);
    if (ended.fd >= 0 && poll(&ended, 1, PATIENCE_MS) == 1 && waitpid(child, &status, 0) == child &&
        WIFEXITED(status)) {
        close(ended.fd);
        return (unsigned)WEXITSTATUS(status);
    }
    if (child > 0) {
        kill(child, SIGKILL); /* nor is it waited for: the kernel may hold it */
    }
    printf("Whether %s disturb could not be found out within %d s.\n", about, PATIENCE_MS / 1000);
    return 1;
}

int odidctl_doctor(const struct places *places)
{
    struct doctor doctor = {.root = places->root};
    struct config config;
    unsigned found = 0;
    int error;

    config_defaults(&config);
    config_read_file(&config, places->config, config_ignore_sentence, NULL);
    explicit_bzero(config.maintenance_password, sizeof(config.maintenance_password));
    doctor.config = &config;
    doctor.status = status_fetch(places->run_dir, &error);
    doctor.contained =
        doctor_exists(&doctor, "/run/.containerenv") || doctor_exists(&doctor, "/.dockerenv");
    read_processes(&doctor);
    for (size_t i = 0; i < sizeof(probes) / sizeof(probes[0]); i++) {
        found += run_probe(&doctor, probes[i].about, probes[i].look);
    }
    if (geteuid() != 0) {
        puts("Who has the autopilot's port open is seen by root only.");
    }
    if (found == 0) {
        puts("Nothing here is seen to disturb Remote ID.");
    }
    json_object_put(doctor.status);
    free(doctor.processes);
    return found == 0 ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}
