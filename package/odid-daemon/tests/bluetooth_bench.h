/* What the tests of the Bluetooth adapters share: a controller or two, and the two radios. */
#ifndef ODID_TESTS_BLUETOOTH_BENCH_H
#define ODID_TESTS_BLUETOOTH_BENCH_H

#include <stdio.h>
#include <string.h>

#include "simulated_time.h"

#include "daemon/bluetooth.h"
#include "fake_controller.h"
#include "loop_until.h"

#define CAPABLE (FAKE_EXTENDED | FAKE_CODED | FAKE_CODING_SELECTION)

static struct fake_controller fake;
static struct config config;
static struct radio bt4, bt5;
static uint8_t pack[MESSAGES_EXTENDED_SIZE];

static void set_legacy(uint8_t counter)
{
    uint8_t data[MESSAGES_LEGACY_SIZE] = {0x1E, 0x16, 0xFA, 0xFF, 0x0D, counter};

    bluetooth_set_legacy(data, loop_now_us());
}

static void set_extended(uint8_t counter)
{
    pack[0] = sizeof(pack) - 1;
    pack[5] = counter;
    bluetooth_set_extended(pack, sizeof(pack), loop_now_us());
}

/* Without a payload: set_legacy and set_extended give one. */
static void start(uint64_t features)
{
    fake_start(&fake, features);
    memset(&config, 0, sizeof(config));
    config.bt4_enabled = config.bt5_enabled = true;
    snprintf(config.bt_adapter, sizeof(config.bt_adapter), "%s", fake.adapter);
}

static void begin(void)
{
    bluetooth_start(&config, &bt4, &bt5, loop_now_us());
}

static int end(void **state)
{
    (void)state;
    bluetooth_stop();
    run_ms(2);
    fake_end(&fake);
    return 0;
}

static bool legacy_on_air(void)
{
    return bt4.state == RADIO_ON_AIR && fake.sets[0].enabled;
}

static inline bool both_on_air(void)
{
    return legacy_on_air() && bt5.state == RADIO_ON_AIR && fake.sets[1].enabled;
}

static inline void start_on_air(uint64_t features)
{
    start(features);
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(features & FAKE_CODED ? both_on_air : legacy_on_air, 1000));
    run_ms(50);
}

/* How many commands of this kind came since the n-th. */
static inline unsigned count_since(unsigned n, uint16_t opcode)
{
    unsigned found = 0;

    for (unsigned i = n; i < fake.count; i++) {
        found += fake.commands[i].opcode == opcode;
    }
    return found;
}

#endif
