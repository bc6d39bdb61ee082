#include "kept.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "config.h"

#define PATH_SIZE (CONFIG_PATH_SIZE + 16)
#define TEXT_SIZE 160
/* In the file: value, used, content_hash (little endian). */
#define COUNTER_SIZE 6
#define COUNTERS (MESSAGE_TYPES + 2)

static void parse_takeoff(const char *text, struct aircraft_takeoff *takeoff)
{
    takeoff->known =
        sscanf(text, "takeoff %lf %lf %lf %lf", &takeoff->latitude_deg, &takeoff->longitude_deg,
               &takeoff->altitude_msl_m, &takeoff->altitude_geodetic_m) == 4 &&
        fabs(takeoff->latitude_deg) <= 90 && fabs(takeoff->longitude_deg) <= 180;
}

void kept_read(const char *run_dir, struct kept *kept)
{
    char path[PATH_SIZE], text[TEXT_SIZE] = "";
    const char *line;
    unsigned vehicle;
    ssize_t length;
    int fd;

    memset(kept, 0, sizeof(*kept));
    snprintf(path, sizeof(path), "%s/kept", run_dir);
    fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return;
    }
    length = read(fd, text, sizeof(text) - 1);
    close(fd);
    if (length <= 0 || sscanf(text, "vehicle %u\n", &vehicle) != 1 || vehicle > UINT8_MAX) {
        return;
    }
    kept->vehicle = (uint8_t)vehicle;
    line = strchr(text, '\n');
    if (line != NULL) {
        parse_takeoff(line + 1, &kept->takeoff);
    }
}

static size_t show(const struct kept *kept, char text[TEXT_SIZE])
{
    const struct aircraft_takeoff *takeoff = &kept->takeoff;
    size_t length = (size_t)snprintf(text, TEXT_SIZE, "vehicle %u\n", kept->vehicle);

    if (takeoff->known) { /* an unknown altitude is "nan" */
        length +=
            (size_t)snprintf(text + length, TEXT_SIZE - length, "takeoff %.9f %.9f %.3f %.3f\n",
                             takeoff->latitude_deg, takeoff->longitude_deg, takeoff->altitude_msl_m,
                             takeoff->altitude_geodetic_m);
    }
    return length;
}

int kept_write(const char *run_dir, const struct kept *kept)
{
    char path[PATH_SIZE], fresh[PATH_SIZE], text[TEXT_SIZE];
    size_t length = show(kept, text);
    int fd, error = 0;

    snprintf(path, sizeof(path), "%s/kept", run_dir);
    snprintf(fresh, sizeof(fresh), "%s/kept.new", run_dir);
    fd = open(fresh, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd < 0) {
        return -errno;
    }
    if (write(fd, text, length) != (ssize_t)length) {
        error = errno != 0 ? errno : EIO;
    }
    close(fd);
    if (error == 0 && rename(fresh, path) < 0) {
        error = errno;
    }
    return -error;
}

/* ---- counters ---- */

static struct messages_counter *counter(struct kept_counters *counters, unsigned number)
{
    return number < MESSAGE_TYPES    ? &counters->legacy.legacy[number]
           : number == MESSAGE_TYPES ? &counters->extended
                                     : &counters->beacon;
}

int kept_counters_open(const char *run_dir, struct kept_counters *counters)
{
    uint8_t octets[COUNTERS * COUNTER_SIZE];
    char path[PATH_SIZE];
    int fd;

    memset(counters, 0, sizeof(*counters));
    snprintf(path, sizeof(path), "%s/counters", run_dir);
    fd = open(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) {
        return -errno;
    }
    if (read(fd, octets, sizeof(octets)) == sizeof(octets)) {
        for (unsigned i = 0; i < COUNTERS; i++) {
            const uint8_t *in = octets + i * COUNTER_SIZE;
            uint32_t hash =
                in[2] | (uint32_t)in[3] << 8 | (uint32_t)in[4] << 16 | (uint32_t)in[5] << 24;

            *counter(counters, i) =
                (struct messages_counter){.value = in[0], .used = in[1] != 0, .content_hash = hash};
        }
    }
    return fd;
}

int kept_counters_write(int fd, const struct kept_counters *counters)
{
    uint8_t octets[COUNTERS * COUNTER_SIZE], *out = octets;
    struct kept_counters copy = *counters;

    for (unsigned i = 0; i < COUNTERS; i++) {
        const struct messages_counter *in = counter(&copy, i);

        *out++ = in->value;
        *out++ = in->used;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            *out++ = (uint8_t)(in->content_hash >> shift);
        }
    }
    if (lseek(fd, 0, SEEK_SET) < 0 || write(fd, octets, sizeof(octets)) != sizeof(octets)) {
        return errno != 0 ? -errno : -EIO;
    }
    return 0;
}
