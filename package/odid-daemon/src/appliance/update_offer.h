/*
 * May a bundle be installed? The appliance's own rules, for everybody who
 * offers one; SWUpdate has found its signature and hardware good by then. Pure.
 */
#ifndef ODID_UPDATE_OFFER_H
#define ODID_UPDATE_OFFER_H

#include <stdbool.h>
#include <stdint.h>

#include "appliance/armed.h"
#include "appliance/update_names.h"

/* What nobody asked for, a stick's, is to be newer, and no version that failed here. */
struct update_versions {
    const char *offered, *running;
    const char *rolled_back; /* the version that was; "": none */
    bool unattended;
    bool from_server;       /* whom the outcome is told, which may offer it again */
    bool prevent_downgrade; /* [update] prevent_downgrade */
    bool unreadable;        /* the configuration is, or was lost: whether that is set isn't known */
};

/* Returns whether it may be; else why not, a sentence. */
bool update_versions_judge(const struct update_versions *versions, char *why, unsigned long size);

struct update_offer {
    struct update_versions versions;
    uint64_t needed_octets, slot_octets; /* slot_octets 0: the slot's size isn't known */
    bool undecided;                      /* another update waits for the restart or is on trial */
    bool given_up;                       /* the running slot failed its trial */
    enum armed armed;
    bool keeps_records; /* /data takes a record of it now */
    bool remembers;     /* and will still have it if it is rolled back, for all that is known */
};

bool update_offer_judge(const struct update_offer *offer, char *why, unsigned long size);

#endif
