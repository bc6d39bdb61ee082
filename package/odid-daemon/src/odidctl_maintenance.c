/* odidctl maintenance, and the key of the access point that it opens. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "maintenance_key.h"
#include "odidctl.h"
#include "whole_file.h"

/* In data; the appliance makes the access point's name at its first boot. */
#define KEY_FILE "secrets/maintenance.psk"
#define SSID_FILE "secrets/wifi_ssid"
#define SSID_DEFAULT "RemoteID"
#define SSID_MAX 32

static void key_path(const char *data, char path[ODIDCTL_PATH_SIZE])
{
    snprintf(path, ODIDCTL_PATH_SIZE, "%s/" KEY_FILE, data);
}

/* As hostapd's configuration has it. */
static void read_ssid(const char *data, char ssid[SSID_MAX + 1])
{
    char path[ODIDCTL_PATH_SIZE], *text;
    size_t length;

    snprintf(ssid, SSID_MAX + 1, "%s", SSID_DEFAULT);
    snprintf(path, sizeof(path), "%s/" SSID_FILE, data);
    text = whole_file_read(path, 256, &length);
    if (text != NULL && text[0] != '\0') {
        snprintf(ssid, SSID_MAX + 1, "%.*s", (int)strcspn(text, "\r\n"), text);
    }
    free(text);
}

int odidctl_keep_password(const char *data, const char *password)
{
    char path[ODIDCTL_PATH_SIZE], ssid[SSID_MAX + 1], line[MAINTENANCE_KEY_SIZE + 1];
    int result;

    key_path(data, path);
    if (password[0] == '\0') {
        return unlink(path) < 0 && errno != ENOENT ? -errno : 0;
    }
    read_ssid(data, ssid);
    maintenance_key(password, ssid, line);
    strcat(line, "\n");
    *strrchr(path, '/') = '\0';
    if (mkdir(path, 0700) < 0 && errno != EEXIST) {
        return -errno;
    }
    key_path(data, path);
    result = whole_file_replace(path, line, strlen(line), 0600);
    explicit_bzero(line, sizeof(line));
    return result;
}

bool odidctl_password_known(const char *data)
{
    char path[ODIDCTL_PATH_SIZE];
    struct stat file;

    key_path(data, path);
    return stat(path, &file) == 0 && file.st_size > 0;
}

/* The service "maintenance" looks for the file every other second. */
int odidctl_maintenance(const struct odidctl_places *places, const char *word)
{
    char path[ODIDCTL_PATH_SIZE];
    bool on = strcmp(word, "on") == 0;
    int fd;

    snprintf(path, sizeof(path), "%s/maintenance-asked", places->state);
    if (!on) {
        if (unlink(path) < 0 && errno != ENOENT) {
            fprintf(stderr, "odidctl: maintenance can't be ended: %s: %s\n", path, strerror(errno));
            return ODIDCTL_NOT_GOOD;
        }
        puts(
            "Maintenance ends, unless [maintenance] at_boot keeps it until the aircraft is armed.");
        return ODIDCTL_GOOD;
    }
    if (odidctl_armed(places)) {
        fputs("odidctl: the aircraft is armed: no maintenance.\n", stderr);
        return ODIDCTL_NOT_GOOD;
    }
    fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (fd < 0) {
        fprintf(stderr, "odidctl: can't ask for maintenance: %s: %s\n", path, strerror(errno));
        return ODIDCTL_NOT_GOOD;
    }
    close(fd);
    puts("Maintenance begins within seconds, and ends when the aircraft is armed.");
    if (!odidctl_password_known(places->data)) {
        fputs(
            "odidctl: no [maintenance] password was ever set: nobody can join the access point.\n",
            stderr);
        return ODIDCTL_HALF_DONE;
    }
    return ODIDCTL_GOOD;
}
