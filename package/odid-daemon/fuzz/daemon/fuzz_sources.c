/*
 * An armed autopilot that speaks all the time, and somebody else's datagrams in
 * between: what they may not change, whoever they say that they are.
 *
 * An input is a first byte, whether the others speak as systems of their own
 * (even) or also as the vehicle's (odd), and then one record a datagram:
 *
 *   time       how long after the one before, in 4 ms
 *   stream     bits 0-2: the datagram's sender (0 is the autopilot's own); bit 3: its
 *              content starts as what the autopilot would say now, not as zeros
 *   sender, message, sequence number
 *   count, offset, octets: laid over the content
 */
#include <limits.h>

#include "daemon/telemetry.h"
#include "frames.h"
#include "input.h"
#include "on_air.h"

#define VEHICLE 1
#define START_US INT64_C(1000000000)
#define START_BOOT_MS 60000
#define START_UNIX_US INT64_C(1790000000000000)
#define START_LATITUDE_E7 577089000
#define LONGITUDE_E7 119746000
#define POSITION_EVERY_US 200000
#define NORTH_E7_EACH 360 /* 4 m: 20 m/s */
#define WARMED_UP_US 4000000
#define RECORDS_MAX 400

/* What nobody can say of a contradiction: how far it may lead, and how long it may take to be seen.
 */
#define DEVIATION_MAX_E7 45000 /* 500 m */
#define UNSEEN_MAX_US 6000000

static const struct {
    uint8_t system, component;
} strangers[] = {{2, 1}, {255, 190}, {255, 1}, {0, 1}, {254, 25}, {2, 236}, {3, 191}, {0, 0}},
  impostors[] = {{1, 1}, {1, 1}, {1, 190}, {1, 25}, {1, 236}, {2, 1}, {255, 190}, {255, 1}};

static struct config config;
static struct telemetry *telemetry;
static struct aircraft *aircraft;
static int64_t now_us, next_us, deviates_since_us;
static unsigned positions, restarts; /* UINT_MAX: not looked at yet */
static uint8_t sequence;
static bool as_vehicle;

static void take(void *context, const struct telemetry_update *update, int64_t at_us)
{
    (void)context;
    aircraft_update(aircraft, update, at_us);
}

/* ---- the autopilot ---- */

static int32_t latitude_e7(void)
{
    return START_LATITUDE_E7 + NORTH_E7_EACH * (int32_t)positions;
}

/* What it would say now. */
static void content(uint32_t id, mavlink_message_t *message)
{
    uint32_t boot_ms = START_BOOT_MS + (uint32_t)((now_us - START_US) / 1000);

    memset(message, 0, sizeof(*message));
    switch (id) {
    case MAVLINK_MSG_ID_HEARTBEAT:
        mavlink_msg_heartbeat_pack(VEHICLE, MAV_COMP_ID_AUTOPILOT1, message, MAV_TYPE_FIXED_WING,
                                   MAV_AUTOPILOT_ARDUPILOTMEGA, MAV_MODE_FLAG_SAFETY_ARMED | 1, 0,
                                   MAV_STATE_ACTIVE);
        break;
    case MAVLINK_MSG_ID_SYSTEM_TIME:
        mavlink_msg_system_time_pack(VEHICLE, MAV_COMP_ID_AUTOPILOT1, message,
                                     (uint64_t)(START_UNIX_US + now_us - START_US), boot_ms);
        break;
    case MAVLINK_MSG_ID_GPS_RAW_INT:
        mavlink_msg_gps_raw_int_pack(VEHICLE, MAV_COMP_ID_AUTOPILOT1, message,
                                     (uint64_t)boot_ms * 1000, GPS_FIX_TYPE_3D_FIX, latitude_e7(),
                                     LONGITUDE_E7, 84000, 100, 100, 2000, 0, 12, 120400, 1200, 2500,
                                     300, 0, 0);
        break;
    case MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
        mavlink_msg_global_position_int_pack(VEHICLE, MAV_COMP_ID_AUTOPILOT1, message, boot_ms,
                                             latitude_e7(), LONGITUDE_E7, 120500, 36500, 2000, 0, 0,
                                             0);
        break;
    default:
        break;
    }
    /* Packing it took zeros off its end and put the checksum there. */
    memset(_MAV_PAYLOAD_NON_CONST(message) + message->len, 0, MAVLINK_NUM_CHECKSUM_BYTES);
}

static void send_as(unsigned stream, uint32_t id, uint8_t system, uint8_t component, uint8_t number,
                    mavlink_message_t *message)
{
    uint8_t octets[MAVLINK_MAX_PACKET_LEN];

    mavlink_get_channel_status(MAVLINK_COMM_0)->current_tx_seq = number;
    telemetry_receive_datagram(telemetry, stream, octets,
                               finish_frame(message, id, system, component, octets), now_us);
}

static void say(uint32_t id)
{
    mavlink_message_t message;

    content(id, &message);
    send_as(0, id, VEHICLE, MAV_COMP_ID_AUTOPILOT1, sequence++, &message);
}

/* ---- the judge ---- */

static void judge(void)
{
    static struct aircraft_view view;
    struct aircraft_condition condition;
    double away_e7;

    aircraft_view(aircraft, now_us, &view);
    aircraft_condition(aircraft, now_us, &condition);
    away_e7 = fabs(view.location.latitude_deg * 1e7 - latitude_e7()) +
              fabs(view.location.longitude_deg * 1e7 - LONGITUDE_E7);
    MUST(condition.armed);
    MUST(telemetry_vehicle(telemetry) == VEHICLE);
    if (!as_vehicle) {
        MUST(away_e7 < 2);
        MUST(view.basic_ids == 1 && strcmp(view.basic_id[0].uas_id, "SSRS5GBG01") == 0);
        MUST(condition.time_known &&
             llabs(condition.unix_us - (START_UNIX_US + now_us - START_US)) < 1000000);
        MUST(!telemetry_contradicted(telemetry, now_us));
        restarts = restarts == UINT_MAX ? condition.autopilot_restarts : restarts;
        MUST(condition.autopilot_restarts == restarts);
    }
    if (!(away_e7 > DEVIATION_MAX_E7)) {
        deviates_since_us = now_us;
    }
    MUST(now_us - deviates_since_us < UNSEEN_MAX_US || telemetry_contradicted(telemetry, now_us));
}

/* Time passes, and the autopilot speaks. */
static void go_on(int64_t until_us)
{
    while (next_us <= until_us) {
        now_us = next_us;
        if (positions % 5 == 0) {
            say(MAVLINK_MSG_ID_HEARTBEAT);
            say(MAVLINK_MSG_ID_SYSTEM_TIME);
            say(MAVLINK_MSG_ID_GPS_RAW_INT);
        }
        positions++;
        say(MAVLINK_MSG_ID_GLOBAL_POSITION_INT);
        next_us += POSITION_EVERY_US;
        if (now_us - START_US >= WARMED_UP_US) {
            judge();
        }
    }
    now_us = until_us;
}

/* ---- the others ---- */

static void datagram(void)
{
    uint8_t stream, sender, number, count, offset;
    mavlink_message_t message;
    uint32_t id;

    go_on(now_us + byte() * INT64_C(4000));
    stream = byte();
    sender = byte() % COUNT(strangers);
    id = messages[byte() % COUNT(messages)];
    number = byte();
    memset(&message, 0, sizeof(message));
    if (stream & 8) {
        content(id, &message);
    }
    count = byte();
    offset = byte();
    for (unsigned i = 0; i < count && input.left > 0; i++) {
        uint8_t octet = byte();

        if (offset + i < MAVLINK_MAX_PAYLOAD_LEN) {
            _MAV_PAYLOAD_NON_CONST(&message)[offset + i] = (char)octet;
        }
    }
    send_as(stream & 7, id, as_vehicle ? impostors[sender].system : strangers[sender].system,
            as_vehicle ? impostors[sender].component : strangers[sender].component, number,
            &message);
    judge();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input.at = data;
    input.left = size;
    as_vehicle = byte() & 1;
    memset(&config, 0, sizeof(config));
    config.basic_id[0].id_type = 1;
    config.basic_id[0].ua_type = CONFIG_UA_TYPE_AUTO;
    strcpy(config.basic_id[0].uas_id, "SSRS5GBG01");
    config.operator_latitude_deg = config.operator_longitude_deg = NAN;
    config.operator_altitude_m = config.bench_latitude_deg = config.bench_longitude_deg = NAN;
    now_us = next_us = deviates_since_us = START_US;
    positions = 0;
    restarts = UINT_MAX;
    sequence = 0;
    telemetry = telemetry_init(take, NULL);
    aircraft = aircraft_init(&config, now_us);
    go_on(START_US + WARMED_UP_US);
    for (unsigned i = 0; i < RECORDS_MAX && input.left > 0; i++) {
        datagram();
    }
    go_on(now_us + 2 * UNSEEN_MAX_US); /* the autopilot alone again: */
    MUST(deviates_since_us > now_us - UNSEEN_MAX_US);
    return 0;
}
