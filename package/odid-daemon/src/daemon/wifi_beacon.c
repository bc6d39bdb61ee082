#include "daemon/wifi_beacon.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "daemon/messages.h"
#include "radio/hostapd_control.h"
#include "radio/rfkill.h"

/* How often hostapd is asked whether its interface transmits. */
#define STATUS_EVERY_US 1000000
#define STATUS_SOON_US 200000 /* while it isn't enabled: it is about to be, at boot */
/* An unchanged element is set again after this long: a reconfigured hostapd has forgotten it. */
#define REFRESH_US 5000000
/* What hostapd refused is tried again after this long. */
#define REFUSED_US 250000

#define SET_REQUEST "SET vendor_elements "

/* What the awaited reply answers. */
enum request { REQUEST_NONE, REQUEST_STATUS, REQUEST_SET, REQUEST_UPDATE };

static struct {
    const struct config *config;
    struct radio *radio;
    struct hostapd_control control;
    struct loop_timer timer; /* closed: the next try; open: the next question */
    struct retry retry;
    enum request request;
    bool enabled;       /* hostapd's interface transmits, as far as it knows */
    bool pending;       /* to be given to hostapd: it is newer, or may have been forgotten */
    bool fresh;         /* was in no beacon yet */
    int64_t status_us;  /* when to ask for the status next */
    int64_t refresh_us; /* when to give the element again, although it is the same */
    int64_t allowed_us; /* no element before this */
    size_t length;      /* of the element; 0: none was given yet */
    uint8_t element[MESSAGES_ELEMENT_SIZE];
} self;

static void close_and_retry(enum radio_state state, const char *what, int error, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];
    bool hard;

    snprintf(detail, sizeof(detail), "%s: %s", what,
             error == HOSTAPD_PASSED ? "it passed descriptors" : strerror(-error));
    self.request = REQUEST_NONE;
    hostapd_control_close(&self.control);
    radio_enter(self.radio, CHANNEL_WIFI,
                rfkill_blocked(RFKILL_WLAN, &hard) ? RADIO_BLOCKED : state, detail, now_us);
    loop_arm(&self.timer, retry_next(&self.retry, now_us));
}

static const char *what_is_lost(int error)
{
    switch (error) {
    case -ETIMEDOUT:
        return "hostapd doesn't answer";
    case HOSTAPD_PASSED:
        return "hostapd is left alone";
    default:
        return "hostapd is gone";
    }
}

static void on_lost(void *context, int error, int64_t now_us)
{
    (void)context;
    self.radio->failures++;
    close_and_retry(RADIO_LOST, what_is_lost(error), error, now_us);
}

/* ---- requests ---- */

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
    static const char digits[] = "0123456789abcdef";
    char text[sizeof(SET_REQUEST) + 2 * MESSAGES_ELEMENT_SIZE] = SET_REQUEST;
    char *end = text + strlen(SET_REQUEST);

    for (size_t i = 0; i < self.length; i++) {
        *end++ = digits[self.element[i] >> 4];
        *end++ = digits[self.element[i] & 0x0F];
    }
    *end = '\0';
    self.pending = false;
    self.refresh_us = now_us + REFRESH_US;
    request(REQUEST_SET, text, now_us);
}

/* When the element is due; LOOP_NEVER when there is nothing to give, or nobody to take it. */
static int64_t element_due_us(void)
{
    int64_t due_us = self.pending ? self.allowed_us : self.refresh_us;

    if (!self.enabled || self.length == 0) {
        return LOOP_NEVER;
    }
    return due_us > self.allowed_us ? due_us : self.allowed_us;
}

/* Sends what is due next, unless a reply is awaited. */
static void advance(int64_t now_us)
{
    int64_t element_us = element_due_us();

    if (self.control.watch.fd < 0 || self.request != REQUEST_NONE) {
        return;
    }
    if (now_us >= self.status_us) {
        self.status_us = now_us + (self.enabled ? STATUS_EVERY_US : STATUS_SOON_US);
        request(REQUEST_STATUS, "STATUS", now_us);
    } else if (now_us >= element_us) {
        send_element(now_us);
    } else {
        loop_arm(&self.timer, element_us < self.status_us ? element_us : self.status_us);
    }
}

/* ---- replies ---- */

/* The value of "state=" in a STATUS reply, which is lines of key=value; "" when there is none. */
static void find_state(const char *reply, char value[32])
{
    static const char key[] = "state=";
    size_t length;

    value[0] = '\0';
    while (*reply != '\0') {
        length = strcspn(reply, "\n");
        if (strncmp(reply, key, strlen(key)) == 0) {
            snprintf(value, 32, "%.*s", (int)(length - strlen(key)), reply + strlen(key));
            return;
        }
        reply += length + (reply[length] == '\n');
    }
}

static void take_status(const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE], state[32];
    bool hard, enabled;

    find_state(reply, state);
    enabled = strcmp(state, "ENABLED") == 0;
    if (enabled) {
        self.pending = self.pending || !self.enabled; /* it may have forgotten */
        if (!self.pending && self.radio->state == RADIO_ON_AIR) {
            radio_confirmed(self.radio, now_us); /* unchanged content is not given again */
        }
    } else {
        snprintf(detail, sizeof(detail), "hostapd's state of %s: %s", self.config->wifi_iface,
                 state[0] != '\0' ? state : "unknown");
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
    self.pending = true;
    self.allowed_us = now_us + REFUSED_US;
    self.status_us = now_us; /* most likely its interface went down */
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_LOST, detail, now_us);
}

static void take_success(int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    retry_reset(&self.retry);
    self.fresh = self.pending; /* by another one, meanwhile */
    snprintf(detail, sizeof(detail), "%s, in every beacon", self.config->wifi_iface);
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_ON_AIR, detail, now_us);
    if (radio_accepted(self.radio, CHANNEL_WIFI, now_us) || !self.pending) {
        radio_confirmed(self.radio, now_us);
    }
}

static void on_reply(void *context, const char *reply, int64_t now_us)
{
    enum request answered = self.request;
    bool ok = strcmp(reply, "OK") == 0;

    (void)context;
    self.request = REQUEST_NONE;
    if (answered == REQUEST_STATUS) {
        take_status(reply, now_us);
    } else if (!ok) {
        take_refusal(answered == REQUEST_SET ? "SET vendor_elements" : "UPDATE_BEACON", reply,
                     now_us);
    } else if (answered == REQUEST_SET) {
        request(REQUEST_UPDATE, "UPDATE_BEACON", now_us); /* without it nothing changes */
    } else {
        take_success(now_us);
    }
    advance(now_us);
}

/* ---- start ---- */

static void open_control(int64_t now_us)
{
    int result =
        hostapd_control_open(&self.control, self.config->hostapd_dir, self.config->wifi_iface);

    if (result == HOSTAPD_PASSED) {
        close_and_retry(RADIO_LOST, what_is_lost(result), result, now_us);
        return;
    }
    if (result < 0) {
        close_and_retry(RADIO_ABSENT, "hostapd's control socket", result, now_us);
        return;
    }
    if (self.radio->state != RADIO_LOST) { /* a hanging one would go to and fro */
        radio_enter(self.radio, CHANNEL_WIFI, RADIO_STARTING, "hostapd is there", now_us);
    }
    self.request = REQUEST_NONE;
    self.enabled = false;
    self.status_us = self.allowed_us = now_us;
    advance(now_us);
}

static void on_timer(void *context, int64_t now_us)
{
    (void)context;
    if (self.control.watch.fd < 0) {
        open_control(now_us);
    } else {
        advance(now_us);
    }
}

void wifi_beacon_start(const struct config *config, struct radio *radio, int64_t now_us)
{
    self.config = config;
    self.radio = radio;
    hostapd_control_init(&self.control, on_reply, on_lost, NULL);
    loop_timer_init(&self.timer, on_timer, NULL);
    radio_init(radio, config->wifi_beacon_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    if (config->wifi_beacon_enabled) {
        open_control(now_us);
    }
}

void wifi_beacon_set(const uint8_t *element, size_t length, int64_t now_us)
{
    if (length > sizeof(self.element) || self.radio->state == RADIO_DISABLED) {
        return;
    }
    if (length != self.length || memcmp(element, self.element, length) != 0) {
        if (wifi_beacon_waits()) {
            radio_replaced(self.radio);
        }
        memcpy(self.element, element, length);
        self.length = length;
        self.pending = self.fresh = true;
    }
    advance(now_us);
}

bool wifi_beacon_waits(void)
{
    return self.pending && self.fresh;
}

void wifi_beacon_stop(void)
{
    hostapd_control_tell(&self.control, "SET vendor_elements ");
    hostapd_control_tell(&self.control, "UPDATE_BEACON");
    hostapd_control_close(&self.control);
    loop_arm(&self.timer, LOOP_NEVER);
}
