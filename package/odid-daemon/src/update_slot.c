#include "update_slot.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/fs.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "log.h"
#include "update_places.h"

static int open_slot(char slot)
{
    char path[64];

    snprintf(path, sizeof(path), SLOTS "%c", slot);
    return open(path, O_RDONLY | O_CLOEXEC);
}

bool update_slot_protect(char slot, bool read_only)
{
    int fd = open_slot(slot), flag = read_only;
    bool done = fd >= 0 && ioctl(fd, BLKROSET, &flag) == 0;

    if (!done) {
        log_error("slot %c can't be made %s: %s", slot, read_only ? "read-only" : "writable",
                  strerror(errno));
    }
    if (fd >= 0) {
        close(fd);
    }
    return done;
}

uint64_t update_slot_octets(char slot)
{
    uint64_t octets = 0;
    int fd = open_slot(slot);

    if (fd < 0 || ioctl(fd, BLKGETSIZE64, &octets) < 0) {
        octets = 0;
    }
    if (fd >= 0) {
        close(fd);
    }
    return octets;
}
