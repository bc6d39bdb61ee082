/* The time kept over a power-off: the modification time of a file that is otherwise empty. */
#ifndef ODID_CLOCK_FILE_H
#define ODID_CLOCK_FILE_H

#include <stdint.h>

/* Gives the file now_us (Unix), and waits until the disk has it. Returns 0, or -errno. */
int clock_file_save(const char *path, int64_t now_us);

/* Returns 0, or -errno (-ERANGE: clock_is_plausible): then, *saved_us is CLOCK_UNKNOWN. */
int clock_file_read(const char *path, int64_t *saved_us);

#endif
