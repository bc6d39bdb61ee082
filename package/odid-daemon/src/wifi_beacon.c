#include "wifi_beacon.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "hostapd_control.h"
#include "messages.h"
#include "rfkill.h"

/* How often hostapd is asked whether its interface transmits. */
#define STATUS_EVERY_US 1000000
/* An unchanged element is set again after this long: a reconfigured hostapd has forgotten it. */
#define REFRESH_US 5000000

static const char set_request[] = "SET vendor_elements ";

/* What the awaited reply answers. */
enum request { REQUEST_NONE, REQUEST_STATUS, REQUEST_SET, REQUEST_UPDATE };

static struct {
    const struct config *config;
    struct radio *radio;
    struct hostapd_control control;
    struct loop_timer retry_timer;
    struct retry retry;
    enum request request;
    bool enabled;      /* hostapd's interface transmits, as far as it knows */
    bool pending;      /* a newer element than hostapd has */
    int64_t status_us; /* when it was asked last */
    int64_t set_us;    /* when the element was given last */
    size_t length;     /* of the element; 0: none was given yet */
    uint8_t element[MESSAGES_ELEMENT_SIZE];
} self;

static void lost(enum radio_state state, const char *what, int error, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];
    bool hard;

    if (rfkill_blocked(RFKILL_WLAN, &hard)) {
        state = RADIO_BLOCKED;
    }
    snprintf(detail, sizeof(detail), "%s: %s", what, strerror(-error));
    self.radio->failures++;
    self.request = REQUEST_NONE;
    self.enabled = false;
    hostapd_control_close(&self.control);
    radio_enter(self.radio, CHANNEL_WIFI, state, detail, now_us);
    loop_arm(&self.retry_timer, retry_next(&self.retry, now_us));
}

static void on_lost(void *context, int error, int64_t now_us)
{
    (void)context;
    lost(RADIO_LOST, error == -ETIMEDOUT ? "hostapd doesn't answer" : "hostapd is gone", error,
         now_us);
}

static void request(enum request kind, const char *text, int64_t now_us)
{
    int result = hostapd_control_request(&self.control, text, now_us);

    if (result < 0) {
        on_lost(NULL, result, now_us);
        return;
    }
    self.request = kind;
}

static void send_element(int64_t now_us)
{
    char text[sizeof(set_request) + 2 * MESSAGES_ELEMENT_SIZE];
    char *end = text + sizeof(set_request) - 1;

    memcpy(text, set_request, sizeof(set_request));
    for (size_t i = 0; i < self.length; i++) {
        end += snprintf(end, 3, "%02x", self.element[i]);
    }
    self.pending = false;
    self.set_us = now_us;
    request(REQUEST_SET, text, now_us);
}

/* Sends what is due next, unless a reply is awaited. */
static void advance(int64_t now_us)
{
    if (self.control.watch.fd < 0 || self.request != REQUEST_NONE) {
        return;
    }
    if (now_us - self.status_us >= STATUS_EVERY_US) {
        self.status_us = now_us;
        request(REQUEST_STATUS, "STATUS", now_us);
    } else if (self.enabled && self.length > 0 &&
               (self.pending || now_us - self.set_us >= REFRESH_US)) {
        send_element(now_us);
    }
}

static void take_status(const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];
    const char *state = strstr(reply, "state=");
    bool hard, enabled = state != NULL && strncmp(state, "state=ENABLED\n", 14) == 0;

    if (enabled) {
        self.pending = self.pending || !self.enabled; /* it may have forgotten */
    } else {
        snprintf(detail, sizeof(detail), "hostapd's interface: %.*s",
                 state == NULL ? 7 : (int)strcspn(state + 6, "\n"),
                 state == NULL ? "unknown" : state + 6);
        radio_enter(self.radio, CHANNEL_WIFI,
                    rfkill_blocked(RFKILL_WLAN, &hard) ? RADIO_BLOCKED : RADIO_DOWN, detail,
                    now_us);
    }
    self.enabled = enabled;
}

static void take_refusal(const char *what, const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    snprintf(detail, sizeof(detail), "hostapd answered \"%.20s\" to %s", reply, what);
    self.radio->failures++;
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_LOST, detail, now_us);
}

static void take_update(const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    if (strcmp(reply, "OK") != 0) {
        take_refusal("UPDATE_BEACON", reply, now_us);
        return;
    }
    retry_reset(&self.retry);
    if (self.radio->state != RADIO_ON_AIR) {
        snprintf(detail, sizeof(detail), "%s, in every beacon", self.config->wifi_iface);
        radio_enter(self.radio, CHANNEL_WIFI, RADIO_ON_AIR, detail, now_us);
    }
    radio_accepted(self.radio, CHANNEL_WIFI, now_us);
}

static void on_reply(void *context, const char *reply, int64_t now_us)
{
    enum request answered = self.request;

    (void)context;
    self.request = REQUEST_NONE;
    switch (answered) {
    case REQUEST_STATUS:
        take_status(reply, now_us);
        break;
    case REQUEST_SET:
        if (strcmp(reply, "OK") == 0) {
            request(REQUEST_UPDATE, "UPDATE_BEACON", now_us); /* without it nothing changes */
            return;
        }
        take_refusal("SET vendor_elements", reply, now_us);
        break;
    case REQUEST_UPDATE:
        take_update(reply, now_us);
        break;
    case REQUEST_NONE:
        break;
    }
    advance(now_us);
}

static void open_control(void *context, int64_t now_us)
{
    int result;

    (void)context;
    result = hostapd_control_open(&self.control, self.config->hostapd_dir, self.config->wifi_iface,
                                  self.config->run_dir);
    if (result < 0) {
        lost(RADIO_ABSENT, "hostapd's control socket", result, now_us);
        return;
    }
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_STARTING, "hostapd answers", now_us);
    self.pending = self.length > 0;
    self.status_us = now_us - STATUS_EVERY_US;
    advance(now_us);
}

void wifi_beacon_start(const struct config *config, struct radio *radio, int64_t now_us)
{
    memset(&self, 0, sizeof(self));
    self.config = config;
    self.radio = radio;
    hostapd_control_init(&self.control, on_reply, on_lost, NULL);
    loop_timer_init(&self.retry_timer, open_control, NULL);
    radio_init(radio, config->wifi_beacon_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    if (config->wifi_beacon_enabled) {
        open_control(NULL, now_us);
    }
}

void wifi_beacon_set(const uint8_t *element, size_t length, int64_t now_us)
{
    if (length > sizeof(self.element) || self.radio->state == RADIO_DISABLED) {
        return;
    }
    if (length != self.length || memcmp(element, self.element, length) != 0) {
        memcpy(self.element, element, length);
        self.length = length;
        self.pending = true;
    }
    advance(now_us); /* called every slot: also what keeps the questions going */
}
