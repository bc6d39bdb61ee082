#include "daemon/vehicle.h"

#include <string.h>

/* A vehicle that was silent for this long may be another one: a changed SYSID, another aircraft. */
#define FORGOTTEN_US 10000000
#define EXPECTED_US 3000000 /* three of its HEARTBEATs */
/* Who is heard for so long is there to stay; who falls silent before, for longer than a HEARTBEAT's
 * second, was a stray voice. */
#define SETTLED_US 3000000
#define PASSED_BY_US 1500000
/* An autopilot has started by then; one that is expected still isn't there. */
#define STARTED_US 60000000

void vehicle_init(struct vehicle *vehicle)
{
    memset(vehicle, 0, sizeof(*vehicle));
    vehicle->heartbeat_us = vehicle->returned_us = vehicle->expected_until_us = INT64_MIN;
}

void vehicle_expect(struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us)
{
    vehicle->system = vehicle->expected = system;
    vehicle->expected_until_us = now_us + STARTED_US;
    vehicle->begun_us = vehicle->last_us = now_us;
    vehicle->armed = armed;
    vehicle->until_us = now_us + EXPECTED_US;
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

/* It was seen on the ground, and is armed since: nobody passes by like that. */
static bool took_off_here(const struct vehicle *vehicle, int64_t now_us)
{
    return vehicle->seen_disarmed && vehicle->armed && now_us >= vehicle->expected_until_us;
}

bool vehicle_is_settled(const struct vehicle *vehicle)
{
    return vehicle->last_us - vehicle->begun_us >= SETTLED_US;
}

/* Nobody who is kept or expected does. */
static bool passed_by(const struct vehicle *vehicle, int64_t now_us)
{
    return vehicle->kept == 0 && vehicle->system != vehicle->expected &&
           vehicle->heartbeat_us != INT64_MIN && !vehicle_is_settled(vehicle) &&
           now_us - vehicle->last_us > PASSED_BY_US;
}

bool vehicle_is(const struct vehicle *vehicle, uint8_t system)
{
    return system != 0 &&
           (system == vehicle->system || system == vehicle->kept || system == vehicle->expected);
}

/* The one that was there first has been silent for longer than any start takes. (In the air nobody
 * takes its place.) */
static bool is_given_up(const struct vehicle *vehicle, int64_t now_us)
{
    return now_us - vehicle->kept_us >= STARTED_US;
}

/* One HEARTBEAT of a stray voice, heard again in flight, brings nobody back. */
static bool has_returned(const struct vehicle *vehicle, int64_t now_us)
{
    return vehicle->returned_us != INT64_MIN && now_us - vehicle->returned_us <= PASSED_BY_US &&
           vehicle->returned_us - vehicle->returns_us >= SETTLED_US;
}

static bool is_silent(const struct vehicle *vehicle, int64_t now_us)
{
    return now_us - vehicle->last_us > EXPECTED_US;
}

/* Seen on the ground, and armed since: also in the first minute nobody else is expected any more.
 */
static bool is_the_one_that_flies(const struct vehicle *vehicle)
{
    return vehicle->armed && vehicle->seen_disarmed && vehicle_is_settled(vehicle);
}

/*
 * Is this heartbeat, of another system than the vehicle, the vehicle's from now
 * on? Where that one has only passed by: yes. One that is expected, of the last power-on, is it at
 * once, but not once another one flies. The kept one returns when the vehicle is silent, or once it
 * has said more than HEARTBEATs for a while, and leaves it to who took off here, or to who was it
 * before one HEARTBEAT of an old id, when it is silent again. Another one is a changed system id,
 * after a long silence and on the ground; not a ground station's, once there was a vehicle.
 */
static bool takes_over(const struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us)
{
    bool none_yet = vehicle->heartbeat_us == INT64_MIN;

    if (vehicle->system == 0 ||
        (passed_by(vehicle, now_us) && !vehicle_is_ground_station(vehicle, system))) {
        return true;
    }
    if (system == vehicle->expected) {
        return !is_the_one_that_flies(vehicle);
    }
    if (system == vehicle->kept) {
        return is_silent(vehicle, now_us) || has_returned(vehicle, now_us);
    }
    if (system == vehicle->flies ||
        (system == vehicle->before && !took_off_here(vehicle, now_us))) {
        return is_silent(vehicle, now_us);
    }
    return !vehicle->armed && (!armed || none_yet) &&
           (!vehicle_is_ground_station(vehicle, system) || none_yet) && now_us >= vehicle->until_us;
}

/* Who was there first: nobody's any more who isn't the one that flies. Nor is one expected then. */
static void keep(struct vehicle *vehicle, int64_t now_us)
{
    bool flies = took_off_here(vehicle, now_us), settled = vehicle_is_settled(vehicle);

    if (flies || (settled && vehicle->system == vehicle->expected)) {
        vehicle->expected = 0;
        vehicle->expected_until_us = INT64_MIN;
    }
    if (vehicle->kept == vehicle->system || (flies && is_given_up(vehicle, now_us)) ||
        (vehicle->kept == 0 && settled && now_us >= vehicle->expected_until_us)) {
        vehicle->kept = vehicle->system;
        vehicle->kept_us = now_us;
    }
    if (now_us - vehicle->begun_us >= STARTED_US) {
        vehicle->before = 0;
    }
}

static void replace(struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    uint8_t flies = took_off_here(vehicle, now_us) ? vehicle->system : 0;
    bool seen = system == vehicle->flies || (system == vehicle->before && vehicle->before_disarmed);

    if (vehicle_is_settled(vehicle)) {
        vehicle->before = vehicle->system;
        vehicle->before_disarmed = vehicle->seen_disarmed;
    }
    vehicle->seen_disarmed = seen;
    vehicle->flies = flies;
    vehicle->system = system;
    vehicle->begun_us = now_us;
    vehicle->returned_us = INT64_MIN;
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
    vehicle->heartbeat_us = vehicle->last_us = now_us;
    vehicle->seen_disarmed = vehicle->seen_disarmed || !armed;
    vehicle->armed = armed;
    keep(vehicle, now_us);
    /* A system with an autopilot is no ground station, whatever else of it said so. */
    vehicle->ground_stations[system / 8] &= (uint8_t) ~(1 << (system % 8));
    vehicle->until_us = now_us + FORGOTTEN_US;
    return other ? VEHICLE_NEW : VEHICLE_KNOWN;
}

static void hear_kept(struct vehicle *vehicle, int64_t now_us)
{
    if (vehicle->returned_us == INT64_MIN || now_us - vehicle->returned_us > PASSED_BY_US) {
        vehicle->returns_us = now_us;
    }
    vehicle->returned_us = now_us;
}

/* Its HEARTBEATs may be lost, or kept from us. */
void vehicle_speaks(struct vehicle *vehicle, uint8_t system, int64_t now_us)
{
    if (system == vehicle->system) {
        vehicle->last_us = now_us;
        vehicle->until_us =
            now_us + (vehicle->heartbeat_us == INT64_MIN ? EXPECTED_US : FORGOTTEN_US);
    } else if (system == vehicle->kept) {
        hear_kept(vehicle, now_us);
    }
}
