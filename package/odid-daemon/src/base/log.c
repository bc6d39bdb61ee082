#include "base/log.h"

#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#define LINE_MAX_BYTES 512

static bool debug;

void log_set_debug(bool on)
{
    debug = on;
}

/* It never says that it could be written, and never blocks who writes. */
static bool is_kernel_log(void)
{
    struct stat file;

    return fstat(STDERR_FILENO, &file) == 0 && S_ISCHR(file.st_mode) &&
           file.st_rdev == makedev(1, 11);
}

/*
 * A logger that hangs would stop us at its full pipe or socket, a stopped
 * terminal likewise, and the broadcast with us: then lines are dropped. A pipe
 * may be half full, because it counts pages, and short lines may leave each of
 * them partly empty.
 */
static bool has_room(void)
{
    struct pollfd ready = {.fd = STDERR_FILENO, .events = POLLOUT};
    int size = fcntl(STDERR_FILENO, F_GETPIPE_SZ); /* fails on what is no pipe */
    int unread;

    if (size < 0) {
        return poll(&ready, 1, 0) == 1 || is_kernel_log();
    }
    return ioctl(STDERR_FILENO, FIONREAD, &unread) < 0 || unread < size / 2;
}

__attribute__((format(printf, 2, 0))) static void line(const char *level, const char *format,
                                                       va_list arguments)
{
    char text[LINE_MAX_BYTES];
    size_t length = (size_t)snprintf(text, sizeof(text), "%s: ", level);

    vsnprintf(text + length, sizeof(text) - length - 1, format, arguments);
    length = strlen(text);
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)text[i] < ' ' || text[i] == 0x7F) {
            text[i] = '?'; /* names and replies come from outside */
        }
    }
    text[length++] = '\n';
    if (!has_room() || write(STDERR_FILENO, text, length) < 0) {
        return; /* there is nowhere else to say it */
    }
}

#define LEVEL(name, level)                                                                         \
    void name(const char *format, ...)                                                             \
    {                                                                                              \
        va_list arguments;                                                                         \
                                                                                                   \
        va_start(arguments, format);                                                               \
        line(level, format, arguments);                                                            \
        va_end(arguments);                                                                         \
    }

LEVEL(log_error, "error")
LEVEL(log_warning, "warning")
LEVEL(log_info, "info")

void log_debug(const char *format, ...)
{
    va_list arguments;

    if (!debug) {
        return;
    }
    va_start(arguments, format);
    line("debug", format, arguments);
    va_end(arguments);
}
