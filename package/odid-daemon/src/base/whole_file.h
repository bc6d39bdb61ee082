/* Small files, read and replaced as a whole. */
#ifndef ODID_WHOLE_FILE_H
#define ODID_WHOLE_FILE_H

#include <stddef.h>
#include <sys/types.h>

/*
 * Reads a file of at most max bytes. Returns it allocated with a NUL byte
 * behind it, *length set; NULL with errno set, EFBIG when it is larger.
 */
char *whole_file_read(const char *path, size_t max, size_t *length);

/* The same of a file in a folder of somebody else's: ELOOP when it is a link to another one. */
char *whole_file_read_itself(const char *path, size_t max, size_t *length);

/* The first line of a file of at most 4 KiB, cut to size; "" when there is none. */
void whole_file_line(const char *path, char *out, size_t size);

/*
 * Replaces a file, or makes it. At any instant, power cuts included, there is
 * the old one or the new one; .NAME.new beside it may be left over and is used
 * again. mode 0: mode, user and group as the old one has them. Returns 0 or -errno: then the old
 * one stays (or, when only the folder didn't reach the disk, it may come back).
 */
int whole_file_replace(const char *path, const char *text, size_t length, mode_t mode);

/* Removes a file, so that it doesn't come back with the power. Returns 0, also when there was none,
 * or -errno: then it may be there still, or again. */
int whole_file_remove(const char *path);

/* Keeps others with whole_file_lock on this folder out, until the descriptor is closed. Returns
 * it, or -errno. */
int whole_file_lock(const char *directory);

#endif
