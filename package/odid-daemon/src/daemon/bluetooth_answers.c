#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "daemon/bluetooth_adapter.h"

#define LOG_REPAIR_EVERY_US 10000000

/* Events, Bluetooth Core Vol 4 Part E 7.7. */
#define EVENT_COMMAND_COMPLETE 0x0E
#define EVENT_COMMAND_STATUS 0x0F
#define EVENT_HARDWARE_ERROR 0x10
#define EVENT_LE_META 0x3E
#define SUBEVENT_SET_TERMINATED 0x12

/* LE features, Vol 6 Part B 4.6, by byte and bit. */
#define FEATURE_CODED_PHY(features) ((features)[1] >> 3 & 1)
#define FEATURE_EXTENDED_ADVERTISING(features) ((features)[1] >> 4 & 1)
#define FEATURE_CODING_SELECTION(features) ((features)[5] & 1)
#define FEATURES_SIZE 8

/* A command's end: the return parameters behind the status. */
struct answer {
    uint16_t opcode;
    uint8_t status;
    const uint8_t *rest;
    size_t length;
};

/* ---- the set-up's answers ---- */

/* What the controller was asked for is long range's, or that as well. */
static bool is_long_ranges(const struct bluetooth_adapter *adapter)
{
    return adapter->step >= STEP_LONG_RANGE_PARAMETERS &&
           adapter->sets[BLUETOOTH_LONG_RANGE].possible;
}

static void refused(struct bluetooth_adapter *adapter, const struct answer *answer, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    adapter->long_range_refused = adapter->long_range_refused || is_long_ranges(adapter);
    snprintf(detail, sizeof(detail), "%s refused command 0x%04x with status 0x%02x", adapter->name,
             answer->opcode, answer->status);
    adapter->reset_first = true;
    bluetooth_failed(adapter, detail, now_us);
}

static void try_again_later(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (adapter->again_us == LOOP_NEVER) {
        adapter->again_us = now_us + adapter->again_wait_us;
        adapter->again_wait_us *= adapter->again_wait_us < BLUETOOTH_AGAIN_MAX_US ? 2 : 1;
    }
}

static void take_features(struct bluetooth_adapter *adapter, const uint8_t *features,
                          int64_t now_us)
{
    struct bluetooth_advertising *legacy = &adapter->sets[BLUETOOTH_LEGACY];
    struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];

    adapter->extended = FEATURE_EXTENDED_ADVERTISING(features);
    adapter->coding_selection = FEATURE_CODING_SELECTION(features);
    adapter->slow = adapter->parameters_refused = false;
    legacy->possible = legacy->radio != NULL;
    long_range->possible =
        long_range->radio != NULL && adapter->extended && FEATURE_CODED_PHY(features);
    if (long_range->radio == NULL) {
        return;
    }
    if (!long_range->possible) {
        try_again_later(adapter, now_us);
        radio_enter(long_range->radio, long_range->channel, RADIO_UNSUPPORTED,
                    "this controller has no extended advertising on Coded PHY", now_us);
    } else if (long_range->radio->state == RADIO_UNSUPPORTED) {
        radio_enter(long_range->radio, long_range->channel, RADIO_STARTING, adapter->name, now_us);
    }
}

/* Of one that had no long range, which is on the air with the rest. */
static void take_features_again(struct bluetooth_adapter *adapter, const struct answer *answer,
                                int64_t now_us)
{
    if (answer->status != BLUETOOTH_SUCCESS || answer->length < FEATURES_SIZE ||
        !FEATURE_EXTENDED_ADVERTISING(answer->rest) || !FEATURE_CODED_PHY(answer->rest)) {
        try_again_later(adapter, now_us);
        return;
    }
    adapter->reset_first = !adapter->extended; /* it was used in the other way to advertise */
    adapter->step = adapter->reset_first ? STEP_RESET : STEP_FEATURES;
    adapter->maximum_data = adapter->maximum_said = MESSAGES_EXTENDED_SIZE;
}

static void take_maximum_data(struct bluetooth_adapter *adapter, const struct answer *answer)
{
    struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];
    size_t octets = answer->length < 2 ? MESSAGES_EXTENDED_SIZE
                                       : answer->rest[0] | (size_t)answer->rest[1] << 8;

    /* For one message it has to do: a word that says less is tried. */
    if (octets >= MESSAGES_EXTENDED_EMPTY + MESSAGE_SIZE && octets < adapter->maximum_data) {
        adapter->maximum_data = adapter->maximum_said = octets;
        if (long_range->length > octets) { /* of before: another controller's */
            long_range->length = 0;
            long_range->pending = false;
        }
    }
}

/* Says that a controller isn't able, rather than that it isn't in the mood. */
static bool is_inability(uint8_t status)
{
    return status == BLUETOOTH_UNKNOWN_COMMAND || status == BLUETOOTH_MEMORY_EXCEEDED ||
           status == BLUETOOTH_UNSUPPORTED || status == BLUETOOTH_INVALID_PARAMETERS ||
           status == BLUETOOTH_PACKET_TOO_LONG;
}

/* Legacy goes on the air without long range rather than neither. */
static bool give_up_long_range(struct bluetooth_adapter *adapter, const struct answer *answer,
                               int64_t now_us)
{
    struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];
    char detail[RADIO_DETAIL_SIZE];

    if (!is_long_ranges(adapter) || !adapter->sets[BLUETOOTH_LEGACY].possible) {
        return false;
    }
    snprintf(detail, sizeof(detail), "%s refused command 0x%04x with status 0x%02x", adapter->name,
             answer->opcode, answer->status);
    long_range->possible = false;
    radio_enter(long_range->radio, long_range->channel, RADIO_UNSUPPORTED, detail, now_us);
    try_again_later(adapter, now_us);
    return true;
}

/* More than it took before, to see whether it does by now. */
static bool is_trial(const struct bluetooth_adapter *adapter)
{
    return adapter->trying_from != 0 &&
           adapter->sets[BLUETOOTH_LONG_RANGE].length > adapter->trying_from;
}

/* A pack of one message less, or as before a trial, which is still to be made. */
static bool take_smaller_pack(struct bluetooth_adapter *adapter)
{
    struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];

    if (long_range->length < MESSAGES_EXTENDED_EMPTY + 2 * MESSAGE_SIZE) {
        return false;
    }
    adapter->maximum_data =
        is_trial(adapter) ? adapter->trying_from : long_range->length - MESSAGE_SIZE;
    adapter->trying_from = 0;
    long_range->length = 0;
    long_range->pending = false;
    return true;
}

/* Asks for less after a refusal. Returns false when there is nothing less. */
static bool ask_for_less(struct bluetooth_adapter *adapter, const struct answer *answer,
                         int64_t now_us)
{
    if (!is_inability(answer->status)) {
        /* The second time it isn't a mood that an opening anew heals. */
        return adapter->long_range_refused && give_up_long_range(adapter, answer, now_us);
    }
    if (adapter->step == STEP_LEGACY_PARAMETERS && !adapter->slow) {
        adapter->slow = true; /* before Bluetooth 5.0, 100 ms is the shortest interval */
        adapter->parameters_refused = adapter->extended;
        return true;
    }
    if (adapter->step == STEP_LONG_RANGE_PARAMETERS && adapter->coding_selection) {
        adapter->coding_selection = false;
        adapter->parameters_refused = true;
        return true;
    }
    if (adapter->step == STEP_LONG_RANGE_DATA && take_smaller_pack(adapter)) {
        return true;
    }
    /* What fits a set that is off can be more than its PHY can send: refused when switched on
     * (Vol 4 Part E 7.8.56). */
    if (adapter->step == STEP_ENABLE && answer->status == BLUETOOTH_PACKET_TOO_LONG &&
        adapter->sets[BLUETOOTH_LONG_RANGE].possible && take_smaller_pack(adapter)) {
        adapter->step = STEP_LONG_RANGE_DATA;
        return true;
    }
    return give_up_long_range(adapter, answer, now_us);
}

static void say_on_air(const struct bluetooth_adapter *adapter, enum bluetooth_set i,
                       int64_t now_us)
{
    const struct bluetooth_advertising *set = &adapter->sets[i];
    char detail[RADIO_DETAIL_SIZE];

    if (i == BLUETOOTH_LEGACY) {
        snprintf(detail, sizeof(detail), "%s, every %d ms", adapter->name,
                 adapter->slow ? 100 : 20);
    } else {
        snprintf(detail, sizeof(detail), "%s, Coded PHY%s, every 200 ms", adapter->name,
                 adapter->coding_selection ? " S=8 requested" : "");
        if (adapter->maximum_data < MESSAGES_EXTENDED_SIZE) {
            size_t length = strlen(detail);

            snprintf(detail + length, sizeof(detail) - length, ", %zu octets at most",
                     adapter->maximum_data);
        }
    }
    radio_enter(set->radio, set->channel, RADIO_ON_AIR, detail, now_us);
}

/* It is on the air with less than it should be able to. */
static bool has_less(const struct bluetooth_adapter *adapter)
{
    const struct bluetooth_advertising *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];

    return adapter->parameters_refused || (long_range->radio != NULL && !long_range->possible) ||
           adapter->maximum_data < adapter->maximum_said;
}

static void come_on_air(struct bluetooth_adapter *adapter, int64_t now_us)
{
    retry_reset(&adapter->retry);
    adapter->reset_first = false;
    if (adapter->remedy != REMEDY_NONE && adapter->mended_us == LOOP_NEVER) {
        adapter->mended_us = now_us + BLUETOOTH_MENDED_US;
    }
    if (adapter->sets[BLUETOOTH_LONG_RANGE].possible) {
        adapter->long_range_refused = false;
    }
    if (has_less(adapter)) {
        try_again_later(adapter, now_us);
    } else {
        adapter->again_wait_us = BLUETOOTH_AGAIN_US;
    }
    for (enum bluetooth_set i = 0; i < BLUETOOTH_SETS; i++) {
        const struct bluetooth_advertising *set = &adapter->sets[i];

        if (!set->possible) {
            continue;
        }
        say_on_air(adapter, i, now_us);
        /* Enabled again, the controller sends what it has at once. Held anew, that would go out
         * twice more: the next payload came right behind an advertising event, and waited for
         * another. */
        if (!adapter->enabling_again) {
            radio_accepted(set->radio, set->channel, now_us);
            radio_confirmed(set->radio, now_us);
        }
    }
}

static void take_step_answer(struct bluetooth_adapter *adapter, const struct answer *answer,
                             int64_t now_us)
{
    if (answer->status != BLUETOOTH_SUCCESS) {
        /* Nothing to disable, no mark, no sets to clear, no word of a bound: as good as done. */
        if (adapter->step == STEP_DISABLE || adapter->step == STEP_MARK ||
            adapter->step == STEP_CLEAR || adapter->step == STEP_MAXIMUM_DATA) {
            adapter->step++;
        } else if (adapter->enabling_again) {
            adapter->enabling_again = false;
            adapter->step = STEP_DISABLE; /* it takes more than that */
        } else if (!ask_for_less(adapter, answer, now_us)) {
            refused(adapter, answer, now_us);
        }
        return;
    }
    if (adapter->step == STEP_FEATURES) {
        if (answer->length < FEATURES_SIZE) {
            refused(adapter, answer, now_us);
            return;
        }
        take_features(adapter, answer->rest, now_us);
    } else if (adapter->step == STEP_MAXIMUM_DATA) {
        take_maximum_data(adapter, answer);
    } else if (adapter->step == STEP_MARK) {
        adapter->marked = true;
    } else if (adapter->step == STEP_ENABLE) {
        come_on_air(adapter, now_us);
        adapter->enabling_again = false;
    }
    adapter->step++;
}

/* ---- on air ---- */

static void set_up_again(struct bluetooth_adapter *adapter, enum bluetooth_step from,
                         const char *why, const struct answer *answer, int64_t now_us)
{
    if (from < adapter->repair) {
        adapter->repair = from;
    }
    if (now_us - adapter->repair_logged_us >= LOG_REPAIR_EVERY_US) {
        adapter->repair_logged_us = now_us;
        log_warning("%s: %s (command 0x%04x, status 0x%02x): advertising is set up again",
                    adapter->name, why, answer->opcode, answer->status);
    }
}

/* More than before was tried. What was sent before goes on. */
static void end_trial(struct bluetooth_adapter *adapter, const struct answer *answer,
                      int64_t now_us)
{
    if (answer->status == BLUETOOTH_SUCCESS) {
        adapter->trying_from = 0;
    } else if (take_smaller_pack(adapter)) {
        try_again_later(adapter, now_us);
    }
    say_on_air(adapter, BLUETOOTH_LONG_RANGE, now_us);
}

/* On air nothing but data is sent, and a question. */
static void take_data_answer(struct bluetooth_adapter *adapter, const struct answer *answer,
                             int64_t now_us)
{
    const struct bluetooth_advertising *set = &adapter->sets[adapter->sending];
    /* Nobody interferes, nor did a moment ago: what was switched off takes data as well. */
    bool sends = adapter->repair == STEP_ON_AIR && now_us >= adapter->repair_from_us;

    if (adapter->sending == BLUETOOTH_LONG_RANGE && is_trial(adapter)) {
        end_trial(adapter, answer, now_us);
        if (answer->status != BLUETOOTH_SUCCESS) {
            return;
        }
    }
    if (answer->status != BLUETOOTH_SUCCESS) {
        set->radio->failures++;
        set_up_again(adapter, STEP_DISABLE, "new data was refused", answer, now_us);
        return;
    }
    if ((radio_accepted(set->radio, set->channel, now_us) || !set->pending) && sends) {
        radio_confirmed(set->radio, now_us);
        bluetooth_settle_remedy(adapter, now_us);
    }
}

static void count_repair(struct bluetooth_adapter *adapter)
{
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        if (adapter->sets[i].possible) {
            adapter->sets[i].radio->repairs++;
        }
    }
}

/*
 * The end of a command that isn't ours. Before our own set-up began it is the
 * kernel's, which brings the controller up, or a late one of before a time-out.
 */
static void take_foreign(struct bluetooth_adapter *adapter, const struct answer *answer,
                         int64_t now_us)
{
    /* One that switches advertising off is undone by switching it on. */
    bool was_enable =
        answer->opcode == BLUETOOTH_SET_ENABLE || answer->opcode == BLUETOOTH_SET_EXTENDED_ENABLE;

    if (adapter->step <= STEP_FEATURES || answer->status != BLUETOOTH_SUCCESS ||
        !bluetooth_changes_advertising(answer->opcode)) {
        return;
    }
    count_repair(adapter);
    set_up_again(adapter, was_enable ? STEP_ENABLE : STEP_DISABLE, "another program interfered",
                 answer, now_us);
}

/* Ours are without end (7.7.65.18): another program, or the controller, gave it one. */
static void take_set_terminated(struct bluetooth_adapter *adapter, const uint8_t *parameters,
                                int64_t now_us)
{
    const struct answer none = {.status = parameters[1]};

    if (adapter->step <= STEP_FEATURES || !adapter->extended || parameters[2] >= BLUETOOTH_SETS ||
        !adapter->sets[parameters[2]].possible) {
        return;
    }
    count_repair(adapter);
    set_up_again(adapter, STEP_ENABLE, "a set has ended", &none, now_us);
}

/* A controller whose firmware has started again by itself says nothing of it, takes data as before,
 * and sends nothing. */
static void take_mark(struct bluetooth_adapter *adapter, const struct answer *answer,
                      int64_t now_us)
{
    uint8_t mark[BLUETOOTH_MARK_SIZE];
    size_t size = bluetooth_mark(mark);

    if (answer->status != BLUETOOTH_SUCCESS || answer->length < size) {
        adapter->marked = false; /* it can't be asked */
    } else if (memcmp(answer->rest, mark, size) != 0) {
        count_repair(adapter);
        set_up_again(adapter, STEP_DISABLE, "it was reset, and said nothing", answer, now_us);
        /* Whoever else writes there has it set up again now and then, and no more. */
        adapter->mark_us = now_us + BLUETOOTH_MARK_AGAIN_US;
    }
}

/* ---- events ---- */

static void take_answer(struct bluetooth_adapter *adapter, const struct answer *answer,
                        int64_t now_us)
{
    if (answer->opcode == adapter->awaited) {
        adapter->awaited = 0;
        if (adapter->step == STEP_ON_AIR && answer->opcode == BLUETOOTH_READ_FEATURES) {
            take_features_again(adapter, answer, now_us);
        } else if (answer->opcode == BLUETOOTH_READ_DATA_LENGTH) {
            take_mark(adapter, answer, now_us);
        } else if (adapter->step == STEP_ON_AIR) {
            take_data_answer(adapter, answer, now_us);
        } else {
            take_step_answer(adapter, answer, now_us);
        }
    } else {
        take_foreign(adapter, answer, now_us);
    }
}

/*
 * Both events begin or end with the number of commands that the controller
 * takes at the moment (Vol 4 Part E 4.4). Behind the kernel's back that number
 * is the kernel's business.
 */
static void take_room(struct bluetooth_adapter *adapter, uint8_t commands, int64_t now_us)
{
    bool was_full = adapter->full;

    adapter->full = adapter->hci.h4 && commands == 0;
    /* However often it says that there is none. */
    if (hci_is_open(&adapter->hci) && adapter->awaited == 0 && !(was_full && adapter->full)) {
        loop_arm(&adapter->timer, adapter->full ? now_us + BLUETOOTH_ANSWER_US : LOOP_NEVER);
    }
}

static void take_command_complete(struct bluetooth_adapter *adapter, const uint8_t *parameters,
                                  size_t length, int64_t now_us)
{
    const struct answer answer = {
        .opcode = (uint16_t)(parameters[1] | parameters[2] << 8),
        .status = length > 3 ? parameters[3] : BLUETOOTH_SUCCESS,
        .rest = parameters + (length > 3 ? 4 : 3),
        .length = length > 3 ? length - 4 : 0,
    };

    if (answer.opcode != 0) { /* else it only tells the room */
        take_answer(adapter, &answer, now_us);
    }
    take_room(adapter, parameters[0], now_us);
}

static void take_command_status(struct bluetooth_adapter *adapter, const uint8_t *parameters,
                                int64_t now_us)
{
    const struct answer answer = {
        .opcode = (uint16_t)(parameters[2] | parameters[3] << 8),
        .status = parameters[0],
    };

    if (answer.opcode != 0 && answer.status != BLUETOOTH_SUCCESS) { /* else its end is to come */
        take_answer(adapter, &answer, now_us);
    }
    take_room(adapter, parameters[1], now_us);
}

void bluetooth_event(void *context, uint8_t code, const uint8_t *parameters, size_t length,
                     int64_t now_us)
{
    struct bluetooth_adapter *adapter = context;
    char detail[RADIO_DETAIL_SIZE];

    if (code == EVENT_COMMAND_COMPLETE && length >= 3) {
        take_command_complete(adapter, parameters, length, now_us);
    } else if (code == EVENT_COMMAND_STATUS && length >= 4) {
        take_command_status(adapter, parameters, now_us);
    } else if (code == EVENT_LE_META && length >= 3 && parameters[0] == SUBEVENT_SET_TERMINATED) {
        take_set_terminated(adapter, parameters, now_us);
    } else if (code == EVENT_HARDWARE_ERROR) {
        snprintf(detail, sizeof(detail), "%s reports hardware error 0x%02x", adapter->name,
                 length > 0 ? parameters[0] : 0);
        bluetooth_failed(adapter, detail, now_us);
    }
    bluetooth_advance(adapter, now_us);
}
