#include "daemon/vehicle.h"

#include <string.h>

/* A vehicle that was silent for this long may be another one: a changed SYSID, another aircraft. */
#define FORGOTTEN_US 10000000
#define SILENT_US 3000000 /* three of its HEARTBEATs */
/* Who is heard for so long without a break is there to stay; who falls silent before, for longer
 * than a HEARTBEAT's second, was a stray voice. One HEARTBEAT that is lost is no break. */
#define SETTLED_US 3000000
#define PASSED_BY_US 1500000
#define BREAK_US 2500000
#define STARTED_US 60000000 /* an autopilot has started by then */

void vehicle_init(struct vehicle *vehicle)
{
    memset(vehicle, 0, sizeof(*vehicle));
    vehicle->heartbeat_us = INT64_MIN;
}

void vehicle_expect(struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us)
{
    vehicle->system = vehicle->expected = system;
    vehicle->expected_until_us = now_us + STARTED_US;
    vehicle->begun_us = vehicle->last_us = vehicle->kept_us = now_us;
    vehicle->armed = vehicle->seen_disarmed = vehicle->settled = armed;
}

/* ---- ground stations ---- */

void vehicle_heard_ground_station(struct vehicle *vehicle, uint8_t system)
{
    vehicle->ground_stations[system / 8] |= (uint8_t)(1 << (system % 8));
}

bool vehicle_is_ground_station(const struct vehicle *vehicle, uint8_t system)
{
    return vehicle->ground_stations[system / 8] >> (system % 8) & 1;
}

/* ---- which one it is ---- */

static bool may_return(const struct vehicle *vehicle, uint8_t system)
{
    return system != 0 && (system == vehicle->kept || system == vehicle->expected);
}

bool vehicle_is(const struct vehicle *vehicle, uint8_t system)
{
    return (system != 0 && system == vehicle->system) || may_return(vehicle, system);
}

bool vehicle_is_settled(const struct vehicle *vehicle)
{
    return vehicle->settled;
}

/* It was seen on the ground, and is armed since: nobody passes by like that. */
static bool flies(const struct vehicle *vehicle)
{
    return vehicle->settled && vehicle->seen_disarmed && vehicle->armed;
}

static bool was_heard(const struct vehicle *vehicle)
{
    return vehicle->heartbeat_us != INT64_MIN;
}

static bool is_silent_for(const struct vehicle *vehicle, int64_t for_us, int64_t now_us)
{
    return now_us - vehicle->last_us >= for_us;
}

/* One HEARTBEAT of a stray voice, heard again in flight, brings nobody back. */
static bool speaks_again(const struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    const struct vehicle_return *returns = &vehicle->returns;

    return returns->system == system && now_us - returns->last_us <= PASSED_BY_US &&
           returns->last_us - returns->begun_us >= SETTLED_US;
}

/* The kept one whatever the other one says meanwhile; who is only expected not from one that flies
 * and speaks. */
static bool returns(const struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    bool from_stray = !vehicle->settled && !may_return(vehicle, vehicle->system);

    return from_stray || is_silent_for(vehicle, SILENT_US, now_us) ||
           (speaks_again(vehicle, system, now_us) && (!flies(vehicle) || system == vehicle->kept));
}

/* Who returned took its place, or somebody under that one's number did. */
static bool left_returns(const struct vehicle *vehicle, int64_t now_us)
{
    return is_silent_for(vehicle, SILENT_US, now_us) && (vehicle->left.flew || !flies(vehicle));
}

/* A changed system id, after a long silence and on the ground; not a ground station's, once there
 * was a vehicle. */
static bool is_changed(const struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us)
{
    if (!was_heard(vehicle)) { /* nor is the one of the last power-on */
        return !vehicle->armed && is_silent_for(vehicle, SILENT_US, now_us);
    }
    return !vehicle->armed && !armed && !vehicle_is_ground_station(vehicle, system) &&
           is_silent_for(vehicle, FORGOTTEN_US, now_us);
}

static bool passed_by(const struct vehicle *vehicle, int64_t now_us)
{
    return was_heard(vehicle) && !vehicle->settled && is_silent_for(vehicle, PASSED_BY_US, now_us);
}

/* Is this HEARTBEAT, of another system than the vehicle, the vehicle's from now on? */
static bool takes_over(const struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us)
{
    if (vehicle->system == 0) {
        return true;
    }
    if (may_return(vehicle, system) && returns(vehicle, system, now_us)) {
        return true;
    }
    if (system == vehicle->left.system && left_returns(vehicle, now_us)) {
        return true;
    }
    return (passed_by(vehicle, now_us) && !vehicle_is_ground_station(vehicle, system)) ||
           is_changed(vehicle, system, armed, now_us);
}

static void replace(struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    struct vehicle_left left = vehicle->left;
    bool returned = system == left.system;

    if (vehicle->settled) {
        vehicle->left = (struct vehicle_left){.system = vehicle->system,
                                              .seen_disarmed = vehicle->seen_disarmed,
                                              .flew = flies(vehicle)};
    }
    vehicle->system = system;
    vehicle->seen_disarmed = returned && left.seen_disarmed;
    vehicle->settled = returned && left.flew;
    vehicle->begun_us = vehicle->last_us = now_us;
    vehicle->returns.system = 0;
}

static void hear(struct vehicle *vehicle, int64_t now_us)
{
    if (!was_heard(vehicle) || now_us - vehicle->last_us > BREAK_US) {
        vehicle->begun_us = now_us;
    }
    vehicle->last_us = now_us;
    vehicle->settled = vehicle->settled || now_us - vehicle->begun_us >= SETTLED_US;
}

/* Who was there first: nobody's any more who has been silent for longer than any start takes, once
 * another one flies. */
static void keep(struct vehicle *vehicle, int64_t now_us)
{
    bool is_expected = vehicle->system == vehicle->expected && vehicle->settled;
    bool first = vehicle->kept == 0 && vehicle->settled &&
                 (vehicle->expected == 0 || now_us >= vehicle->expected_until_us);
    bool instead = flies(vehicle) && now_us - vehicle->kept_us >= STARTED_US;

    if (is_expected || first || instead || vehicle->kept == vehicle->system) {
        vehicle->kept = vehicle->system;
        vehicle->kept_us = now_us;
    }
    if (is_expected || (flies(vehicle) && vehicle->kept == vehicle->system)) {
        vehicle->expected = 0;
    }
}

enum vehicle_is vehicle_heartbeat(struct vehicle *vehicle, uint8_t system, bool armed,
                                  int64_t now_us)
{
    bool other = system != vehicle->system;

    if (other) {
        if (!takes_over(vehicle, system, armed, now_us)) {
            return VEHICLE_ANOTHER;
        }
        replace(vehicle, system, now_us);
    }
    hear(vehicle, now_us);
    vehicle->heartbeat_us = now_us;
    vehicle->seen_disarmed = vehicle->seen_disarmed || !armed;
    vehicle->armed = armed;
    keep(vehicle, now_us);
    /* A system with an autopilot is no ground station, whatever else of it said so. */
    vehicle->ground_stations[system / 8] &= (uint8_t) ~(1 << (system % 8));
    return other ? VEHICLE_NEW : VEHICLE_KNOWN;
}

static void hear_returning(struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    struct vehicle_return *returns = &vehicle->returns;

    if (returns->system != system || now_us - returns->last_us > PASSED_BY_US) {
        returns->system = system;
        returns->begun_us = now_us;
    }
    returns->last_us = now_us;
}

/* Its HEARTBEATs may be lost, or kept from us. */
void vehicle_speaks(struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    if (system == vehicle->system) {
        hear(vehicle, now_us);
    } else if (may_return(vehicle, system)) {
        hear_returning(vehicle, system, now_us);
    }
}
