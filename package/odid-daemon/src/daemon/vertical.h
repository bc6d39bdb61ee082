/*
 * Which way is up: ArduPilot before September 2018 (its pull request 7672)
 * sends GLOBAL_POSITION_INT.vz positive up, MAVLink has it positive down.
 *
 * Pure. The version isn't asked, the evidence is: what the altitude does while
 * the aircraft climbs or sinks by more than 1 m/s, and VFR_HUD's climb rate,
 * which was right in every version. Each second one vote.
 */
#ifndef ODID_VERTICAL_H
#define ODID_VERTICAL_H

#include <stdbool.h>
#include <stdint.h>

struct vertical {
    bool inverted; /* the autopilot sends it upside down */
    int votes;     /* for upright, -VERTICAL_VOTES to VERTICAL_VOTES */
    bool begun;
    int64_t from_us; /* of the second that is looked at: when it began, by the autopilot's clock */
    double from_m, sum_mps, climb_mps;
    unsigned positions;
    int64_t newest_us, climb_us; /* the newest position's instant; that when a climb rate came */
};

/* So many votes more for one way than for the other decide. */
#define VERTICAL_VOTES 3

/* Freshly zeroed: MAVLink's way. */

/* As it was decided before a restart of ours. */
void vertical_restore(struct vertical *vertical, bool inverted);

/* One GLOBAL_POSITION_INT: its own time, its altitude, its vertical speed as MAVLink has it. */
void vertical_position(struct vertical *vertical, int64_t at_us, double altitude_m, double up_mps);

/* One VFR_HUD. */
void vertical_climb(struct vertical *vertical, double climb_mps);

/* A vertical speed as it is, up positive. */
double vertical_upright_mps(const struct vertical *vertical, double up_mps);

#endif
