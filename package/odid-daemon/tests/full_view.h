/* A view in which everything is known, for tests of messages. */
#ifndef ODID_TESTS_FULL_VIEW_H
#define ODID_TESTS_FULL_VIEW_H

#include <math.h>
#include <string.h>

#include "daemon/aircraft.h"

static inline struct aircraft_view full_view(void)
{
    struct aircraft_view view;

    memset(&view, 0, sizeof(view));
    view.basic_ids = 1;
    view.basic_id[0].id_type = 1;
    view.basic_id[0].ua_type = 1;
    strcpy(view.basic_id[0].uas_id, "SSRS5GBG01");
    view.location = (struct aircraft_location){
        .status = AIRCRAFT_AIRBORNE,
        .latitude_deg = 57.7089,
        .longitude_deg = 11.9746,
        .altitude_barometric_m = 101.5,
        .altitude_geodetic_m = 120.5,
        .height_m = 36,
        .horizontal_accuracy = 11,
        .vertical_accuracy = 5,
        .barometer_accuracy = 4,
        .speed_accuracy = 3,
        .timestamp_accuracy = 2,
        .timestamp_s = 1234.5,
        .direction_deg = 270,
        .speed_mps = 20,
        .vertical_speed_mps = -2.5,
    };
    view.self_id_set = true;
    strcpy(view.description, "Sea rescue surveillance");
    view.system = (struct aircraft_system){
        .operator_location_type = 1,
        .operator_latitude_deg = -33.7089,
        .operator_longitude_deg = 151.9746,
        .operator_altitude_m = 48.5,
        .classification_type = 1,
        .category_eu = 2,
        .class_eu = 5,
        .area_count = 2,
        .area_radius_m = 250,
        .area_ceiling_m = 120,
        .area_floor_m = NAN,
        .timestamp_2019_s = 243699123,
    };
    strcpy(view.operator_id, "SWE3jxza7qbzvu5d");
    return view;
}

static inline void add_authentication(struct aircraft_view *view, unsigned pages)
{
    view->auth_pages = pages;
    for (unsigned i = 0; i < pages; i++) {
        view->auth[i] = (struct aircraft_auth_page){.type = 1, .page = (uint8_t)i};
        memset(view->auth[i].data, 0xA0 + (int)i, i == 0 ? 17 : 23);
    }
    view->auth[0].last_page = (uint8_t)(pages - 1);
    view->auth[0].length = (uint8_t)(17 + 23 * (pages < 11 ? pages - 1 : 10));
    view->auth[0].timestamp_2019_s = 0x01020304;
}

static inline void add_second_basic_id(struct aircraft_view *view)
{
    view->basic_ids = 2;
    view->basic_id[1].id_type = 2;
    view->basic_id[1].ua_type = 1;
    strcpy(view->basic_id[1].uas_id, "SE-123");
}

#endif
