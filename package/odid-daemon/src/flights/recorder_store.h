/*
 * The flight records' files: <directory>/<number>.jsonl, one a power-on. At
 * most one small write each 10 s, given to the disk for good; the oldest files
 * are removed. A directory that is gone, full or read-only is tried again:
 * until then the record is in memory.
 */
#ifndef ODID_RECORDER_STORE_H
#define ODID_RECORDER_STORE_H

#include <stdint.h>
#include <sys/types.h>

#include "flights/recorder_text.h"

#define RECORDER_FILES_MAX 200
#define RECORDER_WRITE_EVERY_US 10000000

struct recorder_store {
    const char *directory;
    struct recorder_text text;
    unsigned number; /* the file's; 0: it has none yet */
    dev_t device;    /* so that another disk's file of the same number isn't taken for it */
    ino_t inode;
    int64_t allowed_us; /* no write before this */
    int error;          /* of the last try, as errno; 0 when all is well */
};

/*
 * directory must outlive the store. Returns true when the newest record is of
 * this power-on (boot: the kernel's boot id): it is loaded, and goes on.
 */
bool recorder_store_open(struct recorder_store *store, const char *directory, const char *boot);

/* Is a write allowed at this time? */
bool recorder_store_due(const struct recorder_store *store, int64_t now_us);

/* Writes what isn't stored yet. Returns 0, or -errno, which is logged once. */
int recorder_store_write(struct recorder_store *store, int64_t now_us);

/* The number in a record's file name; 0 when it is none. */
unsigned recorder_store_number(const char *name);

/* Reads a whole record; returns its length (at most size), or -errno. */
ssize_t recorder_store_read(const char *directory, unsigned number, char *out, size_t size);

#endif
