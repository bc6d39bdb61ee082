#include "keeper/keeper_fault.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int write_line(int directory, const char *name, const char *sentence)
{
    int fd, result;

    (void)unlinkat(directory, name, 0); /* on a Debian the daemon may have made something there */
    fd = openat(directory, name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) {
        return -errno;
    }
    result = dprintf(fd, "%s\n", sentence) < 0 ? -errno : 0;
    close(fd);
    return result;
}

static int replace_fault(int directory, const char *sentence)
{
    int result = write_line(directory, "." KEEPER_FAULT_NAME, sentence);

    if (result == 0 &&
        renameat(directory, "." KEEPER_FAULT_NAME, directory, KEEPER_FAULT_NAME) < 0) {
        result = -errno;
    }
    return result;
}

static int take_away(int directory)
{
    return unlinkat(directory, KEEPER_FAULT_NAME, 0) < 0 && errno != ENOENT ? -errno : 0;
}

/* sentence NULL: there is none any more. */
static int change(const char *path, const char *sentence)
{
    int directory = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC), result;

    if (directory < 0) {
        return errno == ENOENT ? 0 : -errno;
    }
    result = sentence != NULL ? replace_fault(directory, sentence) : take_away(directory);
    close(directory);
    return result;
}

int keeper_fault_say(const char *directory, const char *sentence)
{
    (void)mkdir(directory, 0755); /* run by hand; what else is wrong is said below */
    return change(directory, sentence);
}

int keeper_fault_over(const char *directory)
{
    return change(directory, NULL);
}
