/*
 * odid-beacons: asks the Wi-Fi chip twice a second how many beacons it has sent, and writes that
 * down for the daemon (radio/beacon_evidence). A program of its own: a chip that hangs holds up for
 * seconds whoever asks it anything.
 *
 * brcmfmac passes the firmware's commands on, by nl80211's vendor commands and to whoever has
 * CAP_NET_ADMIN. Of another driver's chip nothing is known.
 */
#include <cap-ng.h>
#include <errno.h>
#include <inttypes.h>
#include <linux/nl80211.h>
#include <net/if.h>
#include <netlink/genl/ctrl.h>
#include <netlink/genl/genl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "base/whole_file.h"
#include "beacons/beacon_counters.h"
#include "radio/beacon_evidence.h"

/* Who couldn't be asked isn't asked again at once: the question holds up hostapd's as well. */
#define REFUSED_S 10
#define HUNG_S 5

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
    bool awaited; /* the end of it: an acknowledgement, or an error */
    int error;    /* libnl's, negative */
    size_t length;
    uint8_t octets[BEACON_COUNTERS_MAX];
};

static int take_answer(struct nl_msg *message, void *context)
{
    struct answer *answer = context;
    struct nlattr *vendor =
        nlmsg_find_attr(nlmsg_hdr(message), GENL_HDRLEN, NL80211_ATTR_VENDOR_DATA);
    struct nlattr *data =
        vendor == NULL ? NULL : nla_find(nla_data(vendor), nla_len(vendor), BROADCOM_DCMD_DATA);

    if (data != NULL && (size_t)nla_len(data) <= sizeof(answer->octets)) {
        answer->length = (size_t)nla_len(data);
        memcpy(answer->octets, nla_data(data), answer->length);
    }
    return NL_OK;
}

static int take_end(struct nl_msg *message, void *context)
{
    struct answer *answer = context;

    (void)message;
    answer->awaited = false;
    return NL_STOP;
}

static int take_error(struct sockaddr_nl *address, struct nlmsgerr *error, void *context)
{
    struct answer *answer = context;

    (void)address;
    answer->awaited = false;
    answer->error = -nl_syserr2nlerr(error->error);
    return NL_STOP;
}

static struct nl_msg *question(int nl80211, unsigned interface)
{
    const struct dcmd dcmd = {.command = GET_VARIABLE,
                              .answer_size = BEACON_COUNTERS_MAX,
                              .offset = offsetof(struct dcmd, name),
                              .name = "counters"};
    struct nl_msg *message = nlmsg_alloc();

    if (message == NULL ||
        genlmsg_put(message, NL_AUTO_PORT, NL_AUTO_SEQ, nl80211, 0, 0, NL80211_CMD_VENDOR, 0) ==
            NULL ||
        nla_put_u32(message, NL80211_ATTR_IFINDEX, interface) < 0 ||
        nla_put_u32(message, NL80211_ATTR_VENDOR_ID, BROADCOM_OUI) < 0 ||
        nla_put_u32(message, NL80211_ATTR_VENDOR_SUBCMD, BROADCOM_DCMD) < 0 ||
        nla_put(message, NL80211_ATTR_VENDOR_DATA, offsetof(struct dcmd, name) + sizeof(dcmd.name),
                &dcmd) < 0) {
        nlmsg_free(message);
        return NULL;
    }
    return message;
}

/* Returns 0, or libnl's error, negative. */
static int ask(struct nl_sock *socket, int nl80211, const char *iface, uint32_t *beacons)
{
    static struct answer answer;
    unsigned interface = if_nametoindex(iface);
    struct nl_msg *message = interface == 0 ? NULL : question(nl80211, interface);
    int result;

    if (message == NULL) {
        return interface == 0 ? -NLE_NODEV : -NLE_NOMEM;
    }
    answer.awaited = true;
    answer.error = 0;
    answer.length = 0;
    nl_socket_modify_cb(socket, NL_CB_VALID, NL_CB_CUSTOM, take_answer, &answer);
    nl_socket_modify_cb(socket, NL_CB_ACK, NL_CB_CUSTOM, take_end, &answer);
    nl_socket_modify_err_cb(socket, NL_CB_CUSTOM, take_error, &answer);
    result = nl_send_auto(socket, message);
    nlmsg_free(message);
    while (result >= 0 && answer.awaited) {
        result = nl_recvmsgs_default(socket);
    }
    if (result < 0 || answer.error < 0) {
        return answer.error < 0 ? answer.error : result;
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

static void write_down(const char *path, int64_t asked_ms, const uint32_t *beacons)
{
    static int failed;
    char line[48], count[16] = "-";
    int result;

    if (beacons != NULL) {
        snprintf(count, sizeof(count), "%" PRIu32, *beacons);
    }
    result = whole_file_replace(
        path, line, (size_t)snprintf(line, sizeof(line), "%" PRId64 " %s\n", asked_ms, count),
        0644);
    if (result < 0 && result != failed) {
        log_error("%s: %s", path, strerror(-result));
    }
    failed = result;
}

static _Noreturn void follow(struct nl_sock *socket, int nl80211, const char *iface,
                             const char *path)
{
    for (;;) {
        uint32_t beacons;
        int64_t asked_ms = now_ms();
        int result = ask(socket, nl80211, iface, &beacons);

        say(result);
        write_down(path, asked_ms, result < 0 ? NULL : &beacons);
        if (result == -NLE_OPNOTSUPP) {
            sleep(REFUSED_S);
        } else if (result < 0 && result != -NLE_NODEV) {
            sleep(HUNG_S);
        } else {
            usleep(BEACON_COUNT_EVERY_US);
        }
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
    struct nl_sock *socket;
    int nl80211;

    if (argc != 3 || argv[1][0] == '-') {
        fprintf(stderr, "usage: odid-beacons interface file\n");
        return 2;
    }
    if (!give_rights_away()) {
        log_error("can't keep CAP_NET_ADMIN only; odid-beacons has to be started with it");
        return EXIT_FAILURE;
    }
    socket = nl_socket_alloc();
    if (socket == NULL || genl_connect(socket) < 0) {
        log_error("no socket to the kernel's radios");
        return EXIT_FAILURE;
    }
    nl80211 = genl_ctrl_resolve(socket, NL80211_GENL_NAME);
    if (nl80211 < 0) {
        log_error("the kernel has no Wi-Fi: %s", nl_geterror(nl80211));
        return EXIT_FAILURE;
    }
    follow(socket, nl80211, argv[1], argv[2]);
}
