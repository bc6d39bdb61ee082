#include "update/update_slot.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/fs.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "base/log.h"
#include "update/update_places.h"

#define HEAD_OCTETS 4096 /* squashfs' own, without which U-Boot takes no slot */

static int open_slot(char slot, int access)
{
    char path[64];

    snprintf(path, sizeof(path), SLOTS "%c", slot);
    return open(path, access | O_CLOEXEC);
}

bool update_slot_protect(char slot, bool read_only)
{
    int fd = open_slot(slot, O_RDONLY), flag = read_only;
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
    int fd = open_slot(slot, O_RDONLY);

    if (fd < 0 || ioctl(fd, BLKGETSIZE64, &octets) < 0) {
        octets = 0;
    }
    if (fd >= 0) {
        close(fd);
    }
    return octets;
}

bool update_slot_is_writable(char slot)
{
    int fd = open_slot(slot, O_RDONLY), read_only = 1;
    bool writable = fd >= 0 && ioctl(fd, BLKROGET, &read_only) == 0 && read_only == 0;

    if (fd >= 0) {
        close(fd);
    }
    return writable;
}

void update_slot_spoil(char slot)
{
    static const char nothing[HEAD_OCTETS];
    int fd = open_slot(slot, O_WRONLY);

    if (fd < 0 || pwrite(fd, nothing, sizeof(nothing), 0) != HEAD_OCTETS || fsync(fd) < 0) {
        log_error("what is in slot %c can't be taken away: %s", slot, strerror(errno));
    }
    if (fd >= 0) {
        close(fd);
    }
}
