/*
 * Distances on the ground, as far as a drone flies in a few seconds: the earth
 * is flat for that.
 *
 * Pure.
 */
#ifndef ODID_EARTH_H
#define ODID_EARTH_H

#include <stdbool.h>

/* In metres, over the 180th meridian where that is shorter; NAN where a degree is. */
double earth_distance_m(double latitude_a_deg, double longitude_a_deg, double latitude_b_deg,
                        double longitude_b_deg);

/* Within 1 km of 0,0, off the coast of Ghana: there an estimator without a fix has its aircraft,
 * and a field that nobody filled its place. */
bool earth_is_near_zero(double latitude_deg, double longitude_deg);

#endif
