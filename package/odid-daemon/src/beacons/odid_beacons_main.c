/*
 * odid-beacons: asks the Wi-Fi chip twice a second how many beacons it has sent, and another radio,
 * where one is named, whether it hears them; and writes both down for the daemon
 * (radio/beacon_evidence). A program of its own: a chip that hangs holds up for seconds whoever
 * asks it anything.
 *
 * brcmfmac passes the firmware's commands on, by nl80211's vendor commands and to whoever has
 * CAP_NET_ADMIN. Of another driver's chip nothing is known.
 */
#include <cap-ng.h>
#include <errno.h>
#include <inttypes.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "base/whole_file.h"
#include "beacons/beacon_counters.h"
#include "beacons/beacon_listener.h"
#include "beacons/beacon_pace.h"
#include "beacons/nl80211.h"
#include "radio/beacon_evidence.h"

/* Who couldn't be asked isn't asked again at once: the question holds up hostapd's as well. */
#define REFUSED_MS 10000
#define HUNG_MS 5000

/* Linux' drivers/net/wireless/broadcom/brcm80211/brcmfmac/vendor.h. */
#define BROADCOM_OUI 0x001018
#define BROADCOM_DCMD 1
#define BROADCOM_DCMD_DATA 2
#define GET_VARIABLE 262

struct dcmd {
    uint32_t command;
    int32_t answer_size;
    uint32_t offset; /* of what is sent with it */
    uint32_t is_set;
    uint32_t magic;
    char name[sizeof("counters")];
};

struct answer {
    size_t length;
    uint8_t octets[BEACON_COUNTERS_MAX];
};

static void take_answer(struct nlattr *attributes[NL80211_ATTR_MAX + 1], void *context)
{
    struct nlattr *vendor = attributes[NL80211_ATTR_VENDOR_DATA];
    struct nlattr *data =
        vendor == NULL ? NULL : nla_find(nla_data(vendor), nla_len(vendor), BROADCOM_DCMD_DATA);
    struct answer *answer = context;

    if (data != NULL && (size_t)nla_len(data) <= sizeof(answer->octets)) {
        answer->length = (size_t)nla_len(data);
        memcpy(answer->octets, nla_data(data), answer->length);
    }
}

static struct nl_msg *question(unsigned interface)
{
    const struct dcmd dcmd = {.command = GET_VARIABLE,
                              .answer_size = BEACON_COUNTERS_MAX,
                              .offset = offsetof(struct dcmd, name),
                              .name = "counters"};
    struct nl_msg *message = nl80211_question(NL80211_CMD_VENDOR, 0, interface);

    if (message != NULL && (nla_put_u32(message, NL80211_ATTR_VENDOR_ID, BROADCOM_OUI) < 0 ||
                            nla_put_u32(message, NL80211_ATTR_VENDOR_SUBCMD, BROADCOM_DCMD) < 0 ||
                            nla_put(message, NL80211_ATTR_VENDOR_DATA,
                                    offsetof(struct dcmd, name) + sizeof(dcmd.name), &dcmd) < 0)) {
        nlmsg_free(message);
        return NULL;
    }
    return message;
}

/* Returns 0, or libnl's error, negative. */
static int ask(const char *iface, uint32_t *beacons)
{
    static struct answer answer;
    unsigned interface = if_nametoindex(iface);
    int result;

    if (interface == 0) {
        return -NLE_NODEV;
    }
    answer.length = 0;
    result = nl80211_ask(question(interface), take_answer, &answer);
    if (result < 0) {
        return result;
    }
    return beacon_counters_read(answer.octets, answer.length, beacons) ? 0 : -NLE_OPNOTSUPP;
}

/* Said once for each reason. */
static void say(int result)
{
    static int said = 1;

    if (result != said && result == 0) {
        log_info("the Wi-Fi chip counts its beacons");
    } else if (result != said) {
        log_info("the Wi-Fi chip doesn't say how many beacons it sends: %s", nl_geterror(result));
    }
    said = result;
}

static int64_t now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static void write_down(const char *path, int64_t asked_ms, const uint32_t *beacons, bool seen,
                       int64_t heard_ms)
{
    static int failed;
    char line[64], count[16] = "-", heard[24] = "-";
    size_t length;
    int result;

    if (beacons != NULL) {
        snprintf(count, sizeof(count), "%" PRIu32, *beacons);
    }
    if (heard_ms != INT64_MIN) {
        snprintf(heard, sizeof(heard), "%" PRId64, heard_ms);
    }
    length = (size_t)snprintf(line, sizeof(line), "%" PRId64 " %s %s %s\n", asked_ms, count, heard,
                              seen ? BEACON_COUNT_SEEN : "-");
    result = whole_file_replace(path, line, length, 0644);
    if (result < 0 && result != failed) {
        log_error("%s: %s", path, strerror(-result));
    }
    failed = result;
}

/* Until when who gave that answer isn't asked again. */
static int64_t asked_next_ms(int result, int64_t now_ms)
{
    if (result == -NLE_OPNOTSUPP) {
        return now_ms + REFUSED_MS;
    }
    return result < 0 && result != -NLE_NODEV ? now_ms + HUNG_MS : now_ms;
}

static _Noreturn void follow(const char *iface, const char *path, const char *listener)
{
    int64_t next_ms = 0, heard_ms = INT64_MIN;
    struct beacon_pace pace = {.began = false};
    uint32_t beacons;
    int result = 0;

    for (;;) {
        int64_t at_ms = now_ms();

        if (at_ms >= next_ms) {
            result = ask(iface, &beacons);
            say(result);
            next_ms = asked_next_ms(result, now_ms());
        }
        if (result == 0) {
            beacon_pace_take(&pace, beacons, at_ms);
        }
        write_down(path, at_ms, result < 0 ? NULL : &beacons, pace.seen, heard_ms);
        if (listener != NULL) { /* which may take its time, and the count is written down by then */
            heard_ms = beacon_listener_look(iface, listener, at_ms);
        }
        usleep(BEACON_COUNT_EVERY_US);
    }
}

/* Of what it is started with it needs one right only. */
static bool give_rights_away(void)
{
    capng_clear(CAPNG_SELECT_CAPS);
    return capng_update(CAPNG_ADD, CAPNG_EFFECTIVE | CAPNG_PERMITTED, CAP_NET_ADMIN) == 0 &&
           capng_apply(CAPNG_SELECT_CAPS) == 0;
}

int main(int argc, char *argv[])
{
    int result;

    if (argc < 3 || argc > 4 || argv[1][0] == '-') {
        fprintf(stderr, "usage: odid-beacons interface file [listener]\n");
        return 2;
    }
    if (!give_rights_away()) {
        log_error("can't keep CAP_NET_ADMIN only; odid-beacons has to be started with it");
        return EXIT_FAILURE;
    }
    result = nl80211_open();
    if (result < 0) {
        log_error("the kernel has no Wi-Fi: %s", nl_geterror(result));
        return EXIT_FAILURE;
    }
    follow(argv[1], argv[2], argv[3]);
}
