#include "appliance/update_offer.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "appliance/update_bundle.h"

static bool refuse(char *why, unsigned long size, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static bool refuse(char *why, unsigned long size, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(why, size, format, arguments);
    va_end(arguments);
    return false;
}

bool update_versions_judge(const struct update_versions *versions, char *why, unsigned long size)
{
    const char *offered = versions->offered;
    int newer = update_version_compare(offered, versions->running);

    if (versions->unattended && newer == 0) {
        return refuse(why, size, "Version %s is running already.", offered);
    }
    if (versions->unattended && newer < 0) {
        return refuse(why, size,
                      "Version %s is older than %s, which is running; the page or odidctl installs "
                      "it.",
                      offered, versions->running);
    }
    if (versions->unattended && strcmp(offered, versions->rolled_back) == 0) {
        return refuse(why, size,
                      "Version %s was rolled back before; the page or odidctl tries it again.",
                      offered);
    }
    if (versions->prevent_downgrade && newer < 0) {
        return refuse(why, size,
                      "Version %s is older than %s, which is running, and [update] "
                      "prevent_downgrade = yes.",
                      offered, versions->running);
    }
    if (versions->unreadable && newer < 0) {
        return refuse(
            why, size,
            "Version %s is older than %s, which is running, and the configuration can't "
            "be read, or was lost: [update] prevent_downgrade may be set. Set it anew on CONFIG.",
            offered, versions->running);
    }
    return true;
}

bool update_offer_judge(const struct update_offer *offer, char *why, unsigned long size)
{
    bool alone =
        offer->versions.unattended || offer->versions.from_server; /* nobody asked for it */

    if (offer->undecided) {
        return refuse(why, size,
                      "Another update is on trial or waits for the reboot; try again when it is "
                      "decided.");
    }
    if (offer->given_up) { /* the other slot is the one to go back to */
        return refuse(why, size,
                      "This version failed its trial, and the board restarts into the one before; "
                      "try again then.");
    }
    if (offer->armed == ARMED_YES) {
        return refuse(why, size,
                      "The aircraft is armed, or its autopilot was lost while it was armed; disarm "
                      "it first.");
    }
    if (offer->armed == ARMED_UNKNOWN) {
        return refuse(why, size,
                      "Whether the aircraft is armed isn't known, for the daemon doesn't answer.");
    }
    if (offer->armed == ARMED_UNSAID) {
        return refuse(why, size,
                      "Whether the aircraft is armed isn't known, for no HEARTBEAT comes that says "
                      "it.");
    }
    if (offer->armed == ARMED_SILENT && alone) {
        return refuse(why, size,
                      "The autopilot is silent, and nobody is there to say that it doesn't "
                      "fly; the page or odidctl installs it.");
    }
    if (alone && !offer->remembers) {
        return refuse(why, size,
                      "Whether it failed before can't be kept in /data; the page or odidctl "
                      "installs it.");
    }
    if (!update_versions_judge(&offer->versions, why, size)) {
        return false;
    }
    if (!offer->keeps_records &&
        strcmp(offer->versions.offered, offer->versions.rolled_back) == 0) {
        return refuse(why, size,
                      "Version %s was rolled back before, and in /data that can't be changed: its "
                      "trial would be given up at once. See the faults.",
                      offer->versions.offered);
    }
    if (offer->slot_octets == 0) {
        return refuse(why, size, "The size of the slot isn't known.");
    }
    if (offer->needed_octets > offer->slot_octets) {
        return refuse(why, size,
                      "The bundle needs %" PRIu64 " octets, and the slot has %" PRIu64 ".",
                      offer->needed_octets, offer->slot_octets);
    }
    return true;
}
