#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define PATH_SIZE 512

/* ---- reading ---- */

/* Returns what was read, or -errno. */
static ssize_t read_all(int fd, char *text, size_t size)
{
    size_t filled = 0;
    ssize_t got = 1;

    while (filled < size && got > 0) {
        got = read(fd, text + filled, size - filled);
        if (got < 0 && errno == EINTR) {
            got = 1;
        } else if (got < 0) {
            return -errno;
        } else {
            filled += (size_t)got;
        }
    }
    return (ssize_t)filled;
}

static char *read_opened(int fd, size_t max, size_t *length)
{
    char *text = fd < 0 ? NULL : calloc(1, max + 2);
    ssize_t got;

    if (text == NULL) {
        if (fd >= 0) {
            close(fd);
            errno = ENOMEM;
        }
        return NULL;
    }
    got = read_all(fd, text, max + 1);
    close(fd);
    if (got < 0 || (size_t)got > max) {
        explicit_bzero(text, max + 2);
        free(text);
        errno = got < 0 ? (int)-got : EFBIG;
        return NULL;
    }
    *length = (size_t)got;
    return text;
}

char *whole_file_read(const char *path, size_t max, size_t *length)
{
    return read_opened(open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK), max, length);
}

char *whole_file_read_itself(const char *path, size_t max, size_t *length)
{
    return read_opened(open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW), max, length);
}

/* ---- replacing ---- */

static int write_all(int fd, const char *text, size_t length)
{
    while (length > 0) {
        ssize_t done = write(fd, text, length);

        if (done < 0 && errno != EINTR) {
            return -errno;
        }
        if (done > 0) {
            text += done;
            length -= (size_t)done;
        }
    }
    return 0;
}

/* The folder that a path lies in, and the name of the new file beside it. False: too long. */
static bool beside(const char *path, char directory[PATH_SIZE], char new_path[PATH_SIZE])
{
    const char *slash = strrchr(path, '/');
    int length = slash == NULL ? snprintf(directory, PATH_SIZE, ".")
                 : slash == path
                     ? snprintf(directory, PATH_SIZE, "/")
                     : snprintf(directory, PATH_SIZE, "%.*s", (int)(slash - path), path);

    return length < PATH_SIZE && snprintf(new_path, PATH_SIZE, "%s/.%s.new", directory,
                                          slash == NULL ? path : slash + 1) < PATH_SIZE;
}

/* The new file, complete and on the disk. */
static int write_new(const char *new_path, const char *text, size_t length, mode_t mode)
{
    int fd, result;

    /* A left-over one may have another mode, or be no file. */
    if (unlink(new_path) < 0 && errno != ENOENT) {
        return -errno;
    }
    fd = open(new_path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0) {
        return -errno;
    }
    result = write_all(fd, text, length);
    /* FAT has no modes of its own, and says so. */
    if (result == 0 && fchmod(fd, mode) < 0 && errno != EPERM) {
        result = -errno;
    }
    if (result == 0 && fsync(fd) < 0) {
        result = -errno;
    }
    if (close(fd) < 0 && result == 0) {
        result = -errno;
    }
    return result;
}

/* A name that was given counts only when its folder is on the disk, too. */
static int sync_directory(const char *directory)
{
    int fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    int result = fd < 0 || fsync(fd) < 0 ? -errno : 0;

    if (fd >= 0) {
        close(fd);
    }
    return result;
}

void whole_file_line(const char *path, char *out, size_t size)
{
    size_t length;
    char *text = whole_file_read(path, 4096, &length);

    snprintf(out, size, "%s", text == NULL ? "" : text);
    out[strcspn(out, "\r\n")] = '\0';
    free(text);
}

int whole_file_replace(const char *path, const char *text, size_t length, mode_t mode)
{
    char directory[PATH_SIZE], new_path[PATH_SIZE];
    struct stat old;
    bool as_old;
    int result;

    if (!beside(path, directory, new_path)) {
        return -ENAMETOOLONG;
    }
    as_old = mode == 0 && stat(path, &old) == 0;
    if (mode == 0) {
        mode = as_old ? old.st_mode & 0777 : 0644;
    }
    result = write_new(new_path, text, length, mode);
    if (result == 0 && as_old && chown(new_path, old.st_uid, old.st_gid) < 0 && errno != EPERM) {
        result = -errno;
    }
    if (result == 0 && rename(new_path, path) < 0) {
        result = -errno;
    }
    if (result < 0) {
        unlink(new_path);
        return result;
    }
    return sync_directory(directory);
}

int whole_file_remove(const char *path)
{
    char directory[PATH_SIZE], new_path[PATH_SIZE];

    if (!beside(path, directory, new_path)) {
        return -ENAMETOOLONG;
    }
    if (unlink(path) < 0) {
        return errno == ENOENT ? 0 : -errno;
    }
    return sync_directory(directory);
}

/* A file that only its owner may open: who can open one, if only to read it, can hold its lock. */
int whole_file_lock(const char *directory)
{
    char path[PATH_MAX];
    int fd, error;

    if ((size_t)snprintf(path, sizeof(path), "%s/.lock", directory) >= sizeof(path)) {
        return -ENAMETOOLONG;
    }
    fd = open(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (fd >= 0 && flock(fd, LOCK_EX) < 0) {
        error = errno;
        close(fd);
        return -error;
    }
    return fd < 0 ? -errno : fd;
}
