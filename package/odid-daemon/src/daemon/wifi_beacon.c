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
/* What was refused is tried again after this long; what may do better, at once. */
#define REFUSED_US 250000
/* A fuller pack than what is taken is tried again: first after this long, then half as often each
 * time. */
#define AGAIN_US 10000000
#define AGAIN_MAX_US 600000000

#define SET_REQUEST "SET vendor_elements "

/* What the awaited reply answers. */
enum request {
    REQUEST_NONE,
    REQUEST_STATUS,
    REQUEST_SET,
    REQUEST_UPDATE,
    REQUEST_CLEAR_SET,
    REQUEST_CLEAR_UPDATE,
};

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
    unsigned refusals;  /* running */
    bool refused;       /* and it isn't known yet whether the interface is up */
    bool to_clear;      /* the driver's idea of what is in the beacon may be wrong */
    unsigned most;      /* messages in an element */
    unsigned taken;     /* so many were taken, and more is being tried; 0: no trial */
    unsigned given;     /* in the element that hostapd was given last */
    int64_t again_us, again_wait_us;
    size_t length; /* of the element; 0: none was given yet */
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

static unsigned messages_in(size_t length)
{
    return length < MESSAGES_ELEMENT_EMPTY
               ? 0
               : (unsigned)((length - MESSAGES_ELEMENT_EMPTY) / MESSAGE_SIZE);
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
    self.given = messages_in(self.length);
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
    } else if (self.to_clear && self.enabled) {
        request(REQUEST_CLEAR_SET, SET_REQUEST, now_us);
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

/* ---- a chip that refuses ---- */

static void forget_refusals(void)
{
    self.refused = self.to_clear = false;
    self.refusals = self.taken = 0;
    self.most = MESSAGES_PACK_MAX;
    self.again_us = LOOP_NEVER;
    self.again_wait_us = AGAIN_US;
}

static void try_again_later(int64_t now_us)
{
    self.again_us = now_us + self.again_wait_us;
    self.again_wait_us *= self.again_wait_us < AGAIN_MAX_US ? 2 : 1;
}

static bool is_trial(void)
{
    return self.taken != 0 && self.given > self.taken;
}

/* Without Self-ID and Authentication, then what has to be there at least, then one by one. */
static unsigned less_than(unsigned messages)
{
    return messages > 4 ? 4 : messages > 3 ? 3 : 1;
}

/*
 * The interface is up, and refused the element: for its length, or for once.
 * brcmfmac then takes the same element for set already and deletes another one
 * that the chip hasn't got, until what it keeps is cleared. What was refused for
 * once, by a radio that was switched off a moment ago too, is given whole again.
 */
static void take_less(int64_t now_us)
{
    self.to_clear = true;
    if (is_trial()) {
        self.most = self.taken;
    } else if (self.refusals == 1) {
        return;
    } else if (self.given > 1) {
        self.most = less_than(self.given);
    } else {
        self.allowed_us = now_us + REFUSED_US; /* there is nothing less */
        return;
    }
    self.taken = 0;
    try_again_later(now_us);
    if (messages_in(self.length) > self.most) {
        self.length = 0; /* a shorter one takes its place, and its counter */
    }
}

static void try_more(int64_t now_us)
{
    if (is_trial()) {
        self.taken = 0;
        self.again_us = LOOP_NEVER;
        self.again_wait_us = AGAIN_US;
    } else if (now_us >= self.again_us) {
        self.again_us = LOOP_NEVER;
        self.taken = self.most;
        self.most = MESSAGES_PACK_MAX;
    }
}

/* ---- what was answered ---- */

static void take_status(const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE], state[32];
    bool hard, enabled;

    find_state(reply, state);
    enabled = strcmp(state, "ENABLED") == 0;
    if (enabled && self.refused) {
        take_less(now_us);
    }
    self.refused = false;
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

    self.pending = true;
    self.allowed_us = now_us + REFUSED_US;
    self.status_us = now_us; /* most likely its interface went down */
    snprintf(detail, sizeof(detail), "hostapd answered \"%.20s\" to %s", reply, what);
    self.radio->failures++;
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_LOST, detail, now_us);
}

/* The driver's word, or the chip's. */
static void take_refused_update(const char *reply, int64_t now_us)
{
    self.refused = true;
    if (is_trial()) { /* what was taken before is given again at once */
        self.pending = true;
        self.status_us = now_us;
        return;
    }
    take_refusal("UPDATE_BEACON", reply, now_us);
    self.refusals++;
    self.allowed_us = now_us; /* whole once more, or shorter */
}

static void take_success(int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    retry_reset(&self.retry);
    self.refusals = 0;
    self.fresh = self.pending; /* by another one, meanwhile */
    try_more(now_us);
    snprintf(detail, sizeof(detail), "%s, in every beacon%s", self.config->wifi_iface,
             self.most < MESSAGES_PACK_MAX ? ", shortened: the chip refused more" : "");
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
    } else if (answered == REQUEST_CLEAR_SET) {
        request(REQUEST_CLEAR_UPDATE, "UPDATE_BEACON", now_us);
    } else if (answered == REQUEST_CLEAR_UPDATE) {
        self.to_clear = false; /* also by a "FAIL" */
    } else if (!ok && answered == REQUEST_SET) {
        take_refusal("SET vendor_elements", reply, now_us);
    } else if (!ok) {
        take_refused_update(reply, now_us);
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
    forget_refusals(); /* another one may have another chip's driver, and a new start anyway */
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
    forget_refusals();
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

unsigned wifi_beacon_most(void)
{
    return self.most;
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
