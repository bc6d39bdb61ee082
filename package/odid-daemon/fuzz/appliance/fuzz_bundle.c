/*
 * Any octets as a description and as a bundle -> a description or none, and
 * then one whose values can stand in a sentence and in a file's name.
 */
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "appliance/update_bundle.h"

#include "on_air.h"

static void check(const char *text, size_t size)
{
    static const char plain[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.+~_-";
    size_t length = strnlen(text, size);

    MUST(length > 0 && length < size);
    MUST(strspn(text, plain) == length);
}

static void try_text(const char *text, size_t size)
{
    struct update_bundle bundle;

    if (update_bundle_parse(text, size, &bundle) == 0) {
        check(bundle.version, sizeof(bundle.version));
        check(bundle.hardware, sizeof(bundle.hardware));
        MUST(update_version_compare(bundle.version, bundle.version) == 0);
    }
}

static void try_bundle(const uint8_t *data, size_t size)
{
    struct update_bundle bundle;
    int fd = memfd_create("bundle", MFD_CLOEXEC);

    MUST(fd >= 0 && write(fd, data, size) == (ssize_t)size && lseek(fd, 0, SEEK_SET) == 0);
    if (update_bundle_read(fd, &bundle) == 0) {
        /* No more of it than its head was looked at. */
        MUST(lseek(fd, 0, SEEK_CUR) <= 128 + UPDATE_DESCRIPTION_MAX);
        check(bundle.version, sizeof(bundle.version));
    }
    close(fd);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    try_text((const char *)data, size);
    try_bundle(data, size);
    return 0;
}
