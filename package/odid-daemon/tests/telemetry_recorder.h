/* Feeds frames to telemetry and keeps what it delivers, for tests. */
#ifndef ODID_TESTS_TELEMETRY_RECORDER_H
#define ODID_TESTS_TELEMETRY_RECORDER_H

#include "daemon/telemetry.h"
#include "mavlink_frames.h"

#define VEHICLE 7
#define OTHER_VEHICLE 9
#define GROUND_STATION 255
#define AUTOPILOT 1
#define SECOND INT64_C(1000000)

static struct telemetry *telemetry;
static struct telemetry_update updates[512];
static unsigned update_count;
static int64_t now_us;

static inline void record(void *context, const struct telemetry_update *update, int64_t at_us)
{
    (void)context;
    (void)at_us;
    if (update_count < sizeof(updates) / sizeof(updates[0])) {
        updates[update_count] = *update;
    }
    update_count++;
}

/* Freshly initialised, nothing heard yet. */
static inline void begin(void)
{
    frames_are(2, false);
    mavlink_get_channel_status(MAVLINK_COMM_0)->current_tx_seq = 0; /* the library's goes on */
    now_us = 1000 * SECOND;
    update_count = 0;
    telemetry = telemetry_init(record, NULL);
}

/* Feeds one frame to a stream. Returns how many updates it gave; the last is in *latest(). */
static inline unsigned feed_to(unsigned stream, struct frame frame)
{
    unsigned before = update_count;

    telemetry_receive(telemetry, stream, frame.bytes, frame.length, now_us);
    return update_count - before;
}

static inline unsigned feed(struct frame frame)
{
    return feed_to(0, frame);
}

static inline const struct telemetry_update *latest(void)
{
    return &updates[update_count - 1];
}

static inline struct frame heartbeat_with_mode(uint8_t system, uint8_t base_mode)
{
    const mavlink_heartbeat_t heartbeat = {.type = MAV_TYPE_QUADROTOR,
                                           .autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA,
                                           .base_mode = base_mode,
                                           .system_status = MAV_STATE_ACTIVE,
                                           .mavlink_version = 3};

    return frame_heartbeat(system, AUTOPILOT, &heartbeat);
}

/* It is armed. */
static inline struct frame autopilot_heartbeat(uint8_t system)
{
    return heartbeat_with_mode(system, MAV_MODE_FLAG_SAFETY_ARMED);
}

static inline struct frame disarmed_heartbeat(uint8_t system)
{
    return heartbeat_with_mode(system, 0);
}

static inline struct frame ground_station_heartbeat(uint8_t system)
{
    const mavlink_heartbeat_t heartbeat = {.type = MAV_TYPE_GCS,
                                           .autopilot = MAV_AUTOPILOT_INVALID,
                                           .system_status = MAV_STATE_ACTIVE,
                                           .mavlink_version = 3};

    return frame_heartbeat(system, MAV_COMP_ID_MISSIONPLANNER, &heartbeat);
}

/* As begin, and the vehicle and a ground station have been heard. */
static inline void begin_with_vehicle(void)
{
    begin();
    feed(autopilot_heartbeat(VEHICLE));
    for (unsigned i = 0; i < 3; i++) { /* it is there to stay */
        now_us += SECOND;
        feed(autopilot_heartbeat(VEHICLE));
    }
    feed(ground_station_heartbeat(GROUND_STATION));
    update_count = 0;
}

static inline struct frame some_position(uint8_t system, uint8_t component)
{
    const mavlink_global_position_int_t position = {.time_boot_ms = 123456,
                                                    .lat = 577089000,
                                                    .lon = -119746000,
                                                    .alt = 120500,
                                                    .relative_alt = 100250,
                                                    .vx = 300,
                                                    .vy = -400,
                                                    .vz = -150,
                                                    .hdg = 9000};

    return frame_global_position_int(system, component, &position);
}

#endif
