#include "keeper/keeper_air.h"

#include <errno.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>

#include "base/loop.h"
#include "radio/bluetooth_commands.h"
#include "radio/hci.h"
#include "radio/hostapd_control.h"

#define ANSWER_US 1000000
#define EVENT_COMMAND_COMPLETE 0x0E
#define EVENT_COMMAND_STATUS 0x0F

/* hostapd's orders, one after the other. */
static const char *const orders[] = {"SET vendor_elements ", "UPDATE_BEACON"};
#define ORDERS (sizeof(orders) / sizeof(orders[0]))

struct adapter {
    const char *name;
    struct hci hci;
    struct loop_timer timeout;
    uint16_t opcode; /* of the command whose answer is awaited */
    bool legacy_off; /* the legacy command has switched it off */
    bool known;      /* hci and timeout are initialised */
};

static struct {
    struct keeper_air_plan plan;
    struct adapter adapters[KEEPER_AIR_ADAPTERS];
    struct hostapd_control control;
    bool control_known;
    unsigned order;
    unsigned pending; /* radios whose end isn't known yet; 0: nothing is going on */
    keeper_air_done_fn *done;
    void *context;
    char off[KEEPER_AIR_RESULT_SIZE], left[KEEPER_AIR_RESULT_SIZE];
} self;

/* ---- results ---- */

/* reason NULL: it carries nothing more. */
static void note(const char *name, const char *reason)
{
    char *list = reason == NULL ? self.off : self.left;
    size_t length = strlen(list);
    const char *comma = length > 0 ? ", " : "";

    if (reason == NULL) {
        snprintf(list + length, KEEPER_AIR_RESULT_SIZE - length, "%s%s", comma, name);
    } else {
        snprintf(list + length, KEEPER_AIR_RESULT_SIZE - length, "%s%s (%s)", comma, name, reason);
    }
}

static void one_is_done(int64_t now_us)
{
    if (--self.pending == 0) {
        self.done(self.context, self.off, self.left, now_us);
    }
}

/* ---- Bluetooth ---- */

static void close_adapter(struct adapter *adapter)
{
    if (adapter->known) {
        hci_close(&adapter->hci);
        loop_arm(&adapter->timeout, LOOP_NEVER);
    }
}

static void end_adapter(struct adapter *adapter, const char *reason, int64_t now_us)
{
    close_adapter(adapter);
    note(adapter->name, reason);
    one_is_done(now_us);
}

static void on_hci_lost(void *context, int error, int64_t now_us)
{
    end_adapter(context, strerror(-error), now_us);
}

static void on_hci_timeout(void *context, int64_t now_us)
{
    end_adapter(context, "no answer", now_us);
}

static void command(struct adapter *adapter, uint16_t opcode, int64_t now_us)
{
    const bool none[BLUETOOTH_SETS] = {false};
    uint8_t parameters[HCI_PARAMETERS_MAX] = {0}; /* legacy: one byte, off */
    size_t length =
        opcode == BLUETOOTH_SET_ENABLE ? 1 : bluetooth_extended_enable(none, parameters);
    int result = hci_command(&adapter->hci, opcode, parameters, (uint8_t)length);

    if (result < 0) {
        end_adapter(adapter, strerror(-result), now_us);
        return;
    }
    adapter->opcode = opcode;
    loop_arm(&adapter->timeout, now_us + ANSWER_US);
}

static void take_answer(struct adapter *adapter, uint8_t status, int64_t now_us)
{
    char reason[48];

    if (adapter->opcode == BLUETOOTH_SET_ENABLE) {
        /* Disallowed where extended commands were used; then those do it. Not every controller
         * keeps to that: both are sent. */
        adapter->legacy_off = status == BLUETOOTH_SUCCESS;
        command(adapter, BLUETOOTH_SET_EXTENDED_ENABLE, now_us);
    } else if (status == BLUETOOTH_SUCCESS || adapter->legacy_off) {
        end_adapter(adapter, NULL, now_us);
    } else {
        snprintf(reason, sizeof(reason), "refused with status 0x%02x", status);
        end_adapter(adapter, reason, now_us);
    }
}

/* Events, Bluetooth Core Vol 4 Part E 7.7.14 and 7.7.15. */
static void on_event(void *context, uint8_t code, const uint8_t *p, size_t length, int64_t now_us)
{
    struct adapter *adapter = context;

    if (code == EVENT_COMMAND_COMPLETE && length >= 4 && (p[1] | p[2] << 8) == adapter->opcode) {
        take_answer(adapter, p[3], now_us);
    } else if (code == EVENT_COMMAND_STATUS && length >= 4 && p[0] != BLUETOOTH_SUCCESS &&
               (p[2] | p[3] << 8) == adapter->opcode) {
        take_answer(adapter, p[0], now_us);
    }
}

/* One that isn't there, is blocked or down carries nothing; nor is there one without a driver. */
static bool says_silent(int error)
{
    return error == -ENODEV || error == -ENOENT || error == -ERFKILL || error == -EAGAIN ||
           error == -EINPROGRESS || error == -ENETDOWN || error == -EAFNOSUPPORT;
}

static void start_adapter(struct adapter *adapter, const char *name, bool unreachable,
                          int64_t now_us)
{
    int result;

    adapter->name = name;
    if (unreachable) {
        end_adapter(adapter, "only the daemon can talk to it", now_us);
        return;
    }
    adapter->known = true;
    adapter->hci.watch.fd = -1;
    loop_timer_init(&adapter->timeout, on_hci_timeout, adapter);
    result = hci_open(&adapter->hci, name, on_event, on_hci_lost, adapter);
    if (result < 0) {
        end_adapter(adapter, says_silent(result) ? NULL : strerror(-result), now_us);
        return;
    }
    command(adapter, BLUETOOTH_SET_ENABLE, now_us);
}

/* ---- Wi-Fi ---- */

static void end_wifi(const char *reason, int64_t now_us)
{
    hostapd_control_close(&self.control);
    note(self.plan.iface, reason);
    one_is_done(now_us);
}

static const char *what_error(int error)
{
    switch (error) {
    case -ETIMEDOUT:
        return "hostapd gives no answer";
    case HOSTAPD_PASSED:
        return "hostapd passed descriptors, and is left alone";
    default:
        return strerror(-error);
    }
}

static void on_hostapd_lost(void *context, int error, int64_t now_us)
{
    (void)context;
    end_wifi(what_error(error), now_us);
}

static void next_order(int64_t now_us)
{
    int result = hostapd_control_request(&self.control, orders[self.order], now_us);

    if (result < 0) {
        end_wifi(what_error(result), now_us);
    }
}

static void on_reply(void *context, const char *reply, int64_t now_us)
{
    char reason[64];

    (void)context;
    if (strcmp(reply, "OK") != 0) {
        snprintf(reason, sizeof(reason), "hostapd refused with \"%.20s\"", reply);
        end_wifi(reason, now_us);
    } else if (++self.order < ORDERS) {
        next_order(now_us);
    } else {
        end_wifi(NULL, now_us);
    }
}

static void start_wifi(int64_t now_us)
{
    int result;

    self.order = 0;
    if (!self.control_known) { /* it remembers whom it leaves alone */
        hostapd_control_init(&self.control, on_reply, on_hostapd_lost, NULL);
        self.control_known = true;
    }
    result = hostapd_control_open(&self.control, self.plan.hostapd_dir, self.plan.iface);
    if (result == -ENOENT || result == -ECONNREFUSED) {
        /* The kernel may go on without it, with the last beacon. */
        end_wifi(if_nametoindex(self.plan.iface) == 0 ? NULL : "hostapd does not run", now_us);
    } else if (result < 0) {
        end_wifi(what_error(result), now_us);
    } else {
        next_order(now_us);
    }
}

/* ---- all of them ---- */

static void plan_adapter(struct keeper_air_plan *plan, unsigned i, const char *name)
{
    snprintf(plan->adapter[i], sizeof(plan->adapter[i]), "%s", name);
    /* Two that read from one serial port take each other's events away. */
    plan->unreachable[i] = strncmp(name, "h4:", 3) == 0;
}

void keeper_air_plan(struct keeper_air_plan *plan, const struct config *config)
{
    const char *long_range = config->bt5_adapter[0] ? config->bt5_adapter : config->bt_adapter;

    memset(plan, 0, sizeof(*plan));
    if (config->bt4_enabled) {
        plan_adapter(plan, 0, config->bt_adapter);
    }
    if (config->bt5_enabled && strcmp(plan->adapter[0], long_range) != 0) {
        plan_adapter(plan, 1, long_range);
    }
    if (config->wifi_beacon_enabled) {
        snprintf(plan->hostapd_dir, sizeof(plan->hostapd_dir), "%s", config->hostapd_dir);
        snprintf(plan->iface, sizeof(plan->iface), "%s", config->wifi_iface);
    }
}

void keeper_air_start(const struct keeper_air_plan *plan, keeper_air_done_fn *done, void *context,
                      int64_t now_us)
{
    keeper_air_stop();
    self.plan = *plan;
    self.done = done;
    self.context = context;
    self.off[0] = self.left[0] = '\0';
    self.pending = 1; /* ourselves, until all were begun */
    for (unsigned i = 0; i < KEEPER_AIR_ADAPTERS; i++) {
        if (self.plan.adapter[i][0] != '\0') {
            self.pending++;
            start_adapter(&self.adapters[i], self.plan.adapter[i], self.plan.unreachable[i],
                          now_us);
        }
    }
    if (self.plan.iface[0] != '\0') {
        self.pending++;
        start_wifi(now_us);
    }
    one_is_done(now_us);
}

void keeper_air_stop(void)
{
    for (unsigned i = 0; i < KEEPER_AIR_ADAPTERS; i++) {
        close_adapter(&self.adapters[i]);
    }
    if (self.control_known) {
        hostapd_control_close(&self.control);
    }
    self.pending = 0;
}
