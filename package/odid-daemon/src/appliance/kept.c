#include "appliance/kept.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "config/config.h"

#define PATH_SIZE (CONFIG_PATH_SIZE + 16)
#define TEXT_SIZE 256
/* Beyond what MAVLink can say; the text has room for it. */
#define ALTITUDE_MAX_M 1e7

static const char *const armed_words[] = {
    [KEPT_UNHEARD] = "unheard", [KEPT_DISARMED] = "no",   [KEPT_ARMED] = "yes",
    [KEPT_SILENT] = "silent",   [KEPT_UNSAID] = "unsaid", [KEPT_AWAITED] = "awaited"};

static bool is_altitude(double altitude_m)
{
    return isnan(altitude_m) || fabs(altitude_m) < ALTITUDE_MAX_M;
}

static void parse_takeoff(const char *text, struct kept_takeoff *takeoff)
{
    takeoff->known =
        sscanf(text, "takeoff %lf %lf %lf %lf", &takeoff->latitude_deg, &takeoff->longitude_deg,
               &takeoff->altitude_msl_m, &takeoff->altitude_geodetic_m) == 4 &&
        fabs(takeoff->latitude_deg) <= 90 && fabs(takeoff->longitude_deg) <= 180 &&
        is_altitude(takeoff->altitude_msl_m) && is_altitude(takeoff->altitude_geodetic_m);
}

static void parse_armed(const char *word, struct kept *kept)
{
    for (size_t i = 0; i < sizeof(armed_words) / sizeof(armed_words[0]); i++) {
        if (strcmp(word, armed_words[i]) == 0) {
            kept->armed = (enum kept_armed)i;
        }
    }
}

static void parse_channels(const char *names, bool channels[CHANNELS])
{
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        channels[channel] = strstr(names, channel_name(channel)) != NULL;
    }
}

static void parse_line(const char *line, struct kept *kept)
{
    unsigned vehicle;
    char word[8];

    if (sscanf(line, "vehicle %u", &vehicle) == 1 && vehicle <= UINT8_MAX) {
        kept->vehicle = (uint8_t)vehicle;
    } else if (sscanf(line, "armed-once %7s", word) == 1) {
        kept->armed_once = strcmp(word, "no") != 0;
    } else if (sscanf(line, "fix %7s", word) == 1) {
        kept->fix_known = strcmp(word, "yes") == 0;
    } else if (sscanf(line, "vertical-inverted %7s", word) == 1) {
        kept->vertical_inverted = strcmp(word, "yes") == 0;
    } else if (sscanf(line, "crashed %7s", word) == 1) {
        kept->crashed = strcmp(word, "yes") == 0;
    } else if (sscanf(line, "armed %7s", word) == 1) {
        parse_armed(word, kept);
    } else if (strncmp(line, "on-air ", strlen("on-air ")) == 0) {
        parse_channels(line + strlen("on-air "), kept->on_air);
    } else if (strncmp(line, "told-lost ", strlen("told-lost ")) == 0) {
        parse_channels(line + strlen("told-lost "), kept->told_lost);
    } else if (strncmp(line, "takeoff ", strlen("takeoff ")) == 0) {
        parse_takeoff(line, &kept->takeoff);
    }
}

/* Returns the text's length, or -errno. The folder is the daemon's, and the reader may be root. */
static ssize_t read_kept_text(const char *run_dir, char text[TEXT_SIZE])
{
    char path[PATH_SIZE];
    struct stat file;
    ssize_t length;
    int fd;

    snprintf(path, sizeof(path), "%s/" KEPT_FILE, run_dir);
    fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return -errno;
    }
    length = fstat(fd, &file) == 0 && S_ISREG(file.st_mode) ? read(fd, text, TEXT_SIZE - 1) : -1;
    close(fd);
    return length < 0 ? -EIO : length;
}

int kept_read(const char *run_dir, struct kept *kept)
{
    char text[TEXT_SIZE] = "", *rest = text, *line;
    ssize_t length = read_kept_text(run_dir, text);

    memset(kept, 0, sizeof(*kept));
    if (length < 0) {
        return (int)length;
    }
    kept->armed = KEPT_ARMED;
    kept->armed_once = true;
    while ((line = strsep(&rest, "\n")) != NULL) {
        parse_line(line, kept);
    }
    kept->takeoff.known = kept->takeoff.known && kept->vehicle != 0;
    return 0;
}

static const char *yes_or_no(bool is)
{
    return is ? "yes" : "no";
}

/* Returns the length with that line, which begins with its name. */
static size_t show_channels(const char *name, const bool channels[CHANNELS], char text[TEXT_SIZE],
                            size_t length)
{
    length += (size_t)snprintf(text + length, TEXT_SIZE - length, "%s", name);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (channels[channel]) {
            length +=
                (size_t)snprintf(text + length, TEXT_SIZE - length, " %s", channel_name(channel));
        }
    }
    text[length++] = '\n';
    return length;
}

static size_t show(const struct kept *kept, char text[TEXT_SIZE])
{
    const struct kept_takeoff *takeoff = &kept->takeoff;
    size_t length = (size_t)snprintf(
        text, TEXT_SIZE,
        "vehicle %u\narmed %s\narmed-once %s\nfix %s\nvertical-inverted %s\n"
        "crashed %s\n",
        kept->vehicle, armed_words[kept->armed], yes_or_no(kept->armed_once),
        yes_or_no(kept->fix_known), yes_or_no(kept->vertical_inverted), yes_or_no(kept->crashed));

    length = show_channels("on-air", kept->on_air, text, length);
    length = show_channels("told-lost", kept->told_lost, text, length);
    if (takeoff->known) { /* an unknown altitude is "nan" */
        length +=
            (size_t)snprintf(text + length, TEXT_SIZE - length, "takeoff %.9f %.9f %.3f %.3f\n",
                             takeoff->latitude_deg, takeoff->longitude_deg, takeoff->altitude_msl_m,
                             takeoff->altitude_geodetic_m);
    }
    return length;
}

/* Returns 0, or -errno. flags: beside O_WRONLY. */
static int write_text(const char *path, int flags, const char *text, size_t length)
{
    /* Nobody's lease is waited for. */
    int fd = open(path, O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK | flags, 0644), result = 0;

    if (fd < 0) {
        return -errno;
    }
    errno = EIO;
    if (write(fd, text, length) != (ssize_t)length || ftruncate(fd, (off_t)length) < 0) {
        result = -errno;
    }
    close(fd);
    return result;
}

/*
 * Where there is no room for another file, or no descriptor for it, the old one
 * must not stand: "no" of before the take-off would open maintenance in flight.
 * What it has of memory takes the new text; else nobody is told anything.
 */
int kept_write(const char *run_dir, const struct kept *kept)
{
    char path[PATH_SIZE], fresh[PATH_SIZE], text[TEXT_SIZE];
    size_t length = show(kept, text);
    int result;

    snprintf(path, sizeof(path), "%s/" KEPT_FILE, run_dir);
    snprintf(fresh, sizeof(fresh), "%s/" KEPT_FILE ".new", run_dir);
    unlink(fresh); /* whoever left it, with whatever mode */
    result = write_text(fresh, O_CREAT | O_EXCL, text, length);
    if (result == 0 && rename(fresh, path) < 0) {
        result = -errno;
    }
    if (result < 0) {
        unlink(fresh);
        result = write_text(path, 0, text, length);
    }
    if (result < 0) {
        unlink(path);
    }
    return result;
}
