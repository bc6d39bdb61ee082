/* A snapshot of the aircraft with which nothing is wrong, and its JSON. */
#ifndef ODID_STATUS_FIXTURE_H
#define ODID_STATUS_FIXTURE_H

#include "base/loop.h"
#include "daemon/asking.h"
#include "daemon/status_json.h"
#include "health_fixture.h"

static struct telemetry_counters counters;
static struct asking asking;
static struct slot_lateness lateness;
static char sentences[2][CONFIG_PROBLEM_SIZE];

static inline int reset(void **state)
{
    (void)state;
    fixture_reset();
    counters =
        (struct telemetry_counters){.frames = 12345, .framing.bad_crc = 3, .other_system = 2};
    asking_begin(&asking, 0);
    memset(&lateness, 0, sizeof(lateness));
    memset(sentences, 0, sizeof(sentences));
    return 0;
}

static inline void gather(void *context, struct status_snapshot *snapshot, int64_t now_us)
{
    unsigned *calls = context;

    *calls += 1;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        fixture.radios[channel].confirmed_us = now_us - 50000;
    }
    snapshot->input = fixture.input;
    health_judge(&snapshot->health, &fixture.input, now_us);
    snapshot->counters = &counters;
    snapshot->asking = &asking;
    snapshot->lateness = &lateness;
    snapshot->start_us = NOW - 90000000;
    snapshot->vehicle = 1;
    snapshot->config_file = UINT64_C(0x0123456789abcdef);
    while (snapshot->config_reports < 2 && sentences[snapshot->config_reports][0] != '\0') {
        snapshot->config_reports++;
    }
    snapshot->config_report = (const char(*)[CONFIG_PROBLEM_SIZE])sentences;
}

static inline struct json_object *make_json(void)
{
    struct status_snapshot snapshot = {0};
    unsigned calls = 0;

    gather(&calls, &snapshot, NOW);
    return status_json(&snapshot, NOW);
}

#define TEST(name) cmocka_unit_test_setup(name, reset)

#endif
