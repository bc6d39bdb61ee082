/*
 * MAVLink bytes -> telemetry -> aircraft -> view -> messages and packs.
 *
 * An input is a first byte that chooses the configuration, and then records:
 *
 *   op         bits 0-2: stream (from 4 on a datagram's sender), bit 3: a frame
 *              rather than raw bytes, bits 4-7: how much time passes before it
 *   raw bytes: count, bytes
 *   a frame:   message, sender, payload length, payload; the checksum is
 *              written here, which no fuzzer would find by itself
 */
#include "daemon/schedule.h"
#include "daemon/telemetry.h"
#include "frames.h"
#include "input.h"
#include "on_air.h"

#define START_US INT64_C(1000000000)

static const int64_t steps_us[16] = {
    0,       1000,     50000,    125000,     200000,      1000000,          2999999, 3000000,
    4000000, 10000000, 60000000, 3600000000, 86400000000, 25 * 86400000000, 1,       500000};

static const struct {
    uint8_t system, component;
} senders[] = {{1, 1}, {2, 1}, {255, 190}, {1, 191}, {1, 236}, {0, 1}, {1, 237}, {254, 1}};

static struct config config;
static struct telemetry *telemetry;
static struct aircraft *aircraft;
static struct messages_counters counters;
static struct messages_counter pack_counter;
static struct schedule schedule;
static int64_t now_us;

static size_t some(size_t count)
{
    return count < input.left ? count : input.left;
}

static void configure(uint8_t choice)
{
    memset(&config, 0, sizeof(config));
    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        config.basic_id[i].id_type = (uint8_t)(1 + i);
        config.basic_id[i].ua_type = CONFIG_UA_TYPE_AUTO;
        if (choice >> i & 1) {
            strcpy(config.basic_id[i].uas_id, i == 0 ? "SSRS5GBG01" : "SE-123");
        }
    }
    config.classification_type = 1;
    config.classification_set = choice >> 2 & 1;
    config.operator_latitude_deg = choice >> 3 & 1 ? 57.7 : NAN;
    config.operator_longitude_deg = choice >> 3 & 1 ? 11.9 : NAN;
    config.operator_altitude_m = NAN;
    config.bench_latitude_deg = choice >> 4 & 1 ? 57.5 : NAN;
    config.bench_longitude_deg = choice >> 4 & 1 ? 11.5 : NAN;
    if (choice >> 5 & 1) {
        strcpy(config.operator_id, "SWE3jxza7qbzvu5d");
        strcpy(config.description, "Sea rescue surveillance");
    }
}

static void take(void *context, const struct telemetry_update *update, int64_t at_us)
{
    (void)context;
    MUST(at_us == now_us);
    MUST(update->kind <= TELEMETRY_OPERATOR_ID);
    aircraft_update(aircraft, update, at_us);
}

static void judge_times(const struct aircraft_location *at)
{
    bool starting = now_us - START_US < AIRCRAFT_FRESH_US;

    MUST(at->fix_us <= now_us);
    MUST(isnan(at->timestamp_s) || (at->timestamp_s >= 0 && at->timestamp_s < 3600));
    if (at->position_fresh) {
        MUST(now_us - at->fix_us < AIRCRAFT_FRESH_US);
        MUST(!isnan(at->latitude_deg) && !isnan(at->longitude_deg));
    } else {
        MUST(starting || at->position_source == SOURCE_CONFIGURATION ||
             at->status == AIRCRAFT_EMERGENCY || at->status == AIRCRAFT_REMOTE_ID_FAILURE);
    }
    MUST(at->motion_source != SOURCE_NONE ||
         (isnan(at->speed_mps) && isnan(at->direction_deg) && isnan(at->vertical_speed_mps)));
    MUST(isnan(at->latitude_deg) == isnan(at->longitude_deg));
}

static void judge(void)
{
    static struct aircraft_view view;
    struct aircraft_condition condition;
    unsigned available[MESSAGE_TYPES];
    struct schedule_entry entry;

    aircraft_view(aircraft, now_us, &view);
    aircraft_condition(aircraft, now_us, &condition);
    judge_times(&view.location);
    judge_legacy(&view, &counters);
    judge_pack(&view, &pack_counter);
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        available[type] = messages_available(&view, type);
    }
    if (now_us >= schedule_deadline(&schedule)) {
        entry = schedule_next(&schedule, now_us, available);
        MUST(entry.index < available[entry.type]);
        MUST(entry.until_us > now_us && entry.until_us <= now_us + SCHEDULE_SLOT_US);
    }
}

static void receive(unsigned stream, const uint8_t *octets, size_t length)
{
    if (stream < 4) {
        telemetry_receive(telemetry, stream, octets, length, now_us);
    } else {
        telemetry_receive_datagram(telemetry, stream, octets, length, now_us);
    }
}

static void feed_raw(unsigned stream)
{
    size_t count = some(byte());

    receive(stream, input.at, count);
    input.at += count;
    input.left -= count;
}

static void feed_frame(unsigned stream)
{
    uint32_t id = messages[byte() % COUNT(messages)];
    size_t sender = byte() % COUNT(senders), length = some(byte());
    uint8_t frame[MAVLINK_MAX_PACKET_LEN];
    mavlink_message_t message;

    memset(&message, 0, sizeof(message));
    memcpy(_MAV_PAYLOAD_NON_CONST(&message), input.at, length);
    input.at += length;
    input.left -= length;
    receive(stream, frame,
            finish_frame(&message, id, senders[sender].system, senders[sender].component, frame));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input.at = data;
    input.left = size;
    now_us = START_US;
    configure(byte());
    telemetry = telemetry_init(take, NULL);
    aircraft = aircraft_init(&config, now_us);
    memset(&counters, 0, sizeof(counters));
    memset(&pack_counter, 0, sizeof(pack_counter));
    schedule_start(&schedule, now_us);
    while (input.left > 0) {
        uint8_t op = byte();

        now_us += steps_us[op >> 4];
        if (op & 8) {
            feed_frame(op & 7);
        } else {
            feed_raw(op & 7);
        }
        judge();
    }
    return 0;
}
