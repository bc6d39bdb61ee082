#include "daemon/vertical.h"

#include <math.h>

#define WINDOW_US 1000000
#define GAP_US 3000000 /* nothing is known of what it did meanwhile */
#define MOVES_MPS 1.0
#define CLIMB_AGE_MAX_US 3000000 /* one that is older is no witness */

static bool moves(double speed_mps)
{
    return isfinite(speed_mps) && fabs(speed_mps) > MOVES_MPS;
}

static void vote(struct vertical *vertical, double known_mps, double said_mps)
{
    if (!moves(known_mps) || !moves(said_mps)) {
        return;
    }
    vertical->votes += (known_mps > 0) == (said_mps > 0) ? 1 : -1;
    if (vertical->votes >= VERTICAL_VOTES) {
        vertical->votes = VERTICAL_VOTES;
        vertical->inverted = false;
    } else if (vertical->votes <= -VERTICAL_VOTES) {
        vertical->votes = -VERTICAL_VOTES;
        vertical->inverted = true;
    }
}

void vertical_restore(struct vertical *vertical, bool inverted)
{
    vertical->inverted = inverted;
    vertical->votes = inverted ? -VERTICAL_VOTES : 0;
}

static bool climb_known(const struct vertical *vertical, int64_t at_us)
{
    int64_t age_us = at_us - vertical->climb_us;

    return age_us >= 0 && age_us < CLIMB_AGE_MAX_US && moves(vertical->climb_mps);
}

static void begin_window(struct vertical *vertical, int64_t at_us, double altitude_m)
{
    vertical->begun = true;
    vertical->from_us = at_us;
    vertical->from_m = altitude_m;
    vertical->sum_mps = 0;
    vertical->positions = 0;
}

void vertical_position(struct vertical *vertical, int64_t at_us, double altitude_m, double up_mps)
{
    int64_t window_us = at_us - vertical->from_us;

    vertical->newest_us = at_us;
    if (!vertical->begun || window_us < 0 || window_us > GAP_US) {
        begin_window(vertical, at_us, altitude_m);
        return;
    }
    vertical->sum_mps += up_mps;
    vertical->positions++;
    if (window_us >= WINDOW_US) {
        double said_mps = vertical->sum_mps / vertical->positions;
        double rose_mps = (altitude_m - vertical->from_m) / ((double)window_us * 1e-6);

        /* Where the two witnesses contradict each other, neither is heard. */
        if (!climb_known(vertical, at_us) || (vertical->climb_mps > 0) == (rose_mps > 0)) {
            vote(vertical, rose_mps, said_mps);
        }
        begin_window(vertical, at_us, altitude_m);
    }
}

void vertical_climb(struct vertical *vertical, double climb_mps)
{
    vertical->climb_mps = climb_mps;
    vertical->climb_us = vertical->newest_us;
}

double vertical_upright_mps(const struct vertical *vertical, double up_mps)
{
    return vertical->inverted ? -up_mps : up_mps;
}
