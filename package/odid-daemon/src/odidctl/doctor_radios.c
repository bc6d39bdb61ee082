/* The doctor's probes of the radios: who switches them off, or uses them for something else. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/whole_file.h"
#include "odidctl/doctor.h"

#define NETWORK_MANAGER_FILE "/etc/NetworkManager/conf.d/90-odid.conf"
#define PROGRAM_MAX 8000000
#define HOSTAPD_LEAST 210 /* 2.10: sets a beacon's elements while it runs without a gap */

static bool uses_bluetooth(const struct doctor *doctor)
{
    return doctor->config->bt4_enabled || doctor->config->bt5_enabled;
}

/* ---- bluetoothd ---- */

static int repairs(const struct doctor *doctor, const char *channel)
{
    struct json_object *channels = json_object_object_get(doctor->status, "channels");

    return json_object_get_int(
        json_object_object_get(json_object_object_get(channels, channel), "repairs"));
}

void doctor_bluetoothd(struct doctor *doctor)
{
    const struct doctor_process *process = doctor_process(doctor, "bluetoothd");
    const char *unit = doctor_unit(doctor, "bluetooth.service");
    int count = repairs(doctor, "bt4") + repairs(doctor, "bt5");
    char seen[80] = "";

    if (process == NULL || !uses_bluetooth(doctor)) {
        return;
    }
    if (count > 0) {
        snprintf(seen, sizeof(seen), " Others did so %d times since the daemon's start.", count);
    }
    doctor_tell(
        doctor, unit, unit == NULL ? 0 : doctor_line_beginning(doctor, unit, "ExecStart="),
        "systemctl disable --now bluetooth.service. Who needs it gives Remote ID an adapter "
        "of its own: [broadcast] bt_adapter in odid.conf",
        "bluetoothd (process %d) resets the controller and switches advertising off or over "
        "to its own; the daemon repairs that each time.%s",
        process->pid, seen);
}

/* ---- rfkill ---- */

static bool take_switch(void *context, const char *name)
{
    struct doctor *doctor = context;
    char type[DOCTOR_LINE_SIZE], soft[DOCTOR_LINE_SIZE], hard[DOCTOR_LINE_SIZE], where[300];
    bool wifi;

    doctor_line(doctor, type, "/sys/class/rfkill/%.100s/type", name);
    doctor_line(doctor, soft, "/sys/class/rfkill/%.100s/soft", name);
    doctor_line(doctor, hard, "/sys/class/rfkill/%.100s/hard", name);
    wifi = strcmp(type, "wlan") == 0;
    if (!(wifi ? doctor->config->wifi_beacon_enabled
               : strcmp(type, "bluetooth") == 0 && uses_bluetooth(doctor))) {
        return true;
    }
    if (soft[0] == '1') {
        snprintf(where, sizeof(where), "/sys/class/rfkill/%.100s/soft", name);
        doctor_tell(doctor, where, 1,
                    wifi ? "rfkill unblock wlan (and: is /dev/rfkill of the group odid?)"
                         : "rfkill unblock bluetooth (and: is /dev/rfkill of the group odid?)",
                    "%s is switched off by software, and the daemon doesn't undo it.",
                    wifi ? "Wi-Fi" : "Bluetooth");
    }
    if (hard[0] == '1') {
        snprintf(where, sizeof(where), "/sys/class/rfkill/%.100s/hard", name);
        doctor_tell(doctor, where, 1, "the switch on the device",
                    "%s is switched off by a switch or a pin.", wifi ? "Wi-Fi" : "Bluetooth");
    }
    return true;
}

void doctor_blocks(struct doctor *doctor)
{
    doctor_names(doctor, "/sys/class/rfkill", take_switch, doctor);
}

/* ---- hardware and firmware ---- */

/* The CM4's chip and its relatives: on SDIO, with firmware that Debian has in non-free-firmware. */
static bool take_broadcom(void *context, const char *name)
{
    const struct doctor *doctor = *(const struct doctor **)context;
    char vendor[DOCTOR_LINE_SIZE];

    doctor_line(doctor, vendor, "/sys/bus/sdio/devices/%.100s/vendor", name);
    if (strcmp(vendor, "0x02d0") == 0) {
        *(const struct doctor **)context = NULL;
        return false;
    }
    return true;
}

static void tell_missing(struct doctor *doctor, const char *where, const char *what,
                         const char *package)
{
    const struct doctor *broadcom = doctor;
    char remedy[200];

    doctor_names(doctor, "/sys/bus/sdio/devices", take_broadcom, &broadcom);
    if (broadcom == NULL) {
        snprintf(remedy, sizeof(remedy), "apt install %s, and start the computer anew", package);
    } else {
        snprintf(remedy, sizeof(remedy),
                 "journalctl -k -g firmware: the driver names the file that it misses");
    }
    doctor_tell(doctor, where, 0, remedy,
                "%s isn't there: no such radio, or its driver or firmware doesn't load.", what);
}

void doctor_hardware(struct doctor *doctor)
{
    const struct config *config = doctor->config;
    char where[300], what[160];

    if (config->wifi_beacon_enabled &&
        !doctor_exists(doctor, "/sys/class/net/%s", config->wifi_iface)) {
        snprintf(where, sizeof(where), "/sys/class/net/%s", config->wifi_iface);
        snprintf(what, sizeof(what), "The Wi-Fi interface %s", config->wifi_iface);
        tell_missing(doctor, where, what, "firmware-brcm80211");
    }
    if (uses_bluetooth(doctor) && strncmp(config->bt_adapter, "hci", 3) == 0 &&
        !doctor_exists(doctor, "/sys/class/bluetooth/%s", config->bt_adapter)) {
        snprintf(where, sizeof(where), "/sys/class/bluetooth/%s", config->bt_adapter);
        snprintf(what, sizeof(what), "The Bluetooth adapter %s", config->bt_adapter);
        tell_missing(doctor, where, what, "bluez-firmware pi-bluetooth");
    }
}

/* ---- hostapd ---- */

/* What the running program says of itself: "hostapd v2.10". 0: it can't be read. */
static unsigned hostapd_version(const struct doctor *doctor, int pid, char text[16])
{
    static const char words[] = "hostapd v";
    char path[DOCTOR_PATH_SIZE], *program, *at;
    unsigned major = 0, minor = 0;
    size_t length;

    program = whole_file_read(doctor_path(doctor, path, "/proc/%d/exe", pid), PROGRAM_MAX, &length);
    at = program == NULL ? NULL : memmem(program, length, words, sizeof(words) - 1);
    if (at != NULL && sscanf(at + sizeof(words) - 1, "%2u.%3u", &major, &minor) == 2) {
        snprintf(text, 16, "%u.%u", major, minor);
    }
    free(program);
    return major * 100 + minor * (major > 0);
}

/* A person's own: this one for hostapd.service, INTERFACE.conf for hostapd@INTERFACE. */
static const char own_file[] = "/etc/hostapd/hostapd.conf";

static void judge_own_file(struct doctor *doctor, const char *path)
{
    char line[DOCTOR_LINE_SIZE], folder[CONFIG_PATH_SIZE + 24], older[CONFIG_PATH_SIZE + 24];
    unsigned group = doctor_line_beginning(doctor, path, "ctrl_interface_group=");
    unsigned elements = doctor_line_beginning(doctor, path, "vendor_elements=");

    doctor_line(doctor, line, "%s", path);
    if (!doctor_exists(doctor, "%s", path)) {
        return;
    }
    snprintf(folder, sizeof(folder), "ctrl_interface=%s", doctor->config->hostapd_dir);
    snprintf(older, sizeof(older), "ctrl_interface=/var%s", doctor->config->hostapd_dir);
    if ((doctor_line_beginning(doctor, path, folder) == 0 &&
         doctor_line_beginning(doctor, path, older) == 0) ||
        doctor_line_beginning(doctor, path, "ctrl_interface_group=odid-hostapd") == 0) {
        doctor_tell(
            doctor, path, group,
            "have there ctrl_interface=/run/hostapd and ctrl_interface_group=odid-hostapd, and in "
            "odid.conf [broadcast] hostapd_dir = /run/hostapd",
            "Your own hostapd has no control socket that the daemon can use.");
    }
    if (elements > 0) {
        doctor_tell(doctor, path, elements, "take the line out: the daemon alone sets these",
                    "Your own hostapd sets vendor elements itself, and so does Remote ID.");
    }
}

/* It keeps ours from being started, and may be meant for another interface. */
static void judge_whose_it_is(struct doctor *doctor, const char *iface)
{
    char ours[32];
    unsigned line = doctor_line_beginning(doctor, own_file, "interface=");

    snprintf(ours, sizeof(ours), "interface=%s", iface);
    if (line != 0 && doctor_line_beginning(doctor, own_file, ours) == 0) {
        doctor_tell(doctor, own_file, line,
                    "call it /etc/hostapd/INTERFACE.conf, for hostapd@INTERFACE.service",
                    "Your own hostapd is for another interface than %s, and by that file ours "
                    "isn't started.",
                    iface);
    }
}

/* By a configuration that it names. */
static bool is_for_another(const struct doctor *doctor, const struct doctor_process *process)
{
    char command[DOCTOR_LINE_SIZE], ours[32], *rest = command, *word;
    bool another = false;

    snprintf(command, sizeof(command), "%s", process->command);
    snprintf(ours, sizeof(ours), "interface=%s", doctor->config->wifi_iface);
    strsep(&rest, " ");
    while ((word = strsep(&rest, " ")) != NULL) {
        if (word[0] != '/' || doctor_line_beginning(doctor, word, "interface=") == 0) {
            continue;
        }
        if (doctor_line_beginning(doctor, word, ours) != 0) {
            return false;
        }
        another = true;
    }
    return another;
}

static const struct doctor_process *our_hostapd(const struct doctor *doctor)
{
    for (size_t i = 0; i < doctor->count; i++) {
        const struct doctor_process *process = &doctor->processes[i];

        if (strcmp(process->name, "hostapd") == 0 && !is_for_another(doctor, process)) {
            return process;
        }
    }
    return NULL;
}

/* Where a person has a file for it, ours isn't started (odid-hostapd@.service). */
static void tell_to_start(struct doctor *doctor, const char *iface)
{
    char remedy[160], ours[32], unit[40] = "odid-hostapd@.service";

    snprintf(ours, sizeof(ours), "interface=%s", iface);
    if (doctor_line_beginning(doctor, own_file, ours) != 0) {
        snprintf(unit, sizeof(unit), "hostapd.service");
        snprintf(remedy, sizeof(remedy),
                 "systemctl unmask hostapd; systemctl enable --now hostapd");
    } else if (doctor_exists(doctor, "/etc/hostapd/%s.conf", iface)) {
        snprintf(unit, sizeof(unit), "hostapd@.service");
        snprintf(remedy, sizeof(remedy), "systemctl enable --now hostapd@%s.service", iface);
    } else {
        snprintf(remedy, sizeof(remedy),
                 "systemctl start odid-hostapd@%s, and what journalctl -u odid-hostapd@%s says",
                 iface, iface);
    }
    doctor_tell(doctor, doctor_unit(doctor, unit), 0, remedy,
                "hostapd isn't running: nothing is on the air by Wi-Fi.");
}

void doctor_hostapd(struct doctor *doctor)
{
    const char *iface = doctor->config->wifi_iface;
    const struct doctor_process *process = our_hostapd(doctor);
    char version[16] = "", path[200];
    unsigned number;

    if (!doctor->config->wifi_beacon_enabled) {
        return;
    }
    judge_own_file(doctor, own_file);
    judge_whose_it_is(doctor, iface);
    snprintf(path, sizeof(path), "/etc/hostapd/%s.conf", iface);
    judge_own_file(doctor, path);
    if (process == NULL && !doctor->contained) {
        tell_to_start(doctor, iface);
    }
    if (process == NULL) {
        return;
    }
    number = hostapd_version(doctor, process->pid, version);
    if (number > 0 && number < HOSTAPD_LEAST) {
        doctor_tell(doctor, NULL, 0, "apt install hostapd (Debian 12 has 2.10), and use that one",
                    "hostapd %s (%s, process %d) is older than 2.10.", version, process->command,
                    process->pid);
    }
}

/* ---- who else wants the interface ---- */

struct profile {
    struct doctor *doctor;
    char where[300];
    unsigned line;
};

static bool take_profile(void *context, const char *name)
{
    struct profile *profile = context;
    char path[300], begin[40];

    snprintf(path, sizeof(path), "/etc/NetworkManager/system-connections/%.200s", name);
    snprintf(begin, sizeof(begin), "interface-name=%s", profile->doctor->config->wifi_iface);
    profile->line = doctor_line_beginning(profile->doctor, path, begin);
    if (profile->line == 0) {
        profile->line = doctor_line_beginning(profile->doctor, path, "type=wifi");
    }
    snprintf(profile->where, sizeof(profile->where), "%s", path);
    return profile->line == 0;
}

/* What it does with an interface it keeps in a file for each. */
void doctor_network_manager(struct doctor *doctor)
{
    const char *iface = doctor->config->wifi_iface;
    struct profile profile = {.doctor = doctor};
    char number[DOCTOR_LINE_SIZE], path[300], remedy[300];

    if (doctor_process(doctor, "NetworkManager") == NULL || !doctor->config->wifi_beacon_enabled) {
        return;
    }
    doctor_line(doctor, number, "/sys/class/net/%s/ifindex", iface);
    snprintf(path, sizeof(path), "/run/NetworkManager/devices/%.20s", number);
    if (number[0] == '\0' || doctor_line_beginning(doctor, path, "managed=true") == 0) {
        return;
    }
    doctor_names(doctor, "/etc/NetworkManager/system-connections", take_profile, &profile);
    snprintf(remedy, sizeof(remedy),
             "put the two lines \"[keyfile]\" and \"unmanaged-devices+=interface-name:%s\" "
             "into " NETWORK_MANAGER_FILE ", and systemctl reload NetworkManager",
             iface);
    doctor_tell(doctor, profile.line > 0 ? profile.where : path,
                profile.line > 0 ? profile.line
                                 : doctor_line_beginning(doctor, path, "managed=true"),
                remedy, "NetworkManager manages %s, and takes it away from hostapd.", iface);
}

/* As a word, or as one behind its -i. */
static bool names_interface(const char *command, const char *iface)
{
    char words[DOCTOR_LINE_SIZE], *rest = words, *word;

    snprintf(words, sizeof(words), "%s", command);
    while ((word = strsep(&rest, " ")) != NULL) {
        if (strcmp(strncmp(word, "-i", 2) == 0 ? word + 2 : word, iface) == 0) {
            return true;
        }
    }
    return false;
}

static void judge_wireless(struct doctor *doctor, const struct doctor_process *process)
{
    const char *iface = doctor->config->wifi_iface;
    char remedy[300], begin[40];
    bool supplicant = strcmp(process->name, "wpa_supplicant") == 0;

    if (supplicant && names_interface(process->command, iface)) {
        snprintf(remedy, sizeof(remedy),
                 "systemctl disable --now wpa_supplicant@%s; with ifupdown, take %s out of "
                 "/etc/network/interfaces",
                 iface, iface);
        snprintf(begin, sizeof(begin), "iface %s", iface);
        doctor_tell(doctor, "/etc/network/interfaces",
                    doctor_line_beginning(doctor, "/etc/network/interfaces", begin), remedy,
                    "wpa_supplicant (process %d) has %s: hostapd can't.", process->pid, iface);
    } else if (strcmp(process->name, "iwd") == 0) {
        doctor_tell(
            doctor, doctor_unit(doctor, "iwd.service"), 0, "systemctl disable --now iwd.service",
            "iwd (process %d) takes every wireless interface, %s among them.", process->pid, iface);
    } else if (strcmp(process->name, "dhcpcd") == 0) {
        snprintf(begin, sizeof(begin), "denyinterfaces %s", iface);
        if (doctor_line_beginning(doctor, "/etc/dhcpcd.conf", begin) == 0) {
            snprintf(remedy, sizeof(remedy), "add the line \"denyinterfaces %s\"", iface);
            doctor_tell(doctor, "/etc/dhcpcd.conf", 0, remedy,
                        "dhcpcd (process %d) starts wpa_supplicant on %s.", process->pid, iface);
        }
    }
}

void doctor_other_wireless(struct doctor *doctor)
{
    for (size_t i = 0; doctor->config->wifi_beacon_enabled && i < doctor->count; i++) {
        judge_wireless(doctor, &doctor->processes[i]);
    }
}
