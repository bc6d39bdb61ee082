#include "beacons/beacon_listener.h"

#include <net/if.h>
#include <string.h>

#include "beacons/nl80211.h"

#define ADDRESS_SIZE 6

#define ELEMENT_HEAD 2
#define VENDOR_SPECIFIC 221
/* ASD-STAN's OUI and type, the counter, and the pack's head: F3 or so, each one's size, how many */
#define PACK_AT 5
#define PACK_HEAD 3
#define MESSAGE 25

struct interface {
    bool known, is_used;
    uint32_t radio, frequency_mhz;
    uint8_t address[ADDRESS_SIZE];
};

struct heard {
    const uint8_t *address;
    int64_t now_ms, at_ms;
};

bool beacon_listener_is_remote_id(const uint8_t *elements, size_t length)
{
    static const uint8_t whose[] = {0xFA, 0x0B, 0xBC, 0x0D};

    while (length >= ELEMENT_HEAD && length - ELEMENT_HEAD >= elements[1]) {
        const uint8_t *content = elements + ELEMENT_HEAD;

        if (elements[0] == VENDOR_SPECIFIC && elements[1] >= PACK_AT + PACK_HEAD + MESSAGE &&
            memcmp(content, whose, sizeof(whose)) == 0 && content[PACK_AT] >> 4 == 0xF &&
            content[PACK_AT + 1] == MESSAGE) {
            return true;
        }
        length -= (size_t)ELEMENT_HEAD + elements[1];
        elements = content + elements[1];
    }
    return false;
}

/* ---- both interfaces ---- */

static void take_interface(struct nlattr *attributes[NL80211_ATTR_MAX + 1], void *context)
{
    struct nlattr *radio = attributes[NL80211_ATTR_WIPHY], *type = attributes[NL80211_ATTR_IFTYPE],
                  *address = attributes[NL80211_ATTR_MAC],
                  *frequency = attributes[NL80211_ATTR_WIPHY_FREQ];
    struct interface *interface = context;

    if (radio == NULL || type == NULL || address == NULL || nla_len(address) != ADDRESS_SIZE) {
        return;
    }
    interface->known = true;
    interface->radio = nla_get_u32(radio);
    interface->frequency_mhz = frequency == NULL ? 0 : nla_get_u32(frequency);
    /* An SSID, or a channel, are said of one that is somebody's. */
    interface->is_used = nla_get_u32(type) != NL80211_IFTYPE_STATION || frequency != NULL ||
                         attributes[NL80211_ATTR_SSID] != NULL;
    memcpy(interface->address, nla_data(address), ADDRESS_SIZE);
}

static bool ask(unsigned index, struct interface *interface)
{
    *interface = (struct interface){.known = false};
    return index != 0 &&
           nl80211_ask(nl80211_question(NL80211_CMD_GET_INTERFACE, 0, index), take_interface,
                       interface) == 0 &&
           interface->known;
}

/* ---- what it heard ---- */

static void take_scanned(struct nlattr *attributes[NL80211_ATTR_MAX + 1], void *context)
{
    struct nlattr *bss[NL80211_BSS_MAX + 1];
    struct heard *heard = context;
    struct nlattr *elements;
    int64_t at_ms;

    if (attributes[NL80211_ATTR_BSS] == NULL ||
        nla_parse_nested(bss, NL80211_BSS_MAX, attributes[NL80211_ATTR_BSS], NULL) < 0 ||
        bss[NL80211_BSS_BSSID] == NULL || bss[NL80211_BSS_SEEN_MS_AGO] == NULL ||
        nla_len(bss[NL80211_BSS_BSSID]) != ADDRESS_SIZE ||
        memcmp(nla_data(bss[NL80211_BSS_BSSID]), heard->address, ADDRESS_SIZE) != 0) {
        return;
    }
    elements = bss[NL80211_BSS_BEACON_IES] != NULL ? bss[NL80211_BSS_BEACON_IES]
                                                   : bss[NL80211_BSS_INFORMATION_ELEMENTS];
    at_ms = heard->now_ms - nla_get_u32(bss[NL80211_BSS_SEEN_MS_AGO]);
    if (elements != NULL && at_ms > heard->at_ms &&
        beacon_listener_is_remote_id(nla_data(elements), (size_t)nla_len(elements))) {
        heard->at_ms = at_ms;
    }
}

/* Without naming a network: it asks nobody anything, and sends nothing. */
static void begin_to_listen(unsigned listener, uint32_t frequency_mhz)
{
    struct nl_msg *question = nl80211_question(NL80211_CMD_TRIGGER_SCAN, 0, listener);
    struct nlattr *frequencies =
        question == NULL ? NULL : nla_nest_start(question, NL80211_ATTR_SCAN_FREQUENCIES);

    if (frequencies == NULL || nla_put_u32(question, 0, frequency_mhz) < 0) {
        nlmsg_free(question);
        return;
    }
    nla_nest_end(question, frequencies);
    /* It may be down, or listen already: then nothing is heard, or it is. */
    (void)nl80211_ask(question, NULL, NULL);
}

static int64_t look(unsigned iface, unsigned listener, int64_t now_ms)
{
    struct interface ours, other;
    struct heard heard = {ours.address, now_ms, INT64_MIN};

    if (!ask(iface, &ours) || !ask(listener, &other) || ours.frequency_mhz == 0 || other.is_used ||
        ours.radio == other.radio ||
        nl80211_ask(nl80211_question(NL80211_CMD_GET_SCAN, NLM_F_DUMP, listener), take_scanned,
                    &heard) < 0) {
        return INT64_MIN;
    }
    begin_to_listen(listener, ours.frequency_mhz); /* what it hears is looked at next time */
    return heard.at_ms;
}

int64_t beacon_listener_look(const char *iface, const char *listener, int64_t now_ms)
{
    static int64_t next_ms = INT64_MIN, heard_ms = INT64_MIN;

    if (now_ms >= next_ms) {
        next_ms = now_ms + BEACON_LISTEN_EVERY_MS;
        heard_ms = look(if_nametoindex(iface), if_nametoindex(listener), now_ms);
    }
    return heard_ms;
}
