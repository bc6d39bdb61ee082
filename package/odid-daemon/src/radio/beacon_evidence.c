#include "radio/beacon_evidence.h"

#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LINE_SIZE 64
/* Older than that, it is nobody's word: who asks a chip that hangs is held up by it. */
#define OLD_US 2000000

void beacon_evidence_init(struct beacon_evidence *evidence, const char *run_dir, const char *net,
                          const char *iface)
{
    *evidence = (struct beacon_evidence){
        .reported_us = INT64_MIN, .moved_us = INT64_MIN, .carrier_us = INT64_MIN};
    snprintf(evidence->count_path, sizeof(evidence->count_path), "%s" BEACON_COUNT_FILE, run_dir);
    snprintf(evidence->state_path, sizeof(evidence->state_path), "%s/%s/operstate", net, iface);
}

/* The start of a file, "" where there is none: without waiting for whoever made it. */
static void read_line(const char *path, char line[LINE_SIZE])
{
    int fd = open(path, O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC);
    ssize_t length = -1;
    struct stat what;

    if (fd >= 0) {
        if (fstat(fd, &what) == 0 && S_ISREG(what.st_mode)) {
            length = read(fd, line, LINE_SIZE - 1);
        }
        close(fd);
    }
    line[length < 0 ? 0 : length] = '\0';
}

static void look_at_carrier(struct beacon_evidence *evidence, int64_t now_us)
{
    char line[LINE_SIZE];

    read_line(evidence->state_path, line);
    evidence->carrier = strcmp(line, "up\n") == 0;
    if (evidence->carrier) {
        evidence->carrier_us = now_us;
    }
}

static void look_at_count(struct beacon_evidence *evidence, int64_t now_us)
{
    char line[LINE_SIZE], word[16];
    int64_t at_us;
    uint32_t count;

    read_line(evidence->count_path, line);
    if (sscanf(line, "%12" SCNd64 " %15s", &at_us, word) != 2 || at_us * 1000 > now_us ||
        at_us * 1000 <= evidence->reported_us) {
        return;
    }
    at_us *= 1000;
    if (sscanf(word, "%10" SCNu32, &count) != 1) {
        evidence->counts = false;
    } else {
        if (evidence->counts && count != evidence->count) {
            evidence->moves = true;
            evidence->moved_us = at_us;
        }
        evidence->counts = true;
        evidence->count = count;
    }
    evidence->reported_us = at_us;
}

/* Silence, up to then. */
static bool is_long(int64_t last_us, int64_t since_us, int64_t until_us)
{
    return until_us - (last_us > since_us ? last_us : since_us) > BEACON_SILENCE_US;
}

enum beacon_verdict beacon_evidence_look(struct beacon_evidence *evidence, int64_t since_us,
                                         int64_t now_us)
{
    look_at_carrier(evidence, now_us);
    look_at_count(evidence, now_us);
    if (!evidence->carrier && evidence->carrier_us != INT64_MIN &&
        is_long(evidence->carrier_us, since_us, now_us)) {
        return BEACONS_NO_CARRIER;
    }
    if (!evidence->counts || !evidence->moves || now_us - evidence->reported_us > OLD_US) {
        return BEACONS_UNKNOWN;
    }
    if (now_us - evidence->moved_us <= BEACON_SILENCE_US) {
        return BEACONS_SENT;
    }
    return is_long(evidence->moved_us, since_us, evidence->reported_us) ? BEACONS_NOT_SENT
                                                                        : BEACONS_UNKNOWN;
}
