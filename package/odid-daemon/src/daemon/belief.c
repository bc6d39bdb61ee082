#include "daemon/belief.h"

#include "base/earth.h"
#include "daemon/autopilot_clock.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PATIENCE_MIN_US 1000000
#define PATIENCE_MAX_US 5000000
#define PATIENCE_INTERVALS 3

/* A message that was overtaken on the way is no other clock's; positions that old aren't taken. */
#define BEHIND_MS (-1000)
#define NATIVE_BEHIND_MS (-3000)
#define HOUR_MS 3600000
/* No message comes before it was sent, but for what clocks drift (200 ppm); the least delay that
 * was seen is not the least that there is, and a recorded flight was refused for being 70 ms ahead
 * of it ... */
#define AHEAD_US 600000
#define DRIFT 2e-4
/* ... and until the least delay is known: what was held up on the way comes at the beginning. */
#define SETTLED_US 20000000
#define UNSETTLED_AHEAD_US 1000000

/* The fastest that Remote ID knows, and what an estimator may jump; delays differ. */
#define SPEED_MAX_MPS 254.25
#define JUMP_MAX_M 30.0
#define DELAY_S 0.2
#define JUMP_FULL_M (JUMP_MAX_M + SPEED_MAX_MPS * DELAY_S)
#define ALTITUDES_DIFFER_M 150.0
#define FIX_FRESH_US 3000000 /* a receiver says so once a second */
#define FIX_TYPE_2D 2        /* GPS_FIX_TYPE */
#define FIX_TYPE_3D 3
/* The geoid changes by metres over tens of kilometres: so fast under the fastest aircraft. */
#define SEPARATION_STEP_MAX_M 5.0
#define SEPARATION_MPS 0.05
/* Another place is confirmed by one that comes within this time, and was flown to from there. */
#define CONFIRMED_US 15000000

#define UTC_STEP_MAX_US 100000
#define ONE_BATCH_US 20000 /* what came at once wasn't said at once */

void belief_reset(struct belief *belief)
{
    uint64_t contradictions = belief->contradictions;

    memset(belief, 0, sizeof(*belief));
    belief->contradictions = contradictions;
    belief->no_fix_us = belief->second_fix_us = belief->telemetry_us = INT64_MIN;
    belief->altitude[0].at_us = belief->altitude[1].at_us = INT64_MIN;
    for (unsigned i = 0; i < BELIEF_FAULT_COUNT; i++) {
        belief->contradicted_us[i] = INT64_MIN;
    }
}

static void contradict(struct belief *belief, int64_t now_us)
{
    belief->contradicted_us[belief->contradictions % BELIEF_FAULT_COUNT] = now_us;
    belief->contradictions++;
}

bool belief_contradicted(const struct belief *belief, int64_t now_us)
{
    for (unsigned i = 0; i < BELIEF_FAULT_COUNT; i++) {
        int64_t at_us = belief->contradicted_us[i];

        if (at_us == INT64_MIN || now_us - at_us >= BELIEF_FAULT_US) {
            return false;
        }
    }
    return true;
}

static bool patient(const struct belief_track *track, int64_t now_us)
{
    int64_t patience_us = PATIENCE_INTERVALS * track->interval_us;

    if (patience_us < PATIENCE_MIN_US) {
        patience_us = PATIENCE_MIN_US;
    } else if (patience_us > PATIENCE_MAX_US) {
        patience_us = PATIENCE_MAX_US;
    }
    return now_us - track->heard_us < patience_us;
}

enum word { CONTINUED, ANOTHER, REFUSED };

/* fits: the word continues what is believed. ANOTHER: it is what is believed from now on. */
static enum word hear(struct belief *belief, struct belief_track *track, bool fits, int64_t now_us)
{
    bool another = !track->known || !fits;

    if (track->known && !fits && patient(track, now_us)) {
        track->other_seen = true;
        return REFUSED;
    }
    if (!another) {
        if (track->other_seen) { /* there it is again: both go on */
            contradict(belief, now_us);
        }
        track->interval_us += (now_us - track->heard_us - track->interval_us) / 4;
    }
    track->known = true;
    track->other_seen = false;
    track->heard_us = now_us;
    return another ? ANOTHER : CONTINUED;
}

/* ---- clocks ---- */

/* wrap_ms: 0 for 2^32. */
static int64_t clock_step_ms(const struct belief_clock *clock, uint32_t at_ms, int32_t wrap_ms)
{
    int64_t step_ms;

    if (wrap_ms == 0) {
        return (int32_t)(at_ms - clock->last_ms);
    }
    step_ms = ((int64_t)at_ms - clock->last_ms) % wrap_ms;
    step_ms += step_ms < -wrap_ms / 2 ? wrap_ms : 0;
    return step_ms > wrap_ms / 2 ? step_ms - wrap_ms : step_ms;
}

static bool clock_fits(const struct belief_clock *clock, int64_t step_ms, int32_t wrap_ms,
                       int64_t now_us)
{
    int64_t delay_us = now_us - (clock->last_us + step_ms * 1000) - clock->offset_us;
    int64_t ahead_us = now_us - clock->since_us < SETTLED_US ? UNSETTLED_AHEAD_US : AHEAD_US;

    ahead_us += (int64_t)((double)(now_us - clock->track.heard_us) * DRIFT);
    return step_ms >= (wrap_ms == 0 ? BEHIND_MS : NATIVE_BEHIND_MS) && delay_us >= -ahead_us;
}

struct clock_word {
    struct belief_clock *clock;
    uint32_t at_ms;
    int32_t wrap_ms; /* 0 for 2^32 */
    int64_t step_ms;
    bool fits;
};

static struct clock_word clock_word(struct belief_clock *clock, uint32_t at_ms, int32_t wrap_ms,
                                    int64_t now_us)
{
    int64_t step_ms = clock_step_ms(clock, at_ms, wrap_ms);

    return (struct clock_word){clock, at_ms, wrap_ms, step_ms,
                               clock->track.known && clock_fits(clock, step_ms, wrap_ms, now_us)};
}

/* The least delayed arrival tells how the clocks lie; but whoever comes a little early each time
 * would lead it away from the one that is believed, so once it is known it follows as clocks drift.
 */
static void follow(struct belief_clock *clock, int64_t at_us, int64_t before_us, int64_t now_us)
{
    int64_t drifted_us = (int64_t)((double)(now_us - before_us) * DRIFT);
    int64_t offset_us = now_us - at_us;

    if (offset_us >= clock->offset_us + drifted_us) {
        clock->offset_us += drifted_us;
    } else if (now_us - clock->since_us < SETTLED_US ||
               offset_us >= clock->offset_us - drifted_us) {
        clock->offset_us = offset_us;
    } else {
        clock->offset_us -= drifted_us;
    }
}

static bool hear_clock(struct belief *belief, const struct clock_word *word, int64_t now_us)
{
    struct belief_clock *clock = word->clock;
    int64_t before_us = clock->track.heard_us;

    switch (hear(belief, &clock->track, word->fits, now_us)) {
    case REFUSED:
        return false;
    case ANOTHER:
        clock->last_us = (int64_t)word->at_ms * 1000;
        clock->offset_us = now_us - clock->last_us;
        clock->since_us = now_us;
        break;
    case CONTINUED:
        follow(clock, clock->last_us + word->step_ms * 1000, before_us, now_us);
        if (word->step_ms <= 0) {
            return true; /* overtaken: the next one isn't measured by it */
        }
        clock->last_us += word->step_ms * 1000;
        break;
    }
    clock->last_ms = word->at_ms;
    return true;
}

/* Would it be? Then what else it says must not count either. */
static bool refuses(const struct belief_track *track, bool fits, int64_t now_us)
{
    return track->known && !fits && patient(track, now_us);
}

/* ---- places ---- */

static double distance_m(const struct belief_place *a, const struct belief_place *b)
{
    return earth_distance_m(a->latitude_deg, a->longitude_deg, b->latitude_deg, b->longitude_deg);
}

/* What climbs faster than it flies: two sources' altitudes are above different things, so between
 * them a hundred metres say nothing. */
static double climb_m(const struct belief_place *a, const struct belief_place *b)
{
    double differ_m = a->native == b->native ? 0 : ALTITUDES_DIFFER_M;
    double climbed_m = fabs(b->altitude_m - a->altitude_m) - differ_m;

    return climbed_m > 0 ? climbed_m : 0; /* not when one is unknown */
}

/* What is left of jump_m after that way; negative: no aircraft flies so. Of the time in between it
 * earns at most what it flies: a thousand steps in one instant are one. */
static double jump_left_m(double jump_m, const struct belief_place *from,
                          const struct belief_place *to)
{
    double time_s = (double)(to->at_us - from->at_us) * 1e-6;

    return fmin(jump_m + SPEED_MAX_MPS * time_s - distance_m(from, to) - climb_m(from, to),
                JUMP_FULL_M);
}

/* The last believed place, with the last altitude of the same kind: what can have been climbed
 * since that one was said is taken off. */
static struct belief_place last_place(const struct belief *belief, const struct belief_place *next)
{
    struct belief_place from = belief->at;
    const struct belief_altitude *same = &belief->altitude[next->native];
    double since_s, climbed_m;

    if (same->at_us == INT64_MIN || isnan(next->altitude_m)) {
        return from;
    }
    since_s = (double)(from.at_us - same->at_us) * 1e-6;
    climbed_m = next->altitude_m - same->metres;
    from.native = next->native;
    from.altitude_m =
        same->metres + copysign(fmin(fabs(climbed_m), SPEED_MAX_MPS * since_s), climbed_m);
    return from;
}

static bool can_fly(const struct belief_place *from, const struct belief_place *to)
{
    return jump_left_m(JUMP_FULL_M, from, to) >= 0;
}

/* Was it said before, about there? */
static bool confirmed(struct belief *belief, const struct belief_place *place)
{
    struct belief_place before = belief->another;

    belief->another = *place;
    return before.at_us != 0 && place->at_us - before.at_us < CONFIRMED_US &&
           can_fly(&before, place);
}

/* Another receiver may have one. */
static bool second_fix(const struct belief *belief, int64_t now_us)
{
    return belief->second_fix_us != INT64_MIN && now_us - belief->second_fix_us < FIX_FRESH_US;
}

static bool has_no_fix(const struct belief *belief, int64_t now_us)
{
    return belief->no_fix && now_us - belief->no_fix_us < FIX_FRESH_US &&
           !second_fix(belief, now_us);
}

/* No place begins while anybody says that there is no fix: the real one may be who says so. Nor
 * while two sources speak: nobody was there first. */
static bool may_begin(const struct belief *belief, int64_t now_us)
{
    if (belief_contradicted(belief, now_us)) {
        return false;
    }
    return belief->no_fix_us == INT64_MIN || second_fix(belief, now_us) ||
           now_us - belief->no_fix_us >= PATIENCE_MIN_US + PATIENCE_MIN_US / 2;
}

static bool hear_place(struct belief *belief, const struct belief_place *place,
                       const struct clock_word *clock, int64_t now_us)
{
    struct belief_track *track = &belief->place;
    bool nowhere =
        has_no_fix(belief, now_us) || earth_is_near_zero(place->latitude_deg, place->longitude_deg);
    struct belief_place from = last_place(belief, place);
    double left_m = track->known ? jump_left_m(belief->jump_m, &from, place) : -1;
    bool fits = left_m >= 0;

    if (clock != NULL && refuses(&clock->clock->track, clock->fits, now_us)) {
        return hear_clock(belief, clock, now_us);
    }
    /* Once a place is believed, every other one has to be flown to, whatever is said of fixes. */
    if (isnan(place->latitude_deg) || (nowhere && !track->known)) {
        return clock == NULL || hear_clock(belief, clock, now_us); /* it doesn't say where it is */
    }
    if (!track->known && !may_begin(belief, now_us)) {
        return false;
    }
    if (track->known && !fits && !confirmed(belief, place)) {
        track->other_seen = true;
        return false;
    }
    if (hear(belief, track, fits, now_us) == REFUSED) {
        return false;
    }
    belief->at = *place;
    if (!isnan(place->altitude_m)) {
        belief->altitude[place->native] = (struct belief_altitude){place->altitude_m, now_us};
    }
    belief->jump_m = fits ? left_m : JUMP_FULL_M;
    return clock == NULL || hear_clock(belief, clock, now_us);
}

/* ---- UTC ---- */

static bool hear_utc(struct belief *belief, uint64_t *unix_us, uint32_t boot_ms, int64_t now_us)
{
    int64_t offset_us, step_us, drifted_us = 0;
    bool fits;

    if (!autopilot_clock_plausible(*unix_us)) {
        *unix_us = 0; /* it says nothing of UTC, to nobody */
        return true;
    }
    if (has_no_fix(belief, now_us) && !belief->utc.known) {
        return true; /* whoever has a fix all the same knows what it is worth */
    }
    offset_us = (int64_t)*unix_us - (int64_t)boot_ms * 1000;
    step_us = offset_us - belief->utc_offset_us;
    fits = belief->utc.known && llabs(step_us) <= UTC_STEP_MAX_US;
    if (fits) { /* it follows as clocks drift, and not whoever is a little ahead each time */
        drifted_us = (int64_t)((double)(now_us - belief->utc.heard_us) * DRIFT);
    }
    if (hear(belief, &belief->utc, fits, now_us) == REFUSED) {
        return false;
    }
    if (!fits || llabs(step_us) <= drifted_us) {
        belief->utc_offset_us = offset_us;
    } else {
        belief->utc_offset_us += step_us > 0 ? drifted_us : -drifted_us;
    }
    return true;
}

/* ---- fixes ---- */

/* How far the ellipsoid is above the geoid there: another source's word for it is left out. */
static void hear_geoid(struct belief *belief, double *separation_m, int64_t now_us)
{
    double step_m = *separation_m - belief->separation_m, slope_m = 0;
    bool fits = belief->geoid.known && fabs(step_m) <= SEPARATION_STEP_MAX_M;

    if (isnan(*separation_m)) {
        return;
    }
    if (fits) {
        slope_m = SEPARATION_MPS * (double)(now_us - belief->geoid.heard_us) * 1e-6;
    }
    if (hear(belief, &belief->geoid, fits, now_us) == REFUSED) {
        *separation_m = NAN;
    } else if (!fits || fabs(step_m) <= slope_m) {
        belief->separation_m = *separation_m;
    } else {
        belief->separation_m += step_m > 0 ? slope_m : -slope_m;
    }
}

/*
 * The track is that of a receiver's words for a fix. A receiver at the edge of
 * one has it now and then, which is no contradiction; but it doesn't lose it
 * right after it said that it has one, and find it again. As long as nobody
 * contradicts, "no fix" counts at once; else when no other word comes any more,
 * for it would take the aircraft's position off the air.
 */
static bool hear_fix(struct belief *belief, struct telemetry_update *update, int64_t now_us)
{
    struct belief_track *track = &belief->fix;
    int64_t since_us = now_us - track->heard_us;
    uint8_t fix_type = update->gps_raw.fix_type;

    if (fix_type < FIX_TYPE_2D) {
        belief->no_fix_us = now_us;
        track->other_seen =
            track->other_seen || (since_us > ONE_BATCH_US && since_us < track->interval_us / 4);
        if (track->known && patient(track, now_us) && belief_contradicted(belief, now_us)) {
            return false;
        }
        belief->no_fix = true;
        return true;
    }
    belief->no_fix = false;
    hear(belief, track, since_us < PATIENCE_MAX_US, now_us);
    if (fix_type >= FIX_TYPE_3D) {
        hear_geoid(belief, &update->gps_raw.separation_m, now_us);
    }
    return true;
}

/* ---- all of it ---- */

/* By so much a believed stamp is ahead of what can have been sent by now: who stamps ahead, as far
 * as delays differ, makes the next ones of the real one look older than his. */
static uint32_t ahead_ms(const struct belief *belief, uint32_t boot_ms, int64_t now_us)
{
    int64_t ahead_us = belief->boot.last_us - (now_us - belief->boot.offset_us);

    return boot_ms == belief->boot.last_ms && ahead_us > 0 ? (uint32_t)(ahead_us / 1000) : 0;
}

static bool take_position(struct belief *belief, struct telemetry_update *update, int64_t now_us)
{
    struct clock_word clock = clock_word(&belief->boot, update->global_position.boot_ms, 0, now_us);
    struct belief_place place = {update->global_position.latitude_deg,
                                 update->global_position.longitude_deg,
                                 update->global_position.altitude_msl_m, now_us, false};

    if (!hear_place(belief, &place, &clock, now_us)) {
        return false;
    }
    update->global_position.boot_ms -= ahead_ms(belief, update->global_position.boot_ms, now_us);
    belief->telemetry_us = isnan(place.latitude_deg) ? belief->telemetry_us : now_us;
    return true;
}

static bool take_native(struct belief *belief, const struct telemetry_update *update,
                        int64_t now_us)
{
    bool dated = !isnan(update->location.timestamp_s);
    struct clock_word clock =
        clock_word(&belief->native, dated ? (uint32_t)(update->location.timestamp_s * 1000) : 0,
                   HOUR_MS, now_us);
    struct belief_place place = {update->location.latitude_deg, update->location.longitude_deg,
                                 update->location.altitude_geodetic_m, now_us, true};
    struct belief_place from = last_place(belief, &place);

    /* An estimator and a receiver may drift apart, both the autopilot's: telemetry's place counts,
     * and nobody is accused. */
    if (belief->telemetry_us != INT64_MIN && now_us - belief->telemetry_us < PATIENCE_MAX_US &&
        belief->place.known && jump_left_m(belief->jump_m, &from, &place) < 0) {
        return false;
    }
    return hear_place(belief, &place, dated ? &clock : NULL, now_us);
}

static bool take_time(struct belief *belief, struct telemetry_update *update, int64_t now_us)
{
    struct clock_word clock = clock_word(&belief->boot, update->system_time.boot_ms, 0, now_us);
    uint32_t ahead;

    if (refuses(&belief->boot.track, clock.fits, now_us)) {
        return hear_clock(belief, &clock, now_us);
    }
    if (!hear_utc(belief, &update->system_time.unix_us, update->system_time.boot_ms, now_us) ||
        !hear_clock(belief, &clock, now_us)) {
        return false;
    }
    ahead = ahead_ms(belief, update->system_time.boot_ms, now_us);
    update->system_time.boot_ms -= ahead;
    update->system_time.unix_us -= update->system_time.unix_us != 0 ? ahead * UINT64_C(1000) : 0;
    return true;
}

bool belief_take(struct belief *belief, struct telemetry_update *update, int64_t now_us)
{
    switch (update->kind) {
    case TELEMETRY_GLOBAL_POSITION:
        return take_position(belief, update, now_us);
    case TELEMETRY_SYSTEM_TIME:
        return take_time(belief, update, now_us);
    case TELEMETRY_GPS_RAW:
        return hear_fix(belief, update, now_us);
    case TELEMETRY_GPS2_RAW:
        if (update->gps_raw.fix_type >= FIX_TYPE_2D) {
            belief->second_fix_us = now_us;
        }
        return true;
    case TELEMETRY_LOCATION:
        return take_native(belief, update, now_us);
    default:
        return true;
    }
}

/* ---- what else tells ---- */

void belief_sequence(struct belief *belief, uint8_t sequence, bool again, int64_t now_us)
{
    if (frame_numbers_follow(&belief->numbers, sequence, again, now_us)) {
        contradict(belief, now_us);
    }
    /* Else the other one's steps count, too. */
    frame_numbers_pass(&belief->numbers, sequence, !belief_contradicted(belief, now_us), now_us);
}

void belief_new_link(struct belief *belief)
{
    belief->numbers.known = false;
}
