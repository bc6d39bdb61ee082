#include "clock/clock_file.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "clock/clock_set.h"

#define SECOND_US 1000000

int clock_file_save(const char *path, int64_t now_us)
{
    const struct timespec now = {.tv_sec = now_us / SECOND_US,
                                 .tv_nsec = now_us % SECOND_US * 1000};
    const struct timespec times[2] = {now, now};
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    int result;

    if (fd < 0) {
        return -errno;
    }
    result = futimens(fd, times) < 0 || fsync(fd) < 0 ? -errno : 0;
    close(fd);
    return result;
}

int clock_file_read(const char *path, int64_t *saved_us)
{
    struct stat status;
    int64_t modified_us;

    *saved_us = CLOCK_UNKNOWN;
    if (stat(path, &status) < 0) {
        return -errno;
    }
    modified_us = (int64_t)status.st_mtim.tv_sec * SECOND_US + status.st_mtim.tv_nsec / 1000;
    if (!clock_is_plausible(modified_us)) {
        return -ERANGE;
    }
    *saved_us = modified_us;
    return 0;
}
