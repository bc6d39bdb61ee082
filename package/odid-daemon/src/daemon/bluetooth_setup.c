#include "daemon/bluetooth_adapter.h"

/* The random delay of each advertising event (at most 10 ms), and what a clock may be off. */
#define HOLD_MARGIN_US 12000

/* ---- commands ---- */

static int64_t patience_us(const struct bluetooth_adapter *adapter, uint16_t opcode)
{
    return opcode == BLUETOOTH_RESET && !adapter->hci.h4 ? BLUETOOTH_RESET_ANSWER_US
                                                         : BLUETOOTH_ANSWER_US;
}

static void command(struct bluetooth_adapter *adapter, uint16_t opcode, const uint8_t *parameters,
                    size_t length, int64_t now_us)
{
    int result = hci_command(&adapter->hci, opcode, parameters, (uint8_t)length);

    if (result < 0) {
        bluetooth_lost(adapter, result, now_us);
        return;
    }
    adapter->awaited = opcode;
    loop_arm(&adapter->timer, now_us + patience_us(adapter, opcode));
}

static void send_parameters(struct bluetooth_adapter *adapter, enum bluetooth_set set,
                            int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];
    uint16_t interval = adapter->slow ? BLUETOOTH_INTERVAL_100_MS : BLUETOOTH_INTERVAL_20_MS;

    /* A pack takes some 17 ms on the air at S=8, on a radio shared with the legacy set: every
     * 200 ms leaves that its time, and is five times what the rules ask. */
    if (set == BLUETOOTH_LONG_RANGE) {
        interval = BLUETOOTH_INTERVAL_200_MS;
    }
    if (!adapter->extended) {
        command(adapter, BLUETOOTH_SET_PARAMETERS, out, bluetooth_parameters(interval, out),
                now_us);
    } else if (set == BLUETOOTH_LONG_RANGE && adapter->coding_selection) {
        command(adapter, BLUETOOTH_SET_EXTENDED_PARAMETERS_V2, out,
                bluetooth_extended_parameters_v2(set, interval, out), now_us);
    } else {
        command(adapter, BLUETOOTH_SET_EXTENDED_PARAMETERS, out,
                bluetooth_extended_parameters(set, interval, out), now_us);
    }
}

static void send_address(struct bluetooth_adapter *adapter, enum bluetooth_set set, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];

    if (adapter->extended) {
        command(adapter, BLUETOOTH_SET_EXTENDED_ADDRESS, out,
                bluetooth_extended_address(set, adapter->address, out), now_us);
    } else {
        command(adapter, BLUETOOTH_SET_ADDRESS, adapter->address, 6, now_us);
    }
}

static void send_data(struct bluetooth_adapter *adapter, enum bluetooth_set which, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];
    struct bluetooth_advertising *set = &adapter->sets[which];

    set->pending = false;
    adapter->sending = which;
    if (adapter->extended) {
        command(adapter, BLUETOOTH_SET_EXTENDED_DATA, out,
                bluetooth_extended_data(which, set->payload, set->length, out), now_us);
    } else {
        command(adapter, BLUETOOTH_SET_DATA, out, bluetooth_data(set->payload, set->length, out),
                now_us);
    }
}

static void send_mark(struct bluetooth_adapter *adapter, int64_t now_us)
{
    uint8_t out[BLUETOOTH_MARK_SIZE];

    command(adapter, BLUETOOTH_WRITE_DATA_LENGTH, out, bluetooth_mark(out), now_us);
}

static void send_enable(struct bluetooth_adapter *adapter, bool on, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];
    const bool used[BLUETOOTH_SETS] = {on && adapter->sets[BLUETOOTH_LEGACY].possible,
                                       on && adapter->sets[BLUETOOTH_LONG_RANGE].possible};

    if (adapter->extended) {
        command(adapter, BLUETOOTH_SET_EXTENDED_ENABLE, out, bluetooth_extended_enable(used, out),
                now_us);
    } else {
        out[0] = on;
        command(adapter, BLUETOOTH_SET_ENABLE, out, 1, now_us);
    }
}

/* ---- their order ---- */

/* Does this controller need this step? */
static bool needed(const struct bluetooth_adapter *adapter, enum bluetooth_step step)
{
    switch (step) {
    case STEP_RESET:
        /* The kernel resets what it brings up. But a controller that was used in the other one
         * of the two ways to advertise refuses ours until it is reset. */
        return adapter->hci.h4 || adapter->reset_first;
    case STEP_MARK:
        /* One with advertising sets needs none: for a set that a reset took away data is refused
         * (7.8.54). Legacy's it takes, sent or not. */
        return !adapter->extended;
    case STEP_CLEAR:
        return adapter->extended;
    case STEP_MAXIMUM_DATA:
        return adapter->sets[BLUETOOTH_LONG_RANGE].possible;
    case STEP_LEGACY_PARAMETERS:
    case STEP_LEGACY_ADDRESS:
    case STEP_LEGACY_DATA:
        return adapter->sets[BLUETOOTH_LEGACY].possible;
    case STEP_LONG_RANGE_PARAMETERS:
    case STEP_LONG_RANGE_ADDRESS:
    case STEP_LONG_RANGE_DATA:
        return adapter->sets[BLUETOOTH_LONG_RANGE].possible;
    default:
        return true;
    }
}

/* Advertising nothing would be worse than waiting for the first payload. */
static bool has_payload(const struct bluetooth_adapter *adapter)
{
    return (adapter->step != STEP_LEGACY_DATA || adapter->sets[BLUETOOTH_LEGACY].length > 0) &&
           (adapter->step != STEP_LONG_RANGE_DATA ||
            adapter->sets[BLUETOOTH_LONG_RANGE].length > 0);
}

static void send_step(struct bluetooth_adapter *adapter, int64_t now_us)
{
    switch (adapter->step) {
    case STEP_RESET:
        command(adapter, BLUETOOTH_RESET, NULL, 0, now_us);
        break;
    case STEP_FEATURES:
        command(adapter, BLUETOOTH_READ_FEATURES, NULL, 0, now_us);
        break;
    case STEP_MAXIMUM_DATA:
        command(adapter, BLUETOOTH_READ_MAXIMUM_DATA, NULL, 0, now_us);
        break;
    case STEP_DISABLE:
        send_enable(adapter, false, now_us);
        break;
    case STEP_MARK:
        send_mark(adapter, now_us);
        break;
    case STEP_CLEAR:
        command(adapter, BLUETOOTH_CLEAR_SETS, NULL, 0, now_us);
        break;
    case STEP_LEGACY_PARAMETERS:
        send_parameters(adapter, BLUETOOTH_LEGACY, now_us);
        break;
    case STEP_LEGACY_ADDRESS:
        send_address(adapter, BLUETOOTH_LEGACY, now_us);
        break;
    case STEP_LEGACY_DATA:
        send_data(adapter, BLUETOOTH_LEGACY, now_us);
        break;
    case STEP_LONG_RANGE_PARAMETERS:
        send_parameters(adapter, BLUETOOTH_LONG_RANGE, now_us);
        break;
    case STEP_LONG_RANGE_ADDRESS:
        send_address(adapter, BLUETOOTH_LONG_RANGE, now_us);
        break;
    case STEP_LONG_RANGE_DATA:
        send_data(adapter, BLUETOOTH_LONG_RANGE, now_us);
        break;
    case STEP_ENABLE:
        send_enable(adapter, true, now_us);
        break;
    case STEP_ON_AIR:
        break;
    }
}

/*
 * What is replaced within an advertising interval and its random 10 ms may never
 * be sent. The schedule's slots are longer than that; a controller that answered
 * late makes one short.
 */
int64_t bluetooth_hold_us(const struct bluetooth_adapter *adapter, enum bluetooth_set set)
{
    int64_t interval_us = set == BLUETOOTH_LONG_RANGE ? 200000 : adapter->slow ? 100000 : 20000;

    return interval_us + HOLD_MARGIN_US;
}

int64_t bluetooth_held_until_us(const struct bluetooth_adapter *adapter, enum bluetooth_set set)
{
    int64_t accepted_us = adapter->sets[set].radio->accepted_us;

    return accepted_us == INT64_MIN ? INT64_MIN : accepted_us + bluetooth_hold_us(adapter, set);
}

static void send_newest(struct bluetooth_adapter *adapter, int64_t now_us)
{
    for (enum bluetooth_set set = 0; set < BLUETOOTH_SETS; set++) {
        int64_t due_us;

        if (!adapter->sets[set].possible || !adapter->sets[set].pending) {
            continue;
        }
        due_us = bluetooth_held_until_us(adapter, set);
        if (due_us <= now_us) {
            send_data(adapter, set, now_us);
            return;
        }
        if (due_us < adapter->timer.deadline_us) {
            loop_arm(&adapter->timer, due_us);
        }
    }
}

/* Right behind a payload's answer the next one isn't due yet. One that waits goes first, but not
 * each time: on a machine that is late there is always one. */
static bool mark_is_due(const struct bluetooth_adapter *adapter, int64_t now_us)
{
    bool waits = adapter->sets[BLUETOOTH_LEGACY].pending;

    return adapter->marked && now_us >= adapter->mark_us + (waits ? BLUETOOTH_MARK_WAITS_US : 0);
}

/* Has the controller still its mark? */
static void look_for_mark(struct bluetooth_adapter *adapter, int64_t now_us)
{
    adapter->mark_us = now_us + BLUETOOTH_MARK_EVERY_US;
    command(adapter, BLUETOOTH_READ_DATA_LENGTH, NULL, 0, now_us);
}

/* Nothing of what is wanted can be done here. */
static bool is_unable(const struct bluetooth_adapter *adapter)
{
    return adapter->step > STEP_MAXIMUM_DATA && !adapter->sets[BLUETOOTH_LEGACY].possible &&
           !adapter->sets[BLUETOOTH_LONG_RANGE].possible;
}

/* Whoever had what was missing, or made the controller refuse it, may be gone by now. */
static void try_again(struct bluetooth_adapter *adapter, int64_t now_us)
{
    const struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];

    if (now_us < adapter->again_us || (adapter->step != STEP_ON_AIR && !is_unable(adapter))) {
        return;
    }
    adapter->again_us = LOOP_NEVER;
    if (adapter->maximum_data < adapter->maximum_said) {
        adapter->trying_from = adapter->maximum_data;
        adapter->maximum_data = adapter->maximum_said;
    }
    if (is_unable(adapter) || adapter->parameters_refused) {
        adapter->step = STEP_FEATURES;
    } else if (long_range->radio != NULL && !long_range->possible) {
        command(adapter, BLUETOOTH_READ_FEATURES, NULL, 0, now_us); /* which disturbs nothing */
    }
}

/* Goes back in the set-up when that is asked for. Too early, it is put off. */
static void begin_repair(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (adapter->repair >= adapter->step) {
        adapter->repair = STEP_ON_AIR; /* that part is still to come anyway */
        return;
    }
    if (now_us < adapter->repair_from_us) {
        loop_arm(&adapter->timer, adapter->repair_from_us);
        return;
    }
    adapter->step = adapter->repair;
    adapter->enabling_again = adapter->repair == STEP_ENABLE;
    adapter->repair = STEP_ON_AIR;
    adapter->repair_from_us = now_us + BLUETOOTH_REPAIR_EVERY_US;
}

void bluetooth_advance(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (!hci_is_open(&adapter->hci) || adapter->awaited != 0 || adapter->full) {
        return;
    }
    begin_repair(adapter, now_us);
    try_again(adapter, now_us);
    if (!hci_is_open(&adapter->hci) || adapter->awaited != 0) {
        return;
    }
    while (adapter->step < STEP_ON_AIR && !needed(adapter, adapter->step)) {
        adapter->step++;
    }
    if (is_unable(adapter)) {
        return;
    }
    if (adapter->step == STEP_ON_AIR && mark_is_due(adapter, now_us)) {
        look_for_mark(adapter, now_us);
    } else if (adapter->step == STEP_ON_AIR) {
        send_newest(adapter, now_us);
    } else if (has_payload(adapter)) {
        send_step(adapter, now_us);
    }
}

void bluetooth_silence(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (hci_is_open(&adapter->hci) && adapter->step > STEP_FEATURES) {
        send_enable(adapter, false, now_us);
    }
}
