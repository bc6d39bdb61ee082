/*
 * The autopilot's two clocks on ours: its time since boot, and UTC as it
 * learnt it from its GNSS receiver.
 *
 * Pure. A board without a clock battery knows no time but the autopilot's.
 * Both mappings hold over silence, are carried over an autopilot's restart,
 * and survive the wrap of its 32-bit milliseconds after 49.7 days. A clock that
 * ran slow for a while, or a simulator's that stood still, is learnt again
 * within 10 s.
 */
#ifndef ODID_AUTOPILOT_CLOCK_H
#define ODID_AUTOPILOT_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

struct autopilot_clock {
    bool boot_known;
    uint32_t last_boot_ms;
    int64_t last_boot_us;   /* the same, not wrapped */
    int64_t offset_us;      /* our clock minus boot time: the least delayed arrival tells, ... */
    int64_t least_us[2];    /* ... of this window and of the one before */
    int64_t window_us;      /* when this window began */
    int64_t heard_us;       /* the last boot time */
    unsigned ahead_seen;    /* boot times in a row that were stamped in the future */
    unsigned backward_seen; /* boot times in a row that were earlier than the newest, ... */
    uint32_t backward_ms;   /* ... the last of them */
    bool utc_known;
    bool utc_of_this_boot; /* said since it started. What is carried over a start goes by our clock:
                              of the new boot time it isn't known yet how late it came */
    int64_t utc_since_us;  /* confirmed since then, on our clock, ... */
    int64_t utc_said_us;   /* ... until then, or for 10 s: then it counts for good */
    int64_t utc_offset_us; /* UTC (Unix) minus boot time, or minus our clock when carried over */
    int64_t step_us;       /* UTC minus boot time, another one that was seen ... */
    unsigned step_seen;    /* ... this often in a row, ... */
    int64_t step_since_us; /* ... since that instant of our clock */
    unsigned restarts;
};

/*
 * Takes the boot time of a message that came now. Returns the instant on our
 * clock at which the autopilot stamped it (never after now). restarted: its
 * boot time is not that of the start that was heard before, and not for a
 * delay on the way.
 */
int64_t autopilot_clock_boot(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us,
                             bool *restarted);

/* From 2010 to 2100: what lies outside is no GNSS time. */
bool autopilot_clock_plausible(uint64_t unix_us);

/*
 * Takes a SYSTEM_TIME. One that isn't plausible is ignored;
 * another one counts when a fix confirms it (an autopilot without one says what
 * it likes: 2042 was seen), or when it goes on with what is known. The first one
 * counts at once, and is forgotten when nobody goes on with it for ten seconds. A step of
 * more than a second is believed at its third time in a row, and after two seconds.
 */
void autopilot_clock_utc(struct autopilot_clock *clock, uint64_t unix_us, uint32_t boot_ms,
                         bool fix_known, int64_t now_us);

/* UTC (Unix, microseconds) at an instant of our clock. Only when utc_known. */
int64_t autopilot_clock_unix_us(const struct autopilot_clock *clock, int64_t at_us);

/* Another autopilot takes over: its boot time starts anew, UTC goes on. */
void autopilot_clock_new_boot(struct autopilot_clock *clock);

#endif
