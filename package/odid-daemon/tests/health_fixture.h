/* An aircraft with which nothing is wrong, for tests that then break one thing. */
#ifndef ODID_HEALTH_FIXTURE_H
#define ODID_HEALTH_FIXTURE_H

#include <math.h>
#include <string.h>

#include "daemon/health.h"
#include "daemon/messages.h"

#define NOW INT64_C(100000000)

static struct fixture {
    struct config config;
    struct aircraft_view view;
    struct aircraft_condition condition;
    struct link_status link;
    struct radio radios[CHANNELS];
    struct health_input input;
} fixture;

static inline void fixture_identity(void)
{
    struct aircraft_view *view = &fixture.view;

    view->basic_ids = 1;
    view->basic_id[0].id_type = 1;
    view->basic_id[0].ua_type = 1;
    view->basic_id[0].source = SOURCE_CONFIGURATION;
    strcpy(view->basic_id[0].uas_id, "SSRS5GBG01");
    strcpy(view->operator_id, "SWE3jxza7qbzvu5d");
    strcpy(fixture.config.operator_id, view->operator_id);
    view->self_id_set = true;
    strcpy(view->description, "Sea rescue surveillance");
    strcpy(fixture.config.description, view->description);
    view->system.classification_type = 1;
    view->system.category_eu = 2;
    view->system.class_eu = 5;
}

static inline void fixture_position(void)
{
    struct aircraft_location *location = &fixture.view.location;
    struct aircraft_system *system = &fixture.view.system;

    location->status = AIRCRAFT_GROUND;
    location->status_source = SOURCE_TELEMETRY;
    location->position_source = location->motion_source = SOURCE_TELEMETRY;
    location->position_fresh = true;
    location->fix_us = NOW - 250000;
    location->latitude_deg = 57.7089;
    location->longitude_deg = 11.9746;
    location->altitude_geodetic_m = 48.5;
    location->horizontal_accuracy = 11;
    location->altitude_barometric_m = NAN;
    location->height_m = 0;
    location->direction_deg = NAN;
    location->speed_mps = 0.1;
    location->vertical_speed_mps = -0.25;
    location->timestamp_s = 3599.9;
    system->operator_source = SOURCE_TELEMETRY;
    system->operator_latitude_deg = 57.7;
    system->operator_longitude_deg = 11.9;
    system->operator_altitude_m = 44;
}

static inline void fixture_reset(void)
{
    memset(&fixture, 0, sizeof(fixture));
    config_defaults(&fixture.config);
    fixture_identity();
    fixture_position();
    fixture.condition.heartbeat_fresh = fixture.condition.time_known = true;
    fixture.condition.unix_us = INT64_C(1767323045000000); /* 2026-01-02 03:04:05 UTC */
    fixture.condition.takeoff_known = fixture.condition.fix_known = true;
    fixture.condition.mav_type = 1;
    fixture.condition.autopilot = 3;
    fixture.condition.position_rate_hz = 4;
    fixture.link.state = LINK_ALIVE;
    fixture.link.overrun_us = INT64_MIN;
    strcpy(fixture.link.name, "/dev/ttyACM0 at 921600 baud");
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        fixture.radios[channel].state = RADIO_ON_AIR;
        fixture.radios[channel].since_us = NOW - 5000000;
        fixture.radios[channel].accepted_us = NOW - 100000;
        fixture.radios[channel].confirmed_us = NOW - 50000;
        fixture.radios[channel].unbroken_us = NOW - 4900000;
        fixture.radios[channel].paused_us = NOW - 5900000;
    }
    radio_init(&fixture.radios[CHANNEL_BT5], RADIO_UNSUPPORTED, NOW - 5000000);
    fixture.radios[CHANNEL_BT5].confirmed_us = NOW - 50000; /* for those that put it on the air */
    fixture.input = (struct health_input){
        .config = &fixture.config,
        .view = &fixture.view,
        .condition = &fixture.condition,
        .link = &fixture.link,
        .radios = fixture.radios,
        .extended_room = MESSAGES_EXTENDED_SIZE,
        .beacon_most = MESSAGES_PACK_MAX,
        .realtime = true,
        .filter = true,
        .speaks = true,
    };
}

#endif
