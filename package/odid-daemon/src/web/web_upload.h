/*
 * A bundle on its way from the browser into SWUpdate, as it comes: no copy of
 * it is kept. One at a time, which is as many as SWUpdate takes.
 *
 * Whether it may be installed is decided by SWUpdate and the appliance's own
 * checks in front of it, never here.
 */
#ifndef ODID_WEB_UPLOAD_H
#define ODID_WEB_UPLOAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

/* A bundle is 16 MB at most; what is far larger is some other file. */
#define WEB_UPLOAD_MAX ((uint64_t)64 * 1024 * 1024)

/*
 * directory: where SWUpdate's control socket is. Returns a descriptor that
 * takes the bundle without blocking, or -1 with the sentence for the
 * technician: no updater runs, or it is busy.
 */
int web_upload_open(const char *directory, char *sentence, size_t size);

/*
 * Gives as much as is taken now. Returns how much that is; -1 when SWUpdate
 * has closed its end: it has refused the bundle, or failed.
 */
ssize_t web_upload_give(int fd, const char *data, size_t length);

/* The end of the bundle, or of our patience. */
void web_upload_close(int fd);

#endif
