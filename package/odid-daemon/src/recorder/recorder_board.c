#include "recorder/recorder_board.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/utf8.h"

#define PATH_SIZE 384
/* The Raspberry Pi firmware's flags; shifted: that it has been so. */
#define THROTTLED "/sys/devices/platform/soc/soc:firmware/get_throttled"
#define FLAG_UNDERVOLTAGE 0x1u
#define FLAGS_SLOW 0xEu /* frequency capped, throttled, soft temperature limit */
#define PAST_SHIFT 16
#define HWMON "/sys/class/hwmon"

/* The first line of a small file, without its end. Returns false when it can't be read. */
static bool read_line(const char *path, char *out, size_t size)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    ssize_t length = fd < 0 ? -1 : read(fd, out, size - 1);

    if (fd >= 0) {
        close(fd);
    }
    if (length < 0) {
        return false;
    }
    out[length] = '\0';
    out[strcspn(out, "\r\n")] = '\0';
    return true;
}

/* ---- supply ---- */

/* The kernel's driver asks the firmware every 2 s, and tells what was since then. */
static bool hwmon_alarm(const char *root)
{
    char path[PATH_SIZE], text[32];
    DIR *directory;
    const struct dirent *entry;
    bool alarm = false;

    snprintf(path, sizeof(path), "%s" HWMON, root);
    directory = opendir(path);
    while (directory != NULL && (entry = readdir(directory)) != NULL) {
        snprintf(path, sizeof(path), "%s" HWMON "/%.64s/name", root, entry->d_name);
        if (entry->d_name[0] == '.' || !read_line(path, text, sizeof(text)) ||
            strcmp(text, "rpi_volt") != 0) {
            continue;
        }
        snprintf(path, sizeof(path), "%s" HWMON "/%.64s/in0_lcrit_alarm", root, entry->d_name);
        alarm = alarm || (read_line(path, text, sizeof(text)) && strcmp(text, "1") == 0);
    }
    if (directory != NULL) {
        closedir(directory);
    }
    return alarm;
}

static void read_supply(struct recorder_board_reader *reader, struct recorder_board *board)
{
    char path[PATH_SIZE], text[32];
    unsigned flags = 0, past, fresh;

    snprintf(path, sizeof(path), "%s" THROTTLED, reader->places->root);
    if (read_line(path, text, sizeof(text))) {
        flags = (unsigned)strtoul(text, NULL, 16); /* with 0x or without */
    }
    past = flags >> PAST_SHIFT;
    fresh = past & ~reader->past_flags;
    reader->past_flags = past;
    board->undervoltage = (flags & FLAG_UNDERVOLTAGE) != 0 || hwmon_alarm(reader->places->root);
    board->throttled = (flags & FLAGS_SLOW) != 0;
    board->was_undervoltage = (fresh & FLAG_UNDERVOLTAGE) != 0;
    board->was_throttled = (fresh & FLAGS_SLOW) != 0;
}

/* ---- the appliance's faults ---- */

/* What can't be read is over just now. */
static void add_fault(const char *faults, const char *file, struct recorder_board *board)
{
    char path[PATH_SIZE], text[512], name[RECORDER_NAME_SIZE];

    utf8_clean(name, sizeof(name), file);
    for (unsigned i = 0; i < board->faults; i++) {
        if (strcmp(board->fault[i].name, name) == 0) {
            return;
        }
    }
    snprintf(path, sizeof(path), "%s/%.64s", faults, file);
    if (board->faults == RECORDER_BOARD_FAULTS || !read_line(path, text, sizeof(text))) {
        return;
    }
    memcpy(board->fault[board->faults].name, name, sizeof(name));
    utf8_clean(board->fault[board->faults].text, RECORDER_TEXT_SIZE, text);
    board->faults++;
}

static int is_fault(const struct dirent *entry)
{
    return entry->d_name[0] != '.'; /* one that is being written, too */
}

static void read_faults(const char *faults, const struct recorder_fault *known,
                        struct recorder_board *board)
{
    struct dirent **entries = NULL;
    int count = scandir(faults, &entries, is_fault, alphasort);

    for (int i = RECORDER_KINDS; i < RECORDER_FAULTS; i++) {
        if (known[i].there) {
            add_fault(faults, known[i].name, board);
        }
    }
    for (int i = 0; i < count; i++) {
        add_fault(faults, entries[i]->d_name, board);
        free(entries[i]);
    }
    free(entries);
}

void recorder_board_read(struct recorder_board_reader *reader, const struct recorder *recorder,
                         struct recorder_board *board)
{
    memset(board, 0, sizeof(*board));
    read_supply(reader, board);
    read_faults(reader->places->faults, recorder->faults, board);
}
