#include "daemon/kept_counters.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "config/config.h"

#define PATH_SIZE (CONFIG_PATH_SIZE + 16)
/* In the file: value, used, content_hash (little endian). */
#define COUNTER_SIZE 6
#define COUNTERS (MESSAGE_TYPES + 2)

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
    snprintf(path, sizeof(path), "%s/" KEPT_COUNTERS_FILE, run_dir);
    /* A file that somebody holds a lease on would be waited for, and the broadcast with it. */
    fd = open(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0644);
    if (fd < 0 && errno == EWOULDBLOCK && unlink(path) == 0) {
        fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    }
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
