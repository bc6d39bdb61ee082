#include "base/inherited.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

int inherited_give(const char *variable, int fd)
{
    char number[16];

    snprintf(number, sizeof(number), "%d", fd);
    return fcntl(fd, F_SETFD, 0) < 0 || setenv(variable, number, 1) < 0 ? -errno : 0;
}

static int parse_number(const char *text)
{
    char *end;
    long value;

    errno = 0;
    value = strtol(text, &end, 10);
    return text[0] < '0' || text[0] > '9' || *end != '\0' || errno != 0 || value > INT_MAX
               ? -EINVAL
               : (int)value;
}

int inherited_take(const char *variable)
{
    const char *text = getenv(variable);
    int fd;

    if (text == NULL) {
        return -ENOENT;
    }
    fd = parse_number(text);
    if (fd >= 0 && fcntl(fd, F_SETFD, FD_CLOEXEC) < 0) {
        fd = -errno;
    }
    if (fd < 0) {
        log_warning("%s is \"%s\", and not the number of an open descriptor (%s)", variable, text,
                    strerror(-fd));
    }
    unsetenv(variable);
    return fd;
}
