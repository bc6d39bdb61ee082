/*
 * Whether beacons go out, by what isn't hostapd's word: the interface's operating state, which the
 * kernel knows, and the chip's own count of the beacons that it has sent, which odid-beacons asks
 * for and writes down. Either one tells of silence only where it was seen to tell of beacons
 * before: there are drivers that say nothing, or always the same. Of the count odid-beacons says
 * whether it was: a daemon that begins beside a silent chip hasn't seen it. And whether another
 * radio hears them, which odid-beacons writes down as well; that it doesn't proves nothing.
 */
#ifndef ODID_BEACON_EVIDENCE_H
#define ODID_BEACON_EVIDENCE_H

#include <stdbool.h>
#include <stdint.h>

/* What odid-beacons writes, beside the daemon's run_dir and twice a second: "MILLISECONDS COUNT
 * HEARD SEEN", CLOCK_MONOTONIC's time when it asked, and when another radio heard one last; a "-"
 * where nobody says; BEACON_COUNT_SEEN where the count was seen to be one of beacons. */
#define BEACON_COUNT_SEEN "seen"
#define BEACON_COUNT_FILE "-beacons/count"
#define BEACON_COUNT_EVERY_US 500000

/* What was heard longer ago than two times of listening isn't any more. */
#define BEACON_HEARD_US 10000000
/* There are ten a second. With as many of them it is known that beacons go out; that none do, only
 * where there is none: what others send may keep some of ours from the air. */
#define BEACON_COUNTED_PER_S 5
/* Fifteen beacons, and no count. */
#define BEACON_SILENCE_US 1500000

enum beacon_verdict { BEACONS_UNKNOWN, BEACONS_SENT, BEACONS_NOT_SENT, BEACONS_NO_CARRIER };

struct beacon_evidence {
    char count_path[160], state_path[160]; /* the second one: the interface's operstate */
    int64_t reported_us; /* CLOCK_MONOTONIC: when the count was asked for; INT64_MIN: never */
    bool counts, seen;   /* the chip says how many; and was seen to count beacons */
    uint32_t count;
    int64_t moved_us, sent_us; /* when it last did at all, and by enough; INT64_MIN: never */
    int64_t carrier_us;        /* when the interface was last up; INT64_MIN: never */
    int64_t heard_us;          /* by another radio; INT64_MIN: never */
    bool carrier;              /* now */
};

/* net: /sys/class/net, but for tests. What is nowhere tells nothing. */
void beacon_evidence_init(struct beacon_evidence *evidence, const char *run_dir, const char *net,
                          const char *iface);
/* since_us: beacons were to be expected from then on. */
enum beacon_verdict beacon_evidence_look(struct beacon_evidence *evidence, int64_t since_us,
                                         int64_t now_us);
/* For how long after a remedy nothing is known to tell that it helped. */
int64_t beacon_evidence_patience_us(const struct beacon_evidence *evidence);
/* Has the kernel the interface down, that was up before? As of now. */
bool beacon_evidence_is_down(struct beacon_evidence *evidence, int64_t now_us);
/* Does another radio hear them? As of the last look. */
bool beacon_evidence_heard(const struct beacon_evidence *evidence, int64_t now_us);

#endif
