/*
 * What a bundle says of itself: the only reader of descriptions (their form:
 * board/common/sw-description.in), for the gate, a stick and whoever else asks.
 * Bounded in time and memory whatever the bundle is. Of a bundle, unlike of the
 * description that SWUpdate has verified, all of it is only what it says.
 */
#ifndef ODID_UPDATE_BUNDLE_H
#define ODID_UPDATE_BUNDLE_H

#include <limits.h>
#include <stddef.h>
#include <stdint.h>

#include "appliance/update_names.h"

#define UPDATE_DESCRIPTION_MAX 16384 /* octets */
#define UPDATE_HARDWARE_SIZE 32

struct update_bundle {
    char version[UPDATE_VERSION_SIZE];   /* letters, digits and . + ~ _ - */
    char hardware[UPDATE_HARDWARE_SIZE]; /* likewise: "odid-cm4" */
    uint64_t slot_octets;
};

/*
 * text: length octets, not ended by NUL. Each of the three has to be there once, on a line of its
 * own. Returns 0, or -EBADMSG.
 */
int update_bundle_parse(const char *text, size_t length, struct update_bundle *bundle);

/* The description itself. Returns 0, -EBADMSG, or another -errno of reading it. */
int update_bundle_read_description(const char *path, struct update_bundle *bundle);

/* The description at the head of a bundle, a cpio archive ("newc", with or without checksums).
 * Returns 0, -EBADMSG, or another -errno of reading it. */
int update_bundle_read(int fd, struct update_bundle *bundle);

/*
 * Which of a folder's *.swu is the newest for that hardware. Of the folder's first 1000 names, the
 * first 16 bundles; no links. name: its name in the folder. Returns 0; -ENOENT: there is none;
 * another -errno: the folder can't be read.
 */
int update_bundle_newest(const char *folder, const char *hardware, char name[NAME_MAX + 1],
                         struct update_bundle *bundle);

/* < 0: left is the older one. 1.10 is newer than 1.9. */
int update_version_compare(const char *left, const char *right);

#endif
