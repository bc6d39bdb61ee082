#include "base/earth.h"

#include <math.h>

#define METRES_PER_DEGREE 111320.0
#define NEAR_ZERO_M 1000.0

double earth_distance_m(double latitude_a_deg, double longitude_a_deg, double latitude_b_deg,
                        double longitude_b_deg)
{
    double east_deg =
        remainder(longitude_b_deg - longitude_a_deg, 360) * cos(latitude_b_deg * M_PI / 180);

    return hypot(latitude_b_deg - latitude_a_deg, east_deg) * METRES_PER_DEGREE;
}

bool earth_is_near_zero(double latitude_deg, double longitude_deg)
{
    return earth_distance_m(latitude_deg, longitude_deg, 0, 0) < NEAR_ZERO_M;
}
