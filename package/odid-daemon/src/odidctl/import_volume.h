/* What a technician put on the volume CONFIG, by the names that computers make of it. */
#ifndef ODID_IMPORT_VOLUME_H
#define ODID_IMPORT_VOLUME_H

#define IMPORT_NAME_SIZE 256

/* Names as they stand on the volume; empty: there is none. */
struct import_volume {
    char conf[IMPORT_NAME_SIZE],
        conf_txt[IMPORT_NAME_SIZE]; /* Windows hides endings, and adds its own */
    char cut[IMPORT_NAME_SIZE], cut_txt[IMPORT_NAME_SIZE]; /* put aside at the boot (S40config) */
    char keys[IMPORT_NAME_SIZE], keys_txt[IMPORT_NAME_SIZE];
    char apple[IMPORT_NAME_SIZE];   /* what macOS puts beside a file */
    char similar[IMPORT_NAME_SIZE]; /* what may have been meant */
};

/* Fills in a volume that is all empty. Returns 0, or -errno. */
int import_volume_look(const char *directory, struct import_volume *volume);

#endif
