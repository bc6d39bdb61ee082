/* A recorder with a simulated clock, and an aircraft with which nothing is wrong. */
#ifndef ODID_RECORDER_BENCH_H
#define ODID_RECORDER_BENCH_H

#include <stdio.h>
#include <string.h>

#include "flights/recorder_read.h"
#include "flights/recorder_text.h"
#include "recorder/recorder.h"

#define SECOND INT64_C(1000000)
#define BOOT "11111111-2222-3333-4444-555555555555"
/* 2026-01-02 03:04:05 UTC */
#define UTC INT64_C(1767323045000000)

static struct {
    struct recorder recorder;
    struct recorder_text text;
    struct recorder_snapshot snapshot; /* of the next second */
    struct recorder_flight flight;     /* what the record says, after look() */
    bool sends[CHANNELS];              /* else the last confirmation stays the last */
    int64_t now_us;
} bench;

static inline void bench_line(void *context, const char *line)
{
    (void)context;
    recorder_text_add(&bench.text, line);
}

/* Recorder and daemon begin 3 s after power-on; nothing is on the air. */
static inline int bench_reset(void **state)
{
    (void)state;
    memset(&bench, 0, sizeof(bench));
    bench.now_us = 3 * SECOND;
    bench.snapshot.answered = bench.snapshot.armed_known = true;
    bench.snapshot.link = bench.snapshot.position = bench.snapshot.identity = true;
    bench.snapshot.daemon_start_us = 3 * SECOND;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        struct recorder_channel_status *status = &bench.snapshot.channels[channel];

        status->required = channel != CHANNEL_BT5;
        status->confirmed_us = status->unbroken_us = status->paused_us = INT64_MIN;
        snprintf(status->text, sizeof(status->text), "absent (nothing there)");
    }
    recorder_start(&bench.recorder, bench_line, NULL, BOOT, "2026.1 \"x\\y\"", bench.now_us);
    return 0;
}

/* The channel sends from this instant on, or not any more. */
static inline void set_sending(enum channel channel, bool on)
{
    bench.sends[channel] = on;
    bench.snapshot.channels[channel].on_air = on;
    if (on) {
        bench.snapshot.channels[channel].paused_us = bench.snapshot.channels[channel].confirmed_us;
        bench.snapshot.channels[channel].unbroken_us = bench.now_us;
        bench.snapshot.channels[channel].confirmed_us = bench.now_us;
    }
}

/* One look, after so long. */
static inline void pass_us(int64_t us)
{
    bench.now_us += us;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (bench.sends[channel]) {
            bench.snapshot.channels[channel].confirmed_us = bench.now_us - 100000;
        }
    }
    recorder_tick(&bench.recorder, &bench.snapshot, bench.now_us);
    bench.snapshot.unix_us += bench.snapshot.unix_us != 0 ? us : 0;
}

static inline void pass(int seconds)
{
    for (int i = 0; i < seconds; i++) {
        pass_us(SECOND);
    }
}

static inline void take_off(void)
{
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    pass(10);
    bench.snapshot.armed = true;
    pass(1);
}

/* Reads the record as it stands. */
static inline const struct recorder_flight *look(void)
{
    recorder_say_totals(&bench.recorder);
    recorder_read(&bench.flight, bench.text.bytes, bench.text.length, NULL, NULL);
    return &bench.flight;
}

static inline unsigned count_in_text(const char *what)
{
    unsigned count = 0;
    size_t length = strlen(what);
    const char *at = bench.text.bytes, *end = bench.text.bytes + bench.text.length;

    while ((at = memmem(at, (size_t)(end - at), what, length)) != NULL) {
        count++;
        at += length;
    }
    return count;
}

#endif
