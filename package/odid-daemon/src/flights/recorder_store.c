#include "flights/recorder_store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "flights/recorder_read.h"

#define NAME_SIZE 24
#define FRESH_NAME ".new"

/* ---- names and numbers ---- */

unsigned recorder_store_number(const char *name)
{
    size_t digits = strspn(name, "0123456789");

    if (digits < 5 || digits > 9 || strcmp(name + digits, ".jsonl") != 0) {
        return 0;
    }
    return (unsigned)strtoul(name, NULL, 10);
}

static void make_name(char name[NAME_SIZE], unsigned number)
{
    snprintf(name, NAME_SIZE, "%05u.jsonl", number);
}

struct census {
    unsigned files, oldest, newest;
};

/* Returns 0, or -errno. */
static int count_files(int directory, struct census *census)
{
    int fd = openat(directory, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *listing = fd < 0 ? NULL : fdopendir(fd);
    int error = errno;
    const struct dirent *entry;

    memset(census, 0, sizeof(*census));
    if (listing == NULL) {
        if (fd >= 0) {
            close(fd);
        }
        return -error;
    }
    while (errno = 0, (entry = readdir(listing)) != NULL) {
        unsigned number = recorder_store_number(entry->d_name);

        if (number == 0) {
            continue;
        }
        if (number > census->newest) {
            census->newest = number;
        }
        if (entry->d_type == DT_DIR) {
            continue; /* whoever made it: it is no record of ours, and can't be removed like one */
        }
        census->files++;
        if (census->oldest == 0 || number < census->oldest) {
            census->oldest = number;
        }
    }
    error = errno;
    closedir(listing);
    return -error;
}

/* Made when it is missing; what it is in has to be there. Returns a descriptor, or -errno. */
static int open_directory(const char *path)
{
    int fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);

    if (fd < 0 && errno == ENOENT && mkdir(path, 0755) == 0) {
        fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    }
    return fd < 0 ? -errno : fd;
}

/* Makes room for one more, and gives it the next number. Returns 0, or -errno. */
static int take_number(struct recorder_store *store, int directory)
{
    struct census census;
    char name[NAME_SIZE];
    int result = count_files(directory, &census);

    while (result == 0 && census.files >= RECORDER_FILES_MAX) {
        make_name(name, census.oldest);
        result = unlinkat(directory, name, 0) < 0 ? -errno : count_files(directory, &census);
    }
    if (result == 0) {
        store->number = census.newest + 1;
    }
    return result;
}

/* ---- writing ---- */

static int write_all(int fd, const char *bytes, size_t length, off_t offset)
{
    while (length > 0) {
        ssize_t written = pwrite(fd, bytes, length, offset);

        if (written < 0 && errno != EINTR) {
            return -errno;
        }
        if (written == 0) {
            return -ENOSPC; /* no file system of Linux does this */
        }
        if (written > 0) {
            bytes += written;
            offset += written;
            length -= (size_t)written;
        }
    }
    return fdatasync(fd) < 0 ? -errno : 0;
}

/* A new file takes the old one's place at once, whole. */
static int write_anew(struct recorder_store *store, int directory, const char *name)
{
    int fd = openat(directory, FRESH_NAME, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    struct stat is;
    int result;

    if (fd < 0) {
        return -errno;
    }
    result = write_all(fd, store->text.bytes, store->text.length, 0);
    if (result == 0 &&
        (fstat(fd, &is) < 0 || renameat(directory, FRESH_NAME, directory, name) < 0 ||
         fsync(directory) < 0)) {
        result = -errno;
    }
    close(fd);
    if (result < 0) {
        unlinkat(directory, FRESH_NAME, 0); /* else a full disk stays a bit fuller */
        return result;
    }
    store->device = is.st_dev;
    store->inode = is.st_ino;
    return 0;
}

/* Behind what is there. After one that failed halfway the file is made anew. */
static int append(struct recorder_store *store, int directory, const char *name)
{
    int fd = openat(directory, name, O_WRONLY | O_CLOEXEC);
    size_t stored = store->text.stored;
    int result;

    if (fd < 0) {
        return -errno;
    }
    result = write_all(fd, store->text.bytes + stored, store->text.length - stored, (off_t)stored);
    close(fd);
    store->text.changed = result < 0;
    return result;
}

/* Is the file there as we left it? Another disk may have been mounted meanwhile. */
static bool is_ours(const struct recorder_store *store, int directory, const char *name)
{
    struct stat is;

    return fstatat(directory, name, &is, AT_SYMLINK_NOFOLLOW) == 0 && is.st_dev == store->device &&
           is.st_ino == store->inode && is.st_size >= (off_t)store->text.stored;
}

static int write_to(struct recorder_store *store, int directory)
{
    char name[NAME_SIZE];
    bool anew = store->text.changed;
    int result = 0;

    make_name(name, store->number);
    if (store->number == 0 || !is_ours(store, directory, name)) {
        result = take_number(store, directory);
        make_name(name, store->number);
        anew = true;
    }
    if (result == 0) {
        result = anew ? write_anew(store, directory, name) : append(store, directory, name);
    }
    if (result == 0) {
        store->text.changed = false;
        store->text.stored = store->text.length;
    }
    return result;
}

static void log_whether_written(struct recorder_store *store, int error)
{
    if (error != 0 && store->error == 0) {
        log_warning("the flight record can't be written to %s: %s; it is kept in memory and tried "
                    "again every 10 s",
                    store->directory, strerror(error));
    } else if (error == 0 && store->error != 0) {
        log_info("the flight record is written to %s again, number %u", store->directory,
                 store->number);
    }
    store->error = error;
}

bool recorder_store_due(const struct recorder_store *store, int64_t now_us)
{
    return now_us >= store->allowed_us;
}

int recorder_store_write(struct recorder_store *store, int64_t now_us)
{
    int directory, result;

    store->allowed_us = now_us + RECORDER_WRITE_EVERY_US;
    directory = result = open_directory(store->directory);
    if (directory >= 0) {
        result = write_to(store, directory);
        close(directory);
    }
    log_whether_written(store, -result);
    return result;
}

/* ---- reading ---- */

static ssize_t read_at(int directory, unsigned number, char *out, size_t size, struct stat *is)
{
    char name[NAME_SIZE];
    size_t filled = 0;
    ssize_t got = 1;
    int fd, error = 0;

    make_name(name, number);
    fd = openat(directory, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0 || fstat(fd, is) < 0) {
        error = errno;
    }
    while (error == 0 && got > 0 && filled < size) {
        got = read(fd, out + filled, size - filled);
        if (got < 0) {
            error = errno;
        } else {
            filled += (size_t)got;
        }
    }
    if (fd >= 0) {
        close(fd);
    }
    return error != 0 ? -error : (ssize_t)filled;
}

ssize_t recorder_store_read(const char *directory, unsigned number, char *out, size_t size)
{
    int fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    struct stat is;
    ssize_t result = -errno;

    if (fd >= 0) {
        result = read_at(fd, number, out, size, &is);
        close(fd);
    }
    return result;
}

/* Loads the newest record when it is of this power-on. */
static bool load(struct recorder_store *store, int directory, const char *boot)
{
    static char bytes[RECORDER_TEXT_MAX];
    static struct recorder_flight flight;
    struct census census;
    struct stat is;
    ssize_t length;

    if (count_files(directory, &census) < 0 || census.newest == 0) {
        return false;
    }
    length = read_at(directory, census.newest, bytes, sizeof(bytes), &is);
    if (length <= 0) {
        return false;
    }
    recorder_read(&flight, bytes, (size_t)length, NULL, NULL);
    if (!flight.started || boot[0] == '\0' || strcmp(flight.boot, boot) != 0) {
        return false;
    }
    recorder_text_load(&store->text, bytes, (size_t)length);
    store->number = census.newest;
    store->device = is.st_dev;
    store->inode = is.st_ino;
    return true;
}

bool recorder_store_open(struct recorder_store *store, const char *directory, const char *boot)
{
    int fd;
    bool found;

    memset(store, 0, sizeof(*store));
    store->directory = directory;
    store->allowed_us = INT64_MIN;
    fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) {
        return false; /* the first write says why */
    }
    found = load(store, fd, boot);
    close(fd);
    return found;
}
