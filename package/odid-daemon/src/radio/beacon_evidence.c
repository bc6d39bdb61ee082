#include "radio/beacon_evidence.h"

#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LINE_SIZE 64
#define SECOND_US 1000000
/* Older than that, it is nobody's word: who asks a chip that hangs is held up by it. */
#define OLD_US 2000000

void beacon_evidence_init(struct beacon_evidence *evidence, const char *run_dir, const char *net,
                          const char *iface)
{
    *evidence = (struct beacon_evidence){.reported_us = INT64_MIN,
                                         .moved_us = INT64_MIN,
                                         .sent_us = INT64_MIN,
                                         .carrier_us = INT64_MIN,
                                         .heard_us = INT64_MIN};
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

static int64_t ms(int64_t milliseconds)
{
    return milliseconds * 1000;
}

/* One that begins anew, with its firmware, has moved by what it says. */
static void take_count(struct beacon_evidence *evidence, uint32_t count, int64_t at_us)
{
    uint32_t more = count >= evidence->count ? count - evidence->count : count;

    if (!evidence->counts) {
        evidence->moved_us = at_us; /* of the time before nothing is known */
    } else if (count != evidence->count) {
        evidence->moved_us = at_us;
        if ((int64_t)more * SECOND_US >= (at_us - evidence->reported_us) * BEACON_COUNTED_PER_S) {
            evidence->sent_us = at_us;
        }
    }
    evidence->counts = true;
    evidence->count = count;
}

static void look_at_report(struct beacon_evidence *evidence, int64_t now_us)
{
    char line[LINE_SIZE], word[16], heard[16], seen[8];
    int64_t at_us, heard_ms;
    uint32_t count;

    read_line(evidence->count_path, line);
    if (sscanf(line, "%12" SCNd64 " %15s %15s %7s", &at_us, word, heard, seen) != 4) {
        return;
    }
    at_us = ms(at_us);
    if (at_us > now_us || at_us <= evidence->reported_us) {
        return;
    }
    if (sscanf(heard, "%12" SCNd64, &heard_ms) == 1 && ms(heard_ms) <= at_us) {
        evidence->heard_us = ms(heard_ms);
    }
    if (sscanf(word, "%10" SCNu32, &count) != 1) {
        evidence->counts = false;
    } else {
        take_count(evidence, count, at_us);
    }
    evidence->seen = evidence->seen || strcmp(seen, BEACON_COUNT_SEEN) == 0;
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
    look_at_report(evidence, now_us);
    if (!evidence->carrier && evidence->carrier_us != INT64_MIN &&
        is_long(evidence->carrier_us, since_us, now_us)) {
        return BEACONS_NO_CARRIER;
    }
    if (!evidence->counts || !evidence->seen || now_us - evidence->reported_us > OLD_US) {
        return BEACONS_UNKNOWN;
    }
    if (evidence->sent_us != INT64_MIN && now_us - evidence->sent_us <= BEACON_SILENCE_US) {
        return BEACONS_SENT;
    }
    return is_long(evidence->moved_us, since_us, evidence->reported_us) ? BEACONS_NOT_SENT
                                                                        : BEACONS_UNKNOWN;
}

bool beacon_evidence_heard(const struct beacon_evidence *evidence, int64_t now_us)
{
    return evidence->heard_us != INT64_MIN && now_us - evidence->heard_us <= BEACON_HEARD_US;
}

/* A count is old when it comes, and may be late as well: without one for so long nothing is to be
 * expected of it. */
int64_t beacon_evidence_patience_us(const struct beacon_evidence *evidence)
{
    return BEACON_SILENCE_US + 2 * BEACON_COUNT_EVERY_US +
           (evidence->counts && evidence->seen ? OLD_US : 0);
}

bool beacon_evidence_is_down(struct beacon_evidence *evidence, int64_t now_us)
{
    look_at_carrier(evidence, now_us);
    return !evidence->carrier && evidence->carrier_us != INT64_MIN;
}
