/* MAV_TYPE -> ASTM UA type, by a table written out in full. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "daemon/aircraft.h"

/* 0 generic ... 49 radio, as the MAVLink definitions number them; -1: no vehicle. */
static const int expected[] = {
    15, /*  0 generic */
    1,  /*  1 fixed wing */
    2,  /*  2 quadrotor */
    2,  /*  3 coaxial */
    2,  /*  4 helicopter */
    -1, /*  5 antenna tracker */
    -1, /*  6 ground station */
    10, /*  7 airship */
    8,  /*  8 free balloon */
    12, /*  9 rocket */
    14, /* 10 ground rover */
    15, /* 11 surface boat */
    15, /* 12 submarine */
    2,  /* 13 hexarotor */
    2,  /* 14 octorotor */
    2,  /* 15 tricopter */
    5,  /* 16 flapping wing */
    7,  /* 17 kite */
    -1, /* 18 onboard controller */
    4,  /* 19 VTOL tailsitter, two rotors */
    4,  /* 20 VTOL tailsitter, four rotors */
    4,  /* 21 VTOL tiltrotor */
    4,  /* 22 VTOL fixed rotor */
    4,  /* 23 VTOL tailsitter */
    4,  /* 24 VTOL tiltwing */
    4,  /* 25 VTOL reserved */
    -1, /* 26 gimbal */
    -1, /* 27 ADS-B */
    11, /* 28 parafoil */
    2,  /* 29 dodecarotor */
    -1, /* 30 camera */
    -1, /* 31 charging station */
    -1, /* 32 FLARM */
    -1, /* 33 servo */
    -1, /* 34 Open Drone ID */
    2,  /* 35 decarotor */
    -1, /* 36 battery */
    -1, /* 37 parachute */
    -1, /* 38 log */
    -1, /* 39 OSD */
    -1, /* 40 IMU */
    -1, /* 41 GPS */
    -1, /* 42 winch */
    2,  /* 43 generic multirotor */
    -1, /* 44 illuminator */
    15, /* 45 spacecraft */
    15, /* 46 ground quadruped */
    3,  /* 47 VTOL gyrodyne */
    -1, /* 48 gripper */
    -1, /* 49 radio */
};

static void every_mav_type_has_its_ua_type(void **state)
{
    (void)state;
    for (unsigned type = 0; type < sizeof(expected) / sizeof(expected[0]); type++) {
        assert_int_equal(aircraft_ua_type((uint8_t)type), expected[type]);
    }
}

static void a_type_that_is_yet_to_come_is_another_vehicle(void **state)
{
    (void)state;
    for (unsigned type = 50; type < 256; type++) {
        assert_int_equal(aircraft_ua_type((uint8_t)type), 15);
    }
}

/* The two enumerations look alike: a cast would make a hexarotor a tethered balloon. */
static void no_type_is_merely_cast(void **state)
{
    (void)state;
    assert_int_not_equal(aircraft_ua_type(13), 13);
    for (unsigned type = 0; type < 256; type++) {
        int ua_type = aircraft_ua_type((uint8_t)type);

        assert_in_range(ua_type + 1, 0, 16);
        assert_int_not_equal(ua_type, 6);  /* glider: no MAV_TYPE says so */
        assert_int_not_equal(ua_type, 9);  /* captive balloon */
        assert_int_not_equal(ua_type, 13); /* tethered powered aircraft */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_mav_type_has_its_ua_type),
        cmocka_unit_test(a_type_that_is_yet_to_come_is_another_vehicle),
        cmocka_unit_test(no_type_is_merely_cast),
    };

    return cmocka_run_group_tests_name("UA type", tests, NULL, NULL);
}
