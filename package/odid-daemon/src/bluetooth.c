#include "bluetooth.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "bluetooth_commands.h"
#include "hci.h"
#include "log.h"
#include "rfkill.h"

/* A controller answers within milliseconds; one that doesn't in a second hangs. */
#define ANSWER_US 1000000
/* Another program's commands are undone at most once in this time: a slot. */
#define REPAIR_EVERY_US 125000
#define LOG_REPAIR_EVERY_US 10000000

#define EVENT_COMMAND_COMPLETE 0x0E
#define EVENT_COMMAND_STATUS 0x0F
#define EVENT_HARDWARE_ERROR 0x10
#define STATUS_SUCCESS 0x00

/* LE features, Vol 6 Part B 4.6, by byte and bit. */
#define FEATURE_CODED_PHY(features) ((features)[1] >> 3 & 1)
#define FEATURE_EXTENDED_ADVERTISING(features) ((features)[1] >> 4 & 1)
#define FEATURE_CODING_SELECTION(features) ((features)[5] & 1)

/*
 * The set-up, command by command. A step that this controller doesn't need is
 * passed over.
 */
enum step {
    STEP_RESET, /* H4 only: the kernel resets what it brings up */
    STEP_FEATURES,
    STEP_DISABLE,
    STEP_CLEAR,
    STEP_LEGACY_PARAMETERS,
    STEP_LEGACY_ADDRESS,
    STEP_LEGACY_DATA,
    STEP_LONG_RANGE_PARAMETERS,
    STEP_LONG_RANGE_ADDRESS,
    STEP_LONG_RANGE_DATA,
    STEP_ENABLE,
    STEP_ON_AIR,
};

/* One of the two things that can be advertised. */
struct set {
    struct radio *radio; /* NULL: not this adapter's */
    enum channel channel;
    bool possible; /* wanted, and the controller can */
    bool pending;  /* a newer payload than the controller has */
    size_t length; /* of the payload, 0: none was given yet */
    uint8_t payload[MESSAGES_EXTENDED_SIZE];
};

struct adapter {
    const char *name;
    struct hci hci;
    struct loop_timer timer; /* retry while closed, the answer's time-out while one is awaited */
    struct retry retry;
    enum step step;
    enum bluetooth_set sending; /* whose data went out last */
    uint16_t awaited;           /* opcode whose completion must come next; 0: none */
    bool extended;              /* speaks extended commands, and only those */
    bool coding_selection;      /* S=8 can be asked for */
    bool slow;                  /* refused 20 ms */
    bool repair;                /* set up again as soon as nothing is awaited */
    int64_t repair_from_us;     /* not before */
    int64_t repair_logged_us;
    struct set sets[BLUETOOTH_SETS];
};

static struct {
    struct adapter adapters[2];
    unsigned count;
    uint8_t address[6];
} self;

/* ---- states ---- */

static void enter(struct adapter *adapter, enum radio_state state, const char *detail,
                  int64_t now_us)
{
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        struct set *set = &adapter->sets[i];

        if (set->radio != NULL && set->radio->state != RADIO_UNSUPPORTED) {
            radio_enter(set->radio, set->channel, state, detail, now_us);
        }
    }
}

static void close_and_retry(struct adapter *adapter, enum radio_state state, const char *detail,
                            int64_t now_us)
{
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        if (adapter->sets[i].radio != NULL) {
            adapter->sets[i].radio->failures++;
        }
    }
    hci_close(&adapter->hci);
    adapter->awaited = 0;
    enter(adapter, state, detail, now_us);
    loop_arm(&adapter->timer, retry_next(&adapter->retry, now_us));
}

static void on_lost(void *context, int error, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    snprintf(detail, sizeof(detail), "%s: %s", ((struct adapter *)context)->name, strerror(-error));
    close_and_retry(context, RADIO_LOST, detail, now_us);
}

static void refused(struct adapter *adapter, uint16_t opcode, uint8_t status, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    snprintf(detail, sizeof(detail), "%s refused command 0x%04x with status 0x%02x", adapter->name,
             opcode, status);
    close_and_retry(adapter, RADIO_LOST, detail, now_us);
}

static void show_on_air(struct adapter *adapter, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        struct set *set = &adapter->sets[i];

        if (!set->possible) {
            continue;
        }
        if (i == BLUETOOTH_LEGACY) {
            snprintf(detail, sizeof(detail), "%s, every %d ms", adapter->name,
                     adapter->slow ? 100 : 20);
        } else {
            snprintf(detail, sizeof(detail), "%s, Coded PHY%s, every 200 ms", adapter->name,
                     adapter->coding_selection ? " S=8" : "");
        }
        set->radio->detail[0] = '\0';
        radio_enter(set->radio, set->channel, RADIO_ON_AIR, detail, now_us);
    }
}

/* ---- commands ---- */

static void command(struct adapter *adapter, uint16_t opcode, const uint8_t *parameters,
                    size_t length, int64_t now_us)
{
    int result = hci_command(&adapter->hci, opcode, parameters, (uint8_t)length);

    if (result < 0) {
        on_lost(adapter, result, now_us);
        return;
    }
    adapter->awaited = opcode;
    loop_arm(&adapter->timer, now_us + ANSWER_US);
}

static void send_parameters(struct adapter *adapter, enum bluetooth_set set, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];
    uint16_t interval = adapter->slow ? BLUETOOTH_INTERVAL_100_MS : BLUETOOTH_INTERVAL_20_MS;

    /* A long range pack takes some 17 ms on the air, on a radio shared with the legacy set:
     * every 200 ms leaves that its time, and is five times what the rules ask. */
    if (set == BLUETOOTH_LONG_RANGE) {
        interval = BLUETOOTH_INTERVAL_200_MS;
    }
    if (!adapter->extended) {
        command(adapter, BLUETOOTH_SET_PARAMETERS, out, bluetooth_parameters(interval, out),
                now_us);
    } else if (adapter->coding_selection) {
        command(adapter, BLUETOOTH_SET_EXTENDED_PARAMETERS_V2, out,
                bluetooth_extended_parameters_v2(set, interval, out), now_us);
    } else {
        command(adapter, BLUETOOTH_SET_EXTENDED_PARAMETERS, out,
                bluetooth_extended_parameters(set, interval, out), now_us);
    }
}

static void send_address(struct adapter *adapter, enum bluetooth_set set, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];

    if (adapter->extended) {
        command(adapter, BLUETOOTH_SET_EXTENDED_ADDRESS, out,
                bluetooth_extended_address(set, self.address, out), now_us);
    } else {
        command(adapter, BLUETOOTH_SET_ADDRESS, self.address, sizeof(self.address), now_us);
    }
}

static void send_data(struct adapter *adapter, enum bluetooth_set which, int64_t now_us)
{
    uint8_t out[HCI_PARAMETERS_MAX];
    struct set *set = &adapter->sets[which];

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

static void send_enable(struct adapter *adapter, bool on, int64_t now_us)
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

/* ---- the set-up ---- */

static bool any_possible(const struct adapter *adapter)
{
    return adapter->sets[BLUETOOTH_LEGACY].possible || adapter->sets[BLUETOOTH_LONG_RANGE].possible;
}

/* Does this controller need this step? */
static bool needed(const struct adapter *adapter, enum step step)
{
    switch (step) {
    case STEP_RESET:
        return adapter->hci.h4;
    case STEP_CLEAR:
        return adapter->extended;
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
static bool has_payload(const struct adapter *adapter, enum step step)
{
    return (step != STEP_LEGACY_DATA || adapter->sets[BLUETOOTH_LEGACY].length > 0) &&
           (step != STEP_LONG_RANGE_DATA || adapter->sets[BLUETOOTH_LONG_RANGE].length > 0);
}

static void send_step(struct adapter *adapter, int64_t now_us)
{
    switch (adapter->step) {
    case STEP_RESET:
        command(adapter, BLUETOOTH_RESET, NULL, 0, now_us);
        break;
    case STEP_FEATURES:
        command(adapter, BLUETOOTH_READ_FEATURES, NULL, 0, now_us);
        break;
    case STEP_DISABLE:
        send_enable(adapter, false, now_us);
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

static void begin_repair(struct adapter *adapter, int64_t now_us)
{
    adapter->repair = false;
    adapter->repair_from_us = now_us + REPAIR_EVERY_US;
    adapter->step = STEP_DISABLE;
}

/* Sends what is due next, unless an answer is awaited. */
static void advance(struct adapter *adapter, int64_t now_us)
{
    if (!hci_is_open(&adapter->hci) || adapter->awaited != 0) {
        return;
    }
    if (adapter->repair && now_us >= adapter->repair_from_us) {
        begin_repair(adapter, now_us);
    }
    while (adapter->step < STEP_ON_AIR && !needed(adapter, adapter->step)) {
        adapter->step++;
    }
    if (adapter->step > STEP_FEATURES && !any_possible(adapter)) {
        return; /* nothing here that this controller can do */
    }
    if (adapter->step < STEP_ON_AIR) {
        if (has_payload(adapter, adapter->step)) {
            send_step(adapter, now_us);
        }
        return;
    }
    for (enum bluetooth_set set = 0; set < BLUETOOTH_SETS; set++) {
        if (adapter->sets[set].possible && adapter->sets[set].pending) {
            send_data(adapter, set, now_us);
            return;
        }
    }
}

/* ---- answers ---- */

static void take_features(struct adapter *adapter, const uint8_t features[8], int64_t now_us)
{
    struct set *long_range = &adapter->sets[BLUETOOTH_LONG_RANGE];

    adapter->extended = FEATURE_EXTENDED_ADVERTISING(features);
    adapter->coding_selection = FEATURE_CODING_SELECTION(features);
    adapter->sets[BLUETOOTH_LEGACY].possible = adapter->sets[BLUETOOTH_LEGACY].radio != NULL;
    long_range->possible =
        long_range->radio != NULL && adapter->extended && FEATURE_CODED_PHY(features);
    if (long_range->radio != NULL && !long_range->possible) {
        radio_enter(long_range->radio, long_range->channel, RADIO_UNSUPPORTED,
                    "this controller has no extended advertising on Coded PHY", now_us);
    } else if (long_range->radio != NULL && long_range->radio->state == RADIO_UNSUPPORTED) {
        radio_enter(long_range->radio, long_range->channel, RADIO_STARTING, "", now_us);
    }
}

/* A step's own answer. Returns false when the step is to be sent again, or all is lost. */
static bool take_answer(struct adapter *adapter, uint16_t opcode, uint8_t status,
                        const uint8_t *rest, size_t length, int64_t now_us)
{
    if (status == BLUETOOTH_INVALID_PARAMETERS && adapter->step == STEP_LEGACY_PARAMETERS &&
        !adapter->slow) {
        adapter->slow = true;
        return false;
    }
    /* Nothing to disable, no sets to clear: as good as done. */
    if (status != STATUS_SUCCESS && adapter->step != STEP_DISABLE && adapter->step != STEP_CLEAR) {
        refused(adapter, opcode, status, now_us);
        return false;
    }
    if (adapter->step == STEP_FEATURES) {
        if (length < 8) {
            refused(adapter, opcode, status, now_us);
            return false;
        }
        take_features(adapter, rest, now_us);
    }
    if (adapter->step == STEP_ENABLE) {
        retry_reset(&adapter->retry);
        show_on_air(adapter, now_us);
    }
    return true;
}

/* While on air only data is sent. */
static void take_data_answer(struct adapter *adapter, uint8_t status, int64_t now_us)
{
    struct set *set = &adapter->sets[adapter->sending];

    if (status != STATUS_SUCCESS) {
        adapter->repair = true; /* somebody undid the sets, or another one's commands came first */
        log_warning("%s refused advertising data with status 0x%02x: setting up again",
                    adapter->name, status);
        return;
    }
    radio_accepted(set->radio, set->channel, now_us);
}

static void foreign(struct adapter *adapter, uint16_t opcode, int64_t now_us)
{
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        if (adapter->sets[i].possible) {
            adapter->sets[i].radio->repairs++;
        }
    }
    if (now_us - adapter->repair_logged_us >= LOG_REPAIR_EVERY_US) {
        adapter->repair_logged_us = now_us;
        log_warning("%s: another program sent command 0x%04x: advertising is set up again",
                    adapter->name, opcode);
    }
    adapter->repair = true;
}

static void on_completion(struct adapter *adapter, uint16_t opcode, uint8_t status,
                          const uint8_t *rest, size_t length, int64_t now_us)
{
    if (opcode == 0) {
        return; /* only the number of commands that the controller takes */
    }
    if (opcode != adapter->awaited) {
        if (adapter->step > STEP_FEATURES && bluetooth_changes_advertising(opcode)) {
            foreign(adapter, opcode, now_us);
        }
    } else {
        adapter->awaited = 0;
        loop_arm(&adapter->timer, LOOP_NEVER);
        if (adapter->step == STEP_ON_AIR) {
            take_data_answer(adapter, status, now_us);
        } else if (take_answer(adapter, opcode, status, rest, length, now_us)) {
            adapter->step++;
        }
    }
    advance(adapter, now_us);
    if (hci_is_open(&adapter->hci) && adapter->awaited == 0 && adapter->repair) {
        loop_arm(&adapter->timer, adapter->repair_from_us);
    }
}

static void on_event(void *context, uint8_t code, const uint8_t *parameters, size_t length,
                     int64_t now_us)
{
    struct adapter *adapter = context;

    if (code == EVENT_COMMAND_COMPLETE && length >= 3) {
        uint8_t status = length >= 4 ? parameters[3] : STATUS_SUCCESS;

        on_completion(adapter, (uint16_t)(parameters[1] | parameters[2] << 8), status,
                      parameters + (length >= 4 ? 4 : 3), length >= 4 ? length - 4 : 0, now_us);
    } else if (code == EVENT_COMMAND_STATUS && length >= 4) {
        on_completion(adapter, (uint16_t)(parameters[2] | parameters[3] << 8), parameters[0],
                      parameters + length, 0, now_us);
    } else if (code == EVENT_HARDWARE_ERROR) {
        close_and_retry(adapter, RADIO_LOST, "the controller reported a hardware error", now_us);
    }
}

/* ---- opening ---- */

static enum radio_state state_of_error(int error)
{
    switch (error) {
    case -ERFKILL:
        return RADIO_BLOCKED;
    case -EAGAIN:
        return RADIO_DOWN;
    default:
        return RADIO_ABSENT;
    }
}

static void open_adapter(struct adapter *adapter, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];
    bool hard;
    int result;

    if (!hci_is_open(&adapter->hci)) {
        result = hci_open(&adapter->hci, adapter->name, on_event, on_lost, adapter);
        if (result < 0 && !adapter->hci.h4 && rfkill_blocked(RFKILL_BLUETOOTH, &hard)) {
            result = -ERFKILL;
        }
        if (result < 0) {
            snprintf(detail, sizeof(detail), "%s: %s", adapter->name,
                     result == -EAGAIN ? "down, asked to power up" : strerror(-result));
            close_and_retry(adapter, state_of_error(result), detail, now_us);
            return;
        }
    }
    adapter->step = STEP_RESET;
    adapter->repair = false;
    adapter->slow = false;
    enter(adapter, RADIO_STARTING, adapter->name, now_us);
    advance(adapter, now_us);
}

/* The one timer: an answer that didn't come, a repair that had to wait, or time to try again. */
static void on_timer(void *context, int64_t now_us)
{
    struct adapter *adapter = context;

    if (adapter->awaited != 0) {
        on_lost(adapter, -ETIMEDOUT, now_us);
    } else if (hci_is_open(&adapter->hci)) {
        advance(adapter, now_us);
    } else {
        open_adapter(adapter, now_us);
    }
}

/* ---- the outside ---- */

static void make_address(void)
{
    char boot_id[64] = "";
    int fd = open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);

    if (fd < 0 || read(fd, boot_id, sizeof(boot_id) - 1) <= 0) {
        log_warning("can't read the kernel's boot id: the Bluetooth address isn't random");
    }
    if (fd >= 0) {
        close(fd);
    }
    bluetooth_static_address(boot_id, self.address);
}

static void add_set(struct adapter *adapter, enum bluetooth_set which, struct radio *radio)
{
    adapter->sets[which].radio = radio;
    adapter->sets[which].channel = which == BLUETOOTH_LEGACY ? CHANNEL_BT4 : CHANNEL_BT5;
}

static struct adapter *add_adapter(const char *name)
{
    struct adapter *adapter = &self.adapters[self.count++];

    adapter->name = name;
    adapter->hci.watch.fd = -1;
    adapter->repair_logged_us = INT64_MIN / 2;
    loop_timer_init(&adapter->timer, on_timer, adapter);
    return adapter;
}

void bluetooth_start(const struct config *config, struct radio *bt4, struct radio *bt5,
                     int64_t now_us)
{
    bool two = config->bt5_adapter[0] != '\0' && strcmp(config->bt5_adapter, config->bt_adapter);
    struct adapter *first = NULL;

    self.count = 0;
    make_address();
    radio_init(bt4, config->bt4_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    radio_init(bt5, config->bt5_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    if (config->bt4_enabled) {
        first = add_adapter(config->bt_adapter);
        add_set(first, BLUETOOTH_LEGACY, bt4);
    }
    if (config->bt5_enabled) {
        struct adapter *second = first != NULL && !two
                                     ? first
                                     : add_adapter(two ? config->bt5_adapter : config->bt_adapter);

        add_set(second, BLUETOOTH_LONG_RANGE, bt5);
    }
    for (unsigned i = 0; i < self.count; i++) {
        open_adapter(&self.adapters[i], now_us);
    }
}

static void set_payload(enum bluetooth_set which, const uint8_t *data, size_t length,
                        int64_t now_us)
{
    for (unsigned i = 0; i < self.count; i++) {
        struct set *set = &self.adapters[i].sets[which];

        if (set->radio != NULL && length <= sizeof(set->payload)) {
            memcpy(set->payload, data, length);
            set->length = length;
            set->pending = true;
            advance(&self.adapters[i], now_us);
        }
    }
}

void bluetooth_set_legacy(const uint8_t data[MESSAGES_LEGACY_SIZE], int64_t now_us)
{
    set_payload(BLUETOOTH_LEGACY, data, MESSAGES_LEGACY_SIZE, now_us);
}

void bluetooth_set_extended(const uint8_t *data, size_t length, int64_t now_us)
{
    set_payload(BLUETOOTH_LONG_RANGE, data, length, now_us);
}

void bluetooth_stop(void)
{
    for (unsigned i = 0; i < self.count; i++) {
        if (hci_is_open(&self.adapters[i].hci)) {
            send_enable(&self.adapters[i], false, loop_now_us());
        }
    }
}
