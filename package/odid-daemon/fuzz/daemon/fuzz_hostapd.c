/*
 * A hostapd's datagrams -> hostapd_control -> wifi_beacon -> requests.
 *
 * An input is records of an operation (low three bits) and what it needs:
 *
 *   0, 1  a raw datagram: count, bytes
 *   2     "OK"
 *   3     "FAIL"
 *   4     a status: which
 *   5     an event that nobody asked for: count, bytes
 *   6     an element: length, filling
 *   7     hostapd restarts
 */
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/loop.h"
#include "input.h"
#include "on_air.h"
#include "quiet_log.h"
#include "rounds.h"

/* Its state must start afresh for each input, which the daemon never needs. */
#include "../../src/daemon/wifi_beacon.c"

#define SET_LENGTH (sizeof(SET_REQUEST) - 1)

#define STALL_US 500000
#define STEPS_MAX 100 /* of an input: the rest would only be more of the same */

static struct config config;
static struct radio radio;
static char directory[] = "/tmp/odid-fuzz-XXXXXX";
static struct sockaddr_un own = {.sun_family = AF_UNIX}, peer;
static socklen_t peer_size;
static int hostapd = -1;
static bool set_asked, set_taken; /* the last request was SET; its answer was OK */
static bool update_asked;
static uint64_t updates; /* that were answered OK */
static int64_t begun_us;

/* An input takes milliseconds. On a machine that stood still meanwhile, answers rightly count as
 * late: there is nothing to judge. */
static bool stalled(void)
{
    return loop_now_us() - begun_us > STALL_US;
}

static void judge_request(const char *text, size_t length)
{
    if (stalled()) {
        return;
    }
    set_asked = strncmp(text, SET_REQUEST, SET_LENGTH) == 0;
    if (set_asked) {
        MUST(length > SET_LENGTH && (length - SET_LENGTH) % 2 == 0);
        MUST(length - SET_LENGTH <= 2 * MESSAGES_ELEMENT_SIZE);
        MUST(strspn(text + SET_LENGTH, "0123456789abcdef") == length - SET_LENGTH);
    } else if (strcmp(text, "UPDATE_BEACON") == 0) {
        MUST(set_taken); /* never without an element that was taken */
        update_asked = true;
    } else {
        MUST(strcmp(text, "STATUS") == 0);
    }
    set_taken = false;
}

static void take_request(void)
{
    char text[4096];
    ssize_t length;
    unsigned count = 0;

    if (hostapd < 0) {
        return;
    }
    for (;;) {
        peer_size = sizeof(peer);
        length = recvfrom(hostapd, text, sizeof(text) - 1, MSG_DONTWAIT, (struct sockaddr *)&peer,
                          &peer_size);
        if (length < 0) {
            break;
        }
        text[length] = '\0';
        judge_request(text, (size_t)length);
        count++;
    }
    MUST(count <= 1 || stalled()); /* one at a time */
}

/* Events are passed over; anything else answers what was asked. */
static void judge_reply(const char *text, size_t length)
{
    bool ok = length >= 2 && memcmp(text, "OK", 2) == 0;

    if (length > 0 && text[0] == '<') {
        return;
    }
    for (size_t i = 2; i < length; i++) {
        ok = ok && (text[i] == '\n' || text[2] == '\0');
    }
    set_taken = set_asked && ok;
    updates += update_asked && ok;
    set_asked = update_asked = false;
}

static void say(const char *text, size_t length)
{
    if (hostapd >= 0 && peer_size > 0 &&
        sendto(hostapd, text, length, MSG_DONTWAIT | MSG_NOSIGNAL, (struct sockaddr *)&peer,
               sizeof(peer)) >= 0) {
        judge_reply(text, length);
    }
    run();
    take_request();
}

static void say_raw(const char *before)
{
    char text[300];
    size_t length = strlen(before), count = byte();

    count = count < input.left ? count : input.left;
    memcpy(text, before, length);
    memcpy(text + length, input.at, count);
    input.at += count;
    input.left -= count;
    say(text, length + count);
}

static void say_status(void)
{
    static const char *const statuses[] = {
        "state=ENABLED\nphy=phy0\nfreq=2437\n",
        "state=DISABLED\nphy=phy0\n",
        "phy=phy0\nstate=ENABLED",
        "state=\n",
        "hw_state=ENABLED\nstate=DFS\n",
        "state=COUNTRY_UPDATE_AND_SOMETHING_LONGER\n",
        "state",
        "UNKNOWN COMMAND\n",
    };
    const char *status = statuses[byte() & 7];

    say(status, strlen(status));
}

static void give(void)
{
    uint8_t element[MESSAGES_ELEMENT_SIZE + 1];
    size_t length = byte() % (sizeof(element) + 1);

    memset(element, byte(), sizeof(element));
    wifi_beacon_set(element, length, loop_now_us());
    take_request();
}

static void begin(void)
{
    hostapd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    MUST(hostapd >= 0 && bind(hostapd, (struct sockaddr *)&own, sizeof(own)) == 0);
}

static void end(void)
{
    close(hostapd);
    unlink(own.sun_path);
    set_asked = set_taken = update_asked = false;
}

static void judge(void)
{
    if (stalled()) {
        return;
    }
    MUST(radio_state_name(radio.state) != NULL);
    MUST(memchr(radio.detail, '\0', sizeof(radio.detail)) != NULL);
    MUST(radio.payloads <= updates);
    MUST(radio.state != RADIO_ON_AIR || updates > 0);
}

static void step(void)
{
    switch (byte() & 7) {
    case 0:
    case 1:
        say_raw("");
        break;
    case 2:
        say("OK\n", 3);
        break;
    case 3:
        say("FAIL\n", 5);
        break;
    case 4:
        say_status();
        break;
    case 5:
        say_raw("<3>");
        break;
    case 6:
        give();
        break;
    default:
        end();
        begin();
        break;
    }
    judge();
}

static void remove_directory(void)
{
    rmdir(directory);
}

int LLVMFuzzerInitialize(int *count, char ***arguments)
{
    (void)count;
    (void)arguments;
    MUST(loop_init() == 0);
    MUST(mkdtemp(directory) != NULL && atexit(remove_directory) == 0);
    rounds_init();
    config.wifi_beacon_enabled = true;
    strcpy(config.wifi_iface, "wlan0");
    strcpy(config.hostapd_dir, directory);
    snprintf(own.sun_path, sizeof(own.sun_path), "%s/wlan0", directory);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input.at = data;
    input.left = size;
    updates = 0;
    begun_us = loop_now_us();
    self.request = REQUEST_NONE;
    self.enabled = self.pending = false;
    self.newest.length = 0;
    self.enable_us = LOOP_NEVER;
    retry_reset(&self.retry);
    begin();
    wifi_beacon_start(&config, &radio, loop_now_us());
    take_request();
    for (unsigned steps = 0; input.left > 0 && steps < STEPS_MAX; steps++) {
        step();
    }
    hostapd_control_close(&self.control);
    loop_arm(&self.timer, LOOP_NEVER);
    loop_arm(&self.look, LOOP_NEVER);
    end();
    return 0;
}
