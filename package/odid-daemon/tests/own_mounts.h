/* A small disk that this process alone has, and the way to fill it. Needs the right to mount. */
#ifndef ODID_TEST_OWN_MOUNTS_H
#define ODID_TEST_OWN_MOUNTS_H

#include <fcntl.h>
#include <sched.h>
#include <stdbool.h>
#include <string.h>
#include <sys/mount.h>
#include <unistd.h>

/* What is mounted from here on nobody else sees. False, and errno, where that isn't allowed. */
static inline bool own_mounts(void)
{
    return unshare(CLONE_NEWNS) == 0 && mount("none", "/", NULL, MS_REC | MS_PRIVATE, NULL) == 0;
}

/* size: as of tmpfs, "64k". */
static inline bool mount_small_disk(const char *where, const char *size)
{
    char options[32] = "size=";

    return mount("none", where, "tmpfs", 0, strncat(options, size, sizeof(options) - 6)) == 0;
}

/* A new file takes all that is left of its disk. */
static inline void fill_to_the_last_byte(const char *path)
{
    static const char zeros[4096];
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);

    while (write(fd, zeros, sizeof(zeros)) > 0) {
    }
    close(fd);
}

#endif
