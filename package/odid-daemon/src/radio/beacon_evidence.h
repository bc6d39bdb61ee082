/*
 * Whether beacons go out, by what isn't hostapd's word: the interface's operating state, which the
 * kernel knows, and the chip's own count of the beacons that it has sent, which odid-beacons asks
 * for and writes down. Either one tells of silence only where it was seen to tell of beacons
 * before: there are drivers that say nothing, or always the same.
 */
#ifndef ODID_BEACON_EVIDENCE_H
#define ODID_BEACON_EVIDENCE_H

#include <stdbool.h>
#include <stdint.h>

/* What odid-beacons writes, beside the daemon's run_dir and twice a second: "MILLISECONDS COUNT",
 * CLOCK_MONOTONIC's time when it asked, and "-" where the chip doesn't say. */
#define BEACON_COUNT_FILE "-beacons/count"
#define BEACON_COUNT_EVERY_US 500000

/* Fifteen beacons, and no count. */
#define BEACON_SILENCE_US 1500000

enum beacon_verdict { BEACONS_UNKNOWN, BEACONS_SENT, BEACONS_NOT_SENT, BEACONS_NO_CARRIER };

struct beacon_evidence {
    char count_path[160], state_path[160]; /* the second one: the interface's operstate */
    int64_t reported_us; /* CLOCK_MONOTONIC: when the count was asked for; INT64_MIN: never */
    bool counts, moves;  /* the chip says how many; and was seen to count */
    uint32_t count;
    int64_t moved_us, carrier_us; /* when it last did; INT64_MIN: never */
    bool carrier;                 /* now */
};

/* net: /sys/class/net, but for tests. What is nowhere tells nothing. */
void beacon_evidence_init(struct beacon_evidence *evidence, const char *run_dir, const char *net,
                          const char *iface);
/* since_us: beacons were to be expected from then on. */
enum beacon_verdict beacon_evidence_look(struct beacon_evidence *evidence, int64_t since_us,
                                         int64_t now_us);

#endif
