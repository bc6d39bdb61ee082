#include "daemon/wifi_beacon.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "daemon/beacon_room.h"
#include "daemon/messages.h"
#include "radio/beacon_evidence.h"
#include "radio/hostapd_control.h"
#include "radio/rfkill.h"

/* How often hostapd is asked whether its interface transmits. */
#define STATUS_EVERY_US 1000000
#define STATUS_SOON_US 200000 /* while it isn't enabled: it is about to be, at boot */
/* An unchanged element is set again after this long: a reconfigured hostapd has forgotten it. */
#define REFRESH_US 5000000
/* What was refused is tried again after this long; what may do better, at once. */
#define REFUSED_US 250000
/* An interface that is switched off and on takes hostapd, and its chip, so long at most. */
#define SWITCH_US 5000000
/* One that is off is switched on after this long, and again and again: that may have failed. */
#define OFF_US 1000000
#define ENABLE_EVERY_US 5000000
/* What brings a silent chip back is tried again after so long: by then its driver was bound anew.
 */
#define SILENT_AGAIN_US 10000000
/* Meanwhile it is looked so often whether it sends again. */
#define SOON_US 100000

#define SET_REQUEST "SET vendor_elements "

/* What the awaited reply answers. */
enum request {
    REQUEST_NONE,
    REQUEST_STATUS,
    REQUEST_SET,
    REQUEST_UPDATE,
    REQUEST_BACK_SET,
    REQUEST_BACK_UPDATE,
    REQUEST_CLEAR_SET,
    REQUEST_CLEAR_UPDATE,
    REQUEST_DISABLE,
    REQUEST_ENABLE,
};

/* Hostapd said OK, and no beacon went out: what was tried last against that. */
enum remedy {
    REMEDY_NONE,
    REMEDY_SET_ANEW,
    REMEDY_OFF_AND_ON, /* the interface */
    REMEDY_DRIVER,     /* to be bound anew, by whoever may: see radio_stuck */
};

struct element {
    size_t length; /* 0: none */
    uint8_t octets[MESSAGES_ELEMENT_SIZE];
};

static struct {
    const struct config *config;
    struct radio *radio;
    struct hostapd_control control;
    struct loop_timer timer; /* closed: the next try; open: the next question */
    struct loop_timer look;  /* at the evidence */
    struct beacon_evidence evidence;
    struct beacon_room room;
    struct element newest, given, taken; /* given to hostapd last; taken by the chip last */
    struct element unanswered; /* given when the connection went, or before that; not known since */
    bool known;                /* what the chip has: what it took last, or nothing */
    struct retry retry;
    enum request request;
    bool enabled;       /* hostapd's interface transmits, as far as it knows */
    bool pending;       /* to be given to hostapd: it is newer, or may have been forgotten */
    bool fresh;         /* was given to nobody yet, or was refused: it is in no beacon */
    bool given_fresh;   /* what was given is in none, unless hostapd takes it */
    int64_t status_us;  /* when to ask for the status next */
    int64_t refresh_us; /* when to give the element again, although it is the same */
    int64_t allowed_us; /* no element before this */
    bool refused;       /* and it isn't known yet whether the interface is up */
    bool to_clear;      /* the driver's idea of what is in the beacon may be wrong */
    bool to_switch;     /* the interface, off and on */
    int64_t enable_us;  /* when it is to be switched on; LOOP_NEVER: it isn't off */
    enum remedy remedy;
    int64_t expected_us; /* beacons with the element, from then on */
} self;

static bool is_blocked(void)
{
    bool hard;

    return rfkill_blocked(RFKILL_WLAN, &hard);
}

/* Whoever is switched off waits rightly. */
static enum radio_state unless_blocked(enum radio_state state)
{
    return is_blocked() ? RADIO_BLOCKED : state;
}

static void close_and_retry(enum radio_state state, const char *what, int error, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE];

    snprintf(detail, sizeof(detail), "%s: %s", what,
             error == HOSTAPD_PASSED ? "it passed descriptors" : strerror(-error));
    self.request = REQUEST_NONE;
    self.radio->silent = false;
    self.enabled = false; /* of nobody beacons are to be expected */
    hostapd_control_close(&self.control);
    radio_enter(self.radio, CHANNEL_WIFI, unless_blocked(state), detail, now_us);
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

static unsigned messages_in(const struct element *element)
{
    return element->length < MESSAGES_ELEMENT_EMPTY
               ? 0
               : (unsigned)((element->length - MESSAGES_ELEMENT_EMPTY) / MESSAGE_SIZE);
}

static void request_set(enum request kind, const struct element *element, int64_t now_us)
{
    static const char digits[] = "0123456789abcdef";
    char text[sizeof(SET_REQUEST) + 2 * MESSAGES_ELEMENT_SIZE] = SET_REQUEST;
    char *end = text + strlen(SET_REQUEST);

    for (size_t i = 0; i < element->length; i++) {
        *end++ = digits[element->octets[i] >> 4];
        *end++ = digits[element->octets[i] & 0x0F];
    }
    *end = '\0';
    request(kind, text, now_us);
}

static void send_element(int64_t now_us)
{
    self.pending = false;
    self.given_fresh = self.fresh;
    self.fresh = false; /* it may be in a beacon before the answer is here */
    self.given = self.newest;
    self.refresh_us = now_us + REFRESH_US;
    request_set(REQUEST_SET, &self.given, now_us);
}

static void clear(int64_t now_us)
{
    static const struct element none;

    self.taken.length = 0;
    request_set(REQUEST_CLEAR_SET, &none, now_us);
}

static void switch_interface(enum request kind, const char *text, int64_t now_us)
{
    request(kind, text, now_us);
    hostapd_control_wait(&self.control, now_us + SWITCH_US);
}

/* When the element is due; LOOP_NEVER when there is nothing to give, or nobody to take it. */
static int64_t element_due_us(void)
{
    int64_t due_us = self.pending ? self.allowed_us : self.refresh_us;

    if (!self.enabled || self.newest.length == 0) {
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
    if (self.to_switch) {
        self.to_switch = self.enabled = false;
        switch_interface(REQUEST_DISABLE, "DISABLE", now_us);
    } else if (now_us >= self.enable_us) {
        self.enable_us = now_us + ENABLE_EVERY_US;
        switch_interface(REQUEST_ENABLE, "ENABLE", now_us);
    } else if (now_us >= self.status_us) {
        self.status_us = now_us + (self.enabled ? STATUS_EVERY_US : STATUS_SOON_US);
        request(REQUEST_STATUS, "STATUS", now_us);
    } else if (self.to_clear && self.enabled && self.taken.length > 0) {
        request_set(REQUEST_BACK_SET, &self.taken, now_us);
    } else if (self.to_clear && self.enabled) {
        clear(now_us);
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

/* Another hostapd may have another chip's driver, and a new start anyway. But the chip may be the
 * same one, with an element of before in its beacons. */
static void begin_anew(void)
{
    self.refused = self.to_clear = false;
    if (self.known) {
        self.unanswered = self.given;
    }
    self.known = false;
    self.taken.length = 0;
    beacon_room_forget(&self.room);
}

static bool is_same(const struct element *a, const struct element *b)
{
    return a->length == b->length && memcmp(a->octets, b->octets, a->length) == 0;
}

/*
 * The interface is up, and refused the element: for its length, or for once. brcmfmac takes it for
 * set all the same, and deletes it before it sets another one: which the chip, that hasn't got it,
 * refuses as well. What the chip may still have, and would send beside all others from now on, is
 * what it took last. Given back that one, the driver is right about the chip, which refuses; and
 * once that is cleared the chip has none. Where nobody knows which one it took last, the interface
 * is switched off and on: then neither has any.
 */
static void take_less(int64_t now_us)
{
    bool more = beacon_room_refused(&self.room, messages_in(&self.given), now_us);

    self.to_clear = self.known;
    self.to_switch = !self.known;
    /* What is given whole once more is so when the cause may be over. */
    self.allowed_us = now_us + (more && self.room.refusals != 1 ? 0 : REFUSED_US);
    if (messages_in(&self.newest) > self.room.most) {
        self.newest.length = 0; /* a shorter one takes its place, and its counter */
    }
}

/* ---- a chip that sends nothing ---- */

static void enter_on_air(int64_t now_us)
{
    static const char *const by_whom[] = {
        [RADIO_SET] = "",
        [RADIO_COUNTED] = "; the chip counts them",
        [RADIO_HEARD] = "; another radio hears them",
    };
    char detail[RADIO_DETAIL_SIZE];

    self.radio->silent = false;
    snprintf(detail, sizeof(detail), "%s, in every beacon%s%s", self.config->wifi_iface,
             self.room.most < MESSAGES_PACK_MAX ? ", shortened: the chip refused more" : "",
             by_whom[self.radio->known]);
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_ON_AIR, detail, now_us);
}

static void lose_beacons(enum beacon_verdict verdict, int64_t now_us)
{
    static const char *const tried[] = {
        [REMEDY_SET_ANEW] = "it is told again",
        [REMEDY_OFF_AND_ON] = "it is switched off and on",
        [REMEDY_DRIVER] = "its driver is to be bound anew",
    };
    char detail[RADIO_DETAIL_SIZE];

    self.remedy = self.remedy == REMEDY_DRIVER ? REMEDY_SET_ANEW : self.remedy + 1;
    self.expected_us = now_us + (self.remedy == REMEDY_DRIVER ? SILENT_AGAIN_US : 0);
    self.pending = true;
    self.to_clear =
        self.to_clear || self.remedy == REMEDY_SET_ANEW; /* the same one would change nothing */
    self.to_switch = self.remedy == REMEDY_OFF_AND_ON;
    self.radio->given_up = self.radio->given_up || self.remedy == REMEDY_DRIVER;
    self.radio->silent = verdict == BEACONS_NOT_SENT;
    self.radio->failures++;
    radio_denied(self.radio,
                 verdict == BEACONS_NO_CARRIER ? self.evidence.carrier_us : self.evidence.moved_us);
    snprintf(detail, sizeof(detail), "hostapd says OK, and %s; %s",
             verdict == BEACONS_NO_CARRIER ? "its interface is down" : "the chip sends no beacon",
             tried[self.remedy]);
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_LOST, detail, now_us);
}

static void end_remedies(void)
{
    self.remedy = REMEDY_NONE;
    self.radio->given_up = false;
    self.pending = true;
}

/* hostapd takes no notice of that. */
static void wait_for_switch(int64_t now_us)
{
    end_remedies();
    self.expected_us = now_us;
    radio_denied(self.radio, self.evidence.carrier_us);
    radio_enter(self.radio, CHANNEL_WIFI, RADIO_BLOCKED, "its radio is switched off", now_us);
}

static void on_look(void *context, int64_t now_us)
{
    enum beacon_verdict verdict = beacon_evidence_look(&self.evidence, self.expected_us, now_us);
    bool settled = now_us - self.expected_us > beacon_evidence_patience_us(&self.evidence);

    (void)context;
    loop_arm(&self.look, now_us + (self.remedy == REMEDY_NONE ? BEACON_COUNT_EVERY_US : SOON_US));
    self.radio->known = beacon_evidence_heard(&self.evidence, now_us) ? RADIO_HEARD
                        : verdict == BEACONS_SENT                     ? RADIO_COUNTED
                                                                      : RADIO_SET;
    if (!self.enabled || self.newest.length == 0) {
        return; /* none is to be expected */
    }
    if (verdict == BEACONS_NO_CARRIER && is_blocked()) {
        wait_for_switch(now_us);
    } else if (verdict == BEACONS_NOT_SENT || verdict == BEACONS_NO_CARRIER) {
        lose_beacons(verdict, now_us);
    } else if (self.remedy != REMEDY_NONE && (verdict == BEACONS_SENT || settled)) {
        end_remedies();
    } else if (self.radio->state == RADIO_ON_AIR) {
        enter_on_air(now_us); /* how it is known may have changed */
    }
    advance(now_us);
}

/* ---- what was answered ---- */

/* Whoever did that, ourselves with what came between, or another program. */
static void look_whether_off(const char *state, int64_t now_us)
{
    if (strcmp(state, "DISABLED") != 0) {
        self.enable_us = LOOP_NEVER;
    } else if (self.enable_us == LOOP_NEVER) {
        self.enable_us = now_us + OFF_US;
    }
}

static void take_status(const char *reply, int64_t now_us)
{
    char detail[RADIO_DETAIL_SIZE], state[32];
    bool enabled;

    find_state(reply, state);
    enabled = strcmp(state, "ENABLED") == 0;
    look_whether_off(state, now_us);
    /* hostapd says so also where the kernel has its interface down, which is no word of the chip's.
     */
    if (enabled && self.refused) {
        if (beacon_evidence_is_down(&self.evidence, now_us)) {
            self.allowed_us = now_us + REFUSED_US;
        } else {
            take_less(now_us);
        }
    }
    self.refused = false;
    if (enabled) {
        if (!self.enabled) {
            self.pending = true; /* it may have forgotten */
            self.expected_us = now_us;
        }
        if (!self.pending && self.radio->state == RADIO_ON_AIR) {
            radio_confirmed(self.radio, now_us); /* unchanged content is not given again */
        }
    } else {
        snprintf(detail, sizeof(detail), "hostapd's state of %s: %s", self.config->wifi_iface,
                 state[0] != '\0' ? state : "unknown");
        radio_enter(self.radio, CHANNEL_WIFI, unless_blocked(RADIO_DOWN), detail, now_us);
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
    self.radio->silent = false; /* it isn't for want of a free channel */
    radio_enter(self.radio, CHANNEL_WIFI, unless_blocked(RADIO_LOST), detail, now_us);
}

/* The driver's word, or the chip's. */
static void take_refused_update(const char *reply, int64_t now_us)
{
    self.refused = true;
    if (beacon_room_is_trial(
            &self.room,
            messages_in(&self.given))) { /* what was taken before is given again at once */
        self.pending = true;
        self.status_us = now_us;
        return;
    }
    take_refusal("UPDATE_BEACON", reply, now_us);
}

static void take_refused_element(enum request answered, const char *reply, int64_t now_us)
{
    self.fresh = self.fresh || self.given_fresh;
    if (answered == REQUEST_SET) {
        take_refusal("SET vendor_elements", reply, now_us);
    } else {
        take_refused_update(reply, now_us);
    }
}

static void take_success(int64_t now_us)
{
    retry_reset(&self.retry);
    self.taken = self.given;
    /* What the driver takes for set already it answers without asking the chip. */
    self.known = self.known || !is_same(&self.given, &self.unanswered);
    beacon_room_taken(&self.room, messages_in(&self.given), now_us);
    if (self.remedy != REMEDY_NONE || beacon_evidence_is_down(&self.evidence, now_us)) {
        return; /* it said so before; nor does it know of a switch */
    }
    enter_on_air(now_us);
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
    } else if (answered == REQUEST_BACK_SET) {
        request(REQUEST_BACK_UPDATE, "UPDATE_BEACON", now_us);
    } else if (answered == REQUEST_BACK_UPDATE) {
        clear(now_us); /* also after a "FAIL" */
    } else if (answered == REQUEST_CLEAR_SET) {
        request(REQUEST_CLEAR_UPDATE, "UPDATE_BEACON", now_us);
    } else if (answered == REQUEST_CLEAR_UPDATE) {
        self.to_clear = false;
    } else if (answered == REQUEST_DISABLE) {
        switch_interface(REQUEST_ENABLE, "ENABLE", now_us);
    } else if (answered == REQUEST_ENABLE) {
        self.status_us = now_us;
        beacon_room_forget(&self.room); /* its driver has begun anew */
        self.taken.length = self.unanswered.length = 0;
        self.known = true;
    } else if (!ok) {
        take_refused_element(answered, reply, now_us);
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
    self.enabled = self.to_switch = false;
    self.enable_us = LOOP_NEVER;
    begin_anew();
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
    self.known = false;
    self.unanswered.length = 0;
    begin_anew();
    self.remedy = REMEDY_NONE;
    beacon_evidence_init(&self.evidence, config->run_dir, "/sys/class/net", config->wifi_iface);
    hostapd_control_init(&self.control, on_reply, on_lost, NULL);
    loop_timer_init(&self.timer, on_timer, NULL);
    loop_timer_init(&self.look, on_look, NULL);
    radio_init(radio, config->wifi_beacon_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    if (config->wifi_beacon_enabled) {
        loop_arm(&self.look, now_us + BEACON_COUNT_EVERY_US);
        open_control(now_us);
    }
}

void wifi_beacon_set(const uint8_t *element, size_t length, int64_t now_us)
{
    if (length > sizeof(self.newest.octets) || self.radio->state == RADIO_DISABLED) {
        return;
    }
    if (length != self.newest.length || memcmp(element, self.newest.octets, length) != 0) {
        if (wifi_beacon_waits()) {
            radio_replaced(self.radio);
        }
        memcpy(self.newest.octets, element, length);
        self.newest.length = length;
        self.pending = self.fresh = true;
    }
    advance(now_us);
}

unsigned wifi_beacon_most(void)
{
    return self.room.most;
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
    loop_arm(&self.look, LOOP_NEVER);
}
