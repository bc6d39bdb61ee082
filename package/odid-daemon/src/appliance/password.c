/* The technician's password: of it only the access point's key is kept. One that the board made for
 * itself is kept as it is, for the volume CONFIG to show. */
#include "appliance/password.h"

#include <errno.h>
#include <fcntl.h>
#include <nettle/memops.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/maintenance_key.h"
#include "appliance/places.h"
#include "base/log.h"
#include "base/whole_file.h"
#include "config/config_ini.h"

/*
 * In data; the appliance makes the access point's name at its first boot. The
 * key is made of the password and that name: the file has both, a line each, so
 * that no power cut leaves one without the other. The name in it counts; the
 * appliance's S33secrets brings the access point's back in line with it.
 */
#define SECRETS "secrets"
#define KEY_FILE SECRETS "/maintenance.psk"
#define KEY_FILE_MAX 256 /* octets */
#define MADE_FILE SECRETS "/maintenance.made"
#define SSID_FILE SECRETS "/wifi_ssid"
#define SSID_DEFAULT "RemoteID"
#define SSID_MAX 32

/* "k7wd-93hp-qfxm": 59 random bits in letters that nobody takes for others. */
#define MADE_LETTERS "abcdefghjkmnpqrstuvwxyz23456789"
#define MADE_GROUPS 3
#define MADE_GROUP 4
#define MADE_LENGTH (MADE_GROUPS * (MADE_GROUP + 1) - 1)

static void data_path(const char *data, const char *name, char path[PLACES_PATH_SIZE])
{
    snprintf(path, PLACES_PATH_SIZE, "%s/%s", data, name);
}

/* The file's first line, shortened to size - 1; empty when there is none. */
static void read_line(const char *path, char *line, size_t size)
{
    size_t length = 0;
    char *text = whole_file_read(path, 256, &length);

    snprintf(line, size, "%.*s", text == NULL ? 0 : (int)strcspn(text, "\r\n"),
             text == NULL ? "" : text);
    free(text);
}

static int remove_file(const char *path)
{
    return unlink(path) < 0 && errno != ENOENT ? -errno : 0;
}

/* The access point's name, as hostapd's configuration has it. */
static void read_ssid(const char *data, char ssid[SSID_MAX + 1])
{
    char path[PLACES_PATH_SIZE];

    data_path(data, SSID_FILE, path);
    read_line(path, ssid, SSID_MAX + 1);
    if (ssid[0] == '\0') {
        snprintf(ssid, SSID_MAX + 1, "%s", SSID_DEFAULT);
    }
}

/* The name that a kept key was made with: its second line, or, where an earlier version wrote no
 * such, the access point's. */
static void read_key_ssid(const char *data, const char *kept, char ssid[SSID_MAX + 1])
{
    const char *line = strchr(kept, '\n');

    if (line == NULL || line[1] == '\0' || line[1] == '\n') {
        read_ssid(data, ssid);
        return;
    }
    snprintf(ssid, SSID_MAX + 1, "%.*s", (int)strcspn(line + 1, "\r\n"), line + 1);
}

static int make_secrets(const char *data)
{
    char path[PLACES_PATH_SIZE];

    data_path(data, SECRETS, path);
    return mkdir(path, 0700) < 0 && errno != EEXIST ? -errno : 0;
}

static int keep_key(const char *data, const char *password)
{
    char path[PLACES_PATH_SIZE], ssid[SSID_MAX + 1], key[MAINTENANCE_KEY_SIZE];
    char lines[sizeof(key) + sizeof(ssid) + 1];
    int result = make_secrets(data);

    if (result < 0) {
        return result;
    }
    read_ssid(data, ssid);
    maintenance_key(password, ssid, key);
    snprintf(lines, sizeof(lines), "%s\n%s\n", key, ssid);
    data_path(data, KEY_FILE, path);
    result = whole_file_replace(path, lines, strlen(lines), 0600);
    explicit_bzero(key, sizeof(key));
    explicit_bzero(lines, sizeof(lines));
    return result;
}

int password_keep(const char *data, const char *password)
{
    char path[PLACES_PATH_SIZE];
    int result;

    if (password[0] == '\0') {
        data_path(data, KEY_FILE, path);
        result = remove_file(path);
    } else {
        result = keep_key(data, password);
    }
    if (result < 0) {
        return result;
    }
    /* Last: while its key is in force it has to be known. Where power fails before that,
     * password_show_made does it. */
    data_path(data, MADE_FILE, path);
    return remove_file(path);
}

/* Also of one that can't be read now; not of what a failing disk has made of one. */
bool password_known(const char *data)
{
    char path[PLACES_PATH_SIZE], *kept;
    size_t length;
    bool known;

    data_path(data, KEY_FILE, path);
    kept = whole_file_read(path, KEY_FILE_MAX, &length);
    if (kept == NULL) {
        return errno != ENOENT;
    }
    known = strspn(kept, "0123456789abcdef") == MAINTENANCE_KEY_SIZE - 1;
    explicit_bzero(kept, length);
    free(kept);
    return known;
}

int password_check(const char *data, const char *password)
{
    char path[PLACES_PATH_SIZE], ssid[SSID_MAX + 1], key[MAINTENANCE_KEY_SIZE], *kept;
    size_t length;
    int result;

    data_path(data, KEY_FILE, path);
    kept = whole_file_read(path, KEY_FILE_MAX, &length);
    if (kept == NULL || length < sizeof(key) - 1) {
        result = kept == NULL ? -errno : -ENOENT;
        free(kept);
        return result;
    }
    read_key_ssid(data, kept, ssid);
    maintenance_key(password, ssid, key);
    result = nettle_memeql_sec(kept, key, sizeof(key) - 1);
    explicit_bzero(kept, length);
    explicit_bzero(key, sizeof(key));
    free(kept);
    return result;
}

/* ---- one that was taken from the volume ---- */

/* Writes [from, to) of each line that differs, counted from where its text begins; and waits until
 * it is on the disk. */
static int write_lines(int fd, const char *old, const char *blanked, size_t length, size_t from,
                       size_t to)
{
    for (size_t at = 0, ending, line; at < length; at += line + ending) {
        size_t first = at + strspn(blanked + at, " \t"), end;

        line = config_ini_line(old + at, length - at, &ending);
        end = first + to < at + line ? first + to : at + line;
        if (memcmp(old + at, blanked + at, line) != 0 && first + from < end &&
            pwrite(fd, blanked + first + from, end - first - from, (off_t)(first + from)) !=
                (ssize_t)(end - first - from)) {
            return errno != 0 ? -errno : -EIO;
        }
    }
    return fsync(fd) < 0 ? -errno : 0;
}

/*
 * In place, not by a new file: the sectors that hold the password are the ones
 * to be overwritten, and neither FAT nor folder change. "password = x" becomes
 * ";assword = x", then ";assword", then the note: wherever power fails, no half
 * password is left that would be taken for one, and the next import goes on.
 */
int password_blank(const char *path, const char *old, const char *blanked, size_t length)
{
    int fd = open(path, O_WRONLY | O_CLOEXEC), result = fd < 0 ? -errno : 0;

    if (result == 0) {
        result = write_lines(fd, old, blanked, length, 0, 1);
    }
    if (result == 0) {
        result = write_lines(fd, old, blanked, length, strlen("password"), SIZE_MAX / 2);
    }
    if (result == 0) {
        result = write_lines(fd, old, blanked, length, 1, strlen("password"));
    }
    if (fd >= 0) {
        close(fd);
    }
    return result;
}

/* ---- one that the board makes ---- */

static int make(const char *data, char password[MADE_LENGTH + 1])
{
    char path[PLACES_PATH_SIZE], line[MADE_LENGTH + 2];
    uint8_t random[MADE_LENGTH];
    int result = make_secrets(data);

    if (result == 0 && getrandom(random, sizeof(random), 0) != sizeof(random)) {
        result = -EIO;
    }
    if (result < 0) {
        return result;
    }
    for (size_t i = 0; i < MADE_LENGTH; i++) {
        bool between = i % (MADE_GROUP + 1) == MADE_GROUP;

        password[i] = between ? '-' : MADE_LETTERS[random[i] % (sizeof(MADE_LETTERS) - 1)];
    }
    password[MADE_LENGTH] = '\0';
    snprintf(line, sizeof(line), "%s\n", password);
    data_path(data, MADE_FILE, path);
    return whole_file_replace(path, line, strlen(line), 0600);
}

/* Notepad's line ends. Written only when it isn't there as it should be: it is there at each boot.
 */
static int show(const char *data, const char *path, const char *password)
{
    char ssid[SSID_MAX + 1], text[512], *old;
    size_t length = 0;
    int result = 0;

    read_ssid(data, ssid);
    snprintf(text, sizeof(text),
             "The password of the access point %s in maintenance:\r\n\r\n"
             "    %s\r\n\r\n"
             "The board made it, because none was set. To have another one, write it into\r\n"
             "odid.conf as [maintenance] password; this file then goes at the next power-on.\r\n",
             ssid, password);
    old = whole_file_read(path, sizeof(text), &length);
    if (old == NULL || strcmp(old, text) != 0) {
        result = whole_file_replace(path, text, strlen(text), 0600);
    }
    free(old);
    return result;
}

static bool is_made(const char *password)
{
    for (size_t i = 0; i < MADE_LENGTH; i++) {
        bool between = i % (MADE_GROUP + 1) == MADE_GROUP;

        if (password[i] == '\0' || strchr(between ? "-" : MADE_LETTERS, password[i]) == NULL) {
            return false;
        }
    }
    return true;
}

int password_show_made(const char *data, const char *directory, bool *made)
{
    char path[PLACES_PATH_SIZE], password[MADE_LENGTH + 1];
    bool good, worn, known;
    int right, result = 0;

    *made = false;
    data_path(data, MADE_FILE, path);
    read_line(path, password, sizeof(password));
    good = is_made(password);
    /* Then it was the one in force (password_keep), and nobody can read it any more. */
    worn = !good && access(path, F_OK) == 0;
    known = !worn && password_known(data);
    right = good && known ? password_check(data, password) : -ENOENT;
    if (worn) {
        log_warning("the password that the board made is damaged: another one is made");
    }
    if (right == 0) { /* another one is in force */
        good = false;
        result = remove_file(path);
    } else if (!good && !known) {
        result = make(data, password);
        good = true;
    }
    if (result == 0 && good && right < 0) { /* its key isn't there, or can't be read */
        result = keep_key(data, password);
    }
    if (result < 0) {
        return result;
    }
    *made = good;
    data_path(directory, PASSWORD_NAME, path);
    return good ? show(data, path, password) : remove_file(path);
}
