/*
 * The vehicle: the MAVLink system whose autopilot's word counts, chosen among all
 * that say HEARTBEAT on the lines that are read. The first one, unless it was a stray
 * voice; the one of the last power-on, while it may still be starting; another one only
 * after a long silence, and on the ground.
 *
 * Pure: is given the HEARTBEATs and the time. Instants are our own clock's, in microseconds.
 */
#ifndef ODID_VEHICLE_H
#define ODID_VEHICLE_H

#include <stdbool.h>
#include <stdint.h>

struct vehicle {
    uint8_t system;       /* MAVLink's system id; 0: none yet */
    bool armed;           /* its last word */
    bool seen_disarmed;   /* it said so before */
    bool settled;         /* it was heard for a while without a break: no stray voice */
    int64_t begun_us;     /* since when it is heard without a break */
    int64_t heartbeat_us; /* its last HEARTBEAT; INT64_MIN: none */
    int64_t last_us;      /* its last frame */
    /* Who may return, while another one is the vehicle; 0: nobody. */
    uint8_t expected;          /* of the last power-on, and not settled since */
    int64_t expected_until_us; /* until then nobody else is kept */
    uint8_t kept;              /* who was there first */
    int64_t kept_us;           /* when it was the vehicle last */
    struct vehicle_return {    /* one of these two says more than HEARTBEATs, without a break */
        uint8_t system;
        int64_t begun_us, last_us;
    } returns;
    struct vehicle_left { /* whose place was taken last, of those that were settled */
        uint8_t system;
        bool seen_disarmed, flew;
    } left;
    uint8_t ground_stations[256 / 8]; /* system ids that sent a ground station's HEARTBEAT */
};

enum vehicle_is { VEHICLE_ANOTHER, VEHICLE_KNOWN, VEHICLE_NEW };

void vehicle_init(struct vehicle *vehicle);

/* Of the last power-on, or before a restart of ours; system 0: nobody is expected. */
void vehicle_expect(struct vehicle *vehicle, uint8_t system, bool armed, int64_t now_us);

/*
 * A HEARTBEAT of a system's autopilot (component 1, of a type that flies; the vehicle's, of any):
 * is it the vehicle's? VEHICLE_NEW: from now on, and another one's, or nobody's, before.
 */
enum vehicle_is vehicle_heartbeat(struct vehicle *vehicle, uint8_t system, bool armed,
                                  int64_t now_us);

/* Is that system the vehicle, or the one that was there first and may return? */
bool vehicle_is(const struct vehicle *vehicle, uint8_t system);

/* Anything else of an autopilot: as long as the vehicle's comes no other system takes its place,
 * but the one that was there first. */
void vehicle_speaks(struct vehicle *vehicle, uint8_t system, int64_t now_us);

/* Is it there to stay, and no stray voice? */
bool vehicle_is_settled(const struct vehicle *vehicle);

/* A HEARTBEAT of a ground station; a system that has an autopilot is none any more. */
void vehicle_heard_ground_station(struct vehicle *vehicle, uint8_t system);
bool vehicle_is_ground_station(const struct vehicle *vehicle, uint8_t system);

#endif
