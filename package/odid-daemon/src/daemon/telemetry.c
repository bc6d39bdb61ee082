#include "daemon/telemetry.h"

#include <common/mavlink.h>
#include <string.h>

#include "daemon/aircraft.h"
#include "daemon/belief.h"
#include "daemon/telemetry_odid.h"
#include "daemon/telemetry_plain.h"
#include "daemon/vehicle.h"
#include "mavlink/framing.h"

struct telemetry {
    telemetry_fn *deliver;
    void *context;
    struct framing framing[TELEMETRY_STREAMS];
    struct telemetry_counters counters;
    struct belief belief;
    mavlink_message_t latest; /* of the vehicle's autopilot */
    struct vehicle vehicle;
    bool identified;          /* its autopilot said who it is */
    int64_t authenticated_us; /* and proved it last; INT64_MIN: never */
    bool signs;               /* its last frame was signed */
    bool by_another;          /* the native message that is being read isn't its autopilot's */
    uint16_t speaker;         /* but this one's (telemetry_update) */
    int vehicle_stream;
    int64_t latest_us;                /* of the vehicle's autopilot; INT64_MIN: none yet */
    int64_t first_us;                 /* any autopilot's first frame; INT64_MIN */
    int64_t autopilots_us, others_us; /* any one's last frame, and of whoever is none; INT64_MIN */
};

struct telemetry *telemetry_init(telemetry_fn *deliver, void *context)
{
    static struct telemetry telemetry;

    memset(&telemetry, 0, sizeof(telemetry));
    telemetry.deliver = deliver;
    telemetry.context = context;
    telemetry.vehicle_stream = -1;
    telemetry.first_us = telemetry.autopilots_us = telemetry.others_us = INT64_MIN;
    telemetry.latest_us = telemetry.authenticated_us = INT64_MIN;
    vehicle_init(&telemetry.vehicle);
    belief_reset(&telemetry.belief);
    return &telemetry;
}

void telemetry_restarted(struct telemetry *telemetry)
{
    telemetry->identified = false;
    telemetry->authenticated_us = INT64_MIN;
}

void telemetry_expect(struct telemetry *telemetry, uint8_t vehicle, bool armed, int64_t now_us)
{
    vehicle_expect(&telemetry->vehicle, vehicle, armed, now_us);
}

/* Where the aircraft is and who, only its autopilot says; a ground station may give an identity to
 * one that has none. */
static bool says_where(uint32_t message_id)
{
    return message_id == MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION ||
           message_id == MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK;
}

static bool says_who(uint32_t message_id)
{
    return message_id == MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID ||
           message_id == MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK;
}

/*
 * Whose Open Drone ID messages are ours to take. The guide says target 0 or
 * our own ids; but QGroundControl addresses the autopilot, and ArduPilot
 * relays with that target unchanged.
 */
static bool odid_concerns_us(const struct telemetry *telemetry, const mavlink_message_t *message,
                             const struct telemetry_odid_address *to)
{
    bool to_vehicle = to->system == telemetry->vehicle.system;

    if (telemetry->vehicle.system == 0) {
        return false;
    }
    if (message->sysid == telemetry->vehicle.system) {
        if (message->compid == MAV_COMP_ID_AUTOPILOT1) {
            return to->system == 0 || to_vehicle;
        }
        if (says_where(message->msgid) || says_who(message->msgid)) {
            return false; /* an autopilot passes on what its radio hears */
        }
        return to->system == 0 ||
               (to_vehicle && (to->component == 0 || to->component == TELEMETRY_COMPONENT_ODID));
    }
    if (!vehicle_is_ground_station(&telemetry->vehicle, message->sysid) ||
        says_where(message->msgid)) {
        return false;
    }
    return to->system == 0 ||
           (to_vehicle && (to->component == 0 || to->component == TELEMETRY_COMPONENT_ODID ||
                           to->component == MAV_COMP_ID_AUTOPILOT1));
}

/* System id 0 is nobody's, and no vehicle is known as 0. */
static bool from_autopilot(const struct telemetry *telemetry, const mavlink_message_t *message)
{
    return telemetry->vehicle.system != 0 && message->sysid == telemetry->vehicle.system &&
           message->compid == MAV_COMP_ID_AUTOPILOT1;
}

/* What one source says is delivered; what contradicts it is another one's. */
static bool deliver_believed(struct telemetry *telemetry, struct telemetry_update *update,
                             int64_t now_us)
{
    if (!belief_take(&telemetry->belief, update, now_us)) {
        telemetry->counters.not_believed++;
        return false;
    }
    telemetry->deliver(telemetry->context, update, now_us);
    return true;
}

static void on_native(void *context, const struct telemetry_update *update, int64_t now_us)
{
    struct telemetry *telemetry = context;
    struct telemetry_update told = *update;

    told.by_another = telemetry->by_another;
    told.speaker = telemetry->speaker;
    if (told.by_another) {
        /* Once the vehicle says who it is, nobody else does; nor proves it, while it does. */
        if ((told.kind == TELEMETRY_BASIC_ID && telemetry->identified) ||
            (told.kind == TELEMETRY_AUTHENTICATION && telemetry->authenticated_us != INT64_MIN &&
             now_us - telemetry->authenticated_us < TELEMETRY_AUTHENTICATION_KEPT_US)) {
            telemetry->counters.other_system++;
            return;
        }
    } else if (told.kind == TELEMETRY_BASIC_ID) {
        telemetry->identified = true;
    } else if (told.kind == TELEMETRY_AUTHENTICATION) {
        telemetry->authenticated_us = now_us;
    }
    deliver_believed(telemetry, &told, now_us);
}

static void take_odid(struct telemetry *telemetry, const mavlink_message_t *message, int64_t now_us)
{
    struct telemetry_odid_address to;

    telemetry_odid_address(message, &to);
    if (to.other_aircraft) {
        telemetry->counters.other_aircraft++;
    } else if (!odid_concerns_us(telemetry, message, &to)) {
        telemetry->counters.other_system++;
    } else {
        telemetry->counters.frames++;
        telemetry->by_another = !from_autopilot(telemetry, message);
        telemetry->speaker = (uint16_t)(message->sysid << 8 | message->compid);
        telemetry_odid_read(message, on_native, telemetry, now_us);
    }
}

/* A checksum is made to order: it is the octets that tell. */
static bool same_frame(const mavlink_message_t *a, const mavlink_message_t *b)
{
    return a->seq == b->seq && a->msgid == b->msgid && a->len == b->len &&
           memcmp(a->payload64, b->payload64, a->len) == 0;
}

static void hear_autopilot(struct telemetry *telemetry, int64_t now_us)
{
    telemetry->autopilots_us = now_us;
    telemetry->first_us = telemetry->first_us == INT64_MIN ? now_us : telemetry->first_us;
}

/* A HEARTBEAT that isn't the vehicle's. */
static void hear_other(struct telemetry *telemetry, const mavlink_message_t *message,
                       const mavlink_heartbeat_t *heartbeat, bool is_vehicles, int64_t now_us)
{
    /* It is there, and says nothing that counts: a parameter can give it another component. */
    if (is_vehicles) {
        hear_autopilot(telemetry, now_us);
    } else if (heartbeat->type == MAV_TYPE_GCS) {
        vehicle_heard_ground_station(&telemetry->vehicle, message->sysid);
    }
    telemetry->counters.not_needed++;
}

static void take_heartbeat(struct telemetry *telemetry, const mavlink_message_t *message,
                           int64_t now_us)
{
    struct telemetry_update update = {.kind = TELEMETRY_HEARTBEAT};
    mavlink_heartbeat_t heartbeat;
    bool is_vehicles, armed, known = telemetry->vehicle.system != 0;

    mavlink_msg_heartbeat_decode(message, &heartbeat);
    is_vehicles = vehicle_is(&telemetry->vehicle, message->sysid) &&
                  heartbeat.autopilot != MAV_AUTOPILOT_INVALID;
    /* An antenna tracker has an autopilot, too, and is no vehicle. But the vehicle stays what it
     * is, whatever a parameter has it call itself. */
    if (message->compid != MAV_COMP_ID_AUTOPILOT1 || message->sysid == 0 ||
        heartbeat.autopilot == MAV_AUTOPILOT_INVALID ||
        (aircraft_ua_type(heartbeat.type) < 0 && !is_vehicles)) {
        hear_other(telemetry, message, &heartbeat, is_vehicles, now_us);
        return;
    }
    armed = heartbeat.base_mode & MAV_MODE_FLAG_SAFETY_ARMED;
    switch (vehicle_heartbeat(&telemetry->vehicle, message->sysid, armed, now_us)) {
    case VEHICLE_ANOTHER:
        telemetry->counters.other_system++;
        return;
    case VEHICLE_NEW:
        update.heartbeat.new_vehicle = known;
        belief_reset(&telemetry->belief);
        telemetry->latest_us = INT64_MIN;
        telemetry_restarted(telemetry);
        break;
    default:
        break;
    }
    telemetry->counters.frames++;
    update.heartbeat.doubtful = belief_contradicted(&telemetry->belief, now_us);
    update.heartbeat.mav_type = heartbeat.type;
    update.heartbeat.autopilot = heartbeat.autopilot;
    update.heartbeat.base_mode = heartbeat.base_mode;
    update.heartbeat.system_status = heartbeat.system_status;
    telemetry->deliver(telemetry->context, &update, now_us);
}

static void take_autopilots(struct telemetry *telemetry, unsigned stream,
                            const mavlink_message_t *message, int64_t now_us)
{
    if (telemetry->vehicle_stream != (int)stream) {
        belief_new_link(&telemetry->belief);
    }
    telemetry->signs = message->incompat_flags & MAVLINK_IFLAG_SIGNED;
    belief_sequence(&telemetry->belief, message->seq, same_frame(message, &telemetry->latest),
                    now_us);
    telemetry->latest = *message;
    telemetry->latest_us = now_us;
    telemetry->vehicle_stream = (int)stream;
}

static void take_frame(struct telemetry *telemetry, unsigned stream,
                       const mavlink_message_t *message, int64_t now_us)
{
    struct telemetry_update update;

    if (message->compid == MAV_COMP_ID_AUTOPILOT1) {
        hear_autopilot(telemetry, now_us);
    } else {
        telemetry->others_us = now_us;
    }
    if (message->compid >= TELEMETRY_COMPONENT_ODID &&
        message->compid < TELEMETRY_COMPONENT_ODID + 3) {
        telemetry->counters.other_transmitter++;
        return;
    }
    if (message->msgid == MAVLINK_MSG_ID_HEARTBEAT) {
        take_heartbeat(telemetry, message, now_us);
    } else if (telemetry_odid_is(message->msgid)) {
        take_odid(telemetry, message, now_us);
    } else if (!telemetry_plain_read(message, &update)) {
        telemetry->counters.not_needed++;
    } else if (!from_autopilot(telemetry, message)) {
        telemetry->counters.other_system++;
    } else {
        telemetry->counters.frames += deliver_believed(telemetry, &update, now_us);
    }
    if (message->compid == MAV_COMP_ID_AUTOPILOT1 && message->msgid != MAVLINK_MSG_ID_HEARTBEAT) {
        vehicle_speaks(&telemetry->vehicle, message->sysid, now_us);
    }
    if (from_autopilot(telemetry, message)) {
        take_autopilots(telemetry, stream, message, now_us);
    }
}

/* Of which stream, and when: what the frames of one call have in common. */
struct arrival {
    struct telemetry *telemetry;
    unsigned stream;
    int64_t now_us;
};

static void on_frame(void *context, const mavlink_message_t *message)
{
    const struct arrival *arrival = context;

    take_frame(arrival->telemetry, arrival->stream, message, arrival->now_us);
}

void telemetry_receive(struct telemetry *telemetry, unsigned stream, const uint8_t *bytes,
                       size_t length, int64_t now_us)
{
    struct arrival arrival = {telemetry, stream % TELEMETRY_STREAMS, now_us};

    framing_stream(&telemetry->framing[arrival.stream], &telemetry->counters.framing, bytes, length,
                   on_frame, &arrival);
}

void telemetry_receive_datagram(struct telemetry *telemetry, unsigned stream, const uint8_t *bytes,
                                size_t length, int64_t now_us)
{
    struct arrival arrival = {telemetry, stream % TELEMETRY_STREAMS, now_us};

    framing_datagram(&telemetry->counters.framing, bytes, length, on_frame, &arrival);
}

void telemetry_reset_stream(struct telemetry *telemetry, unsigned stream)
{
    memset(&telemetry->framing[stream % TELEMETRY_STREAMS], 0, sizeof(struct framing));
    if (telemetry->vehicle_stream == (int)stream) {
        telemetry->vehicle_stream = -1;
    }
}

uint8_t telemetry_vehicle(const struct telemetry *telemetry)
{
    return telemetry->vehicle.system;
}

bool telemetry_vehicle_settled(const struct telemetry *telemetry)
{
    return vehicle_is_settled(&telemetry->vehicle);
}

bool telemetry_vehicle_speaks(const struct telemetry *telemetry, int64_t now_us)
{
    return telemetry->vehicle.system != 0 && aircraft_fresh(telemetry->latest_us, now_us);
}

bool telemetry_another_id_speaks(const struct telemetry *telemetry, int64_t now_us)
{
    return telemetry->vehicle.system != 0 && telemetry_autopilot_speaks(telemetry, now_us) &&
           !telemetry_vehicle_speaks(telemetry, now_us);
}

bool telemetry_only_others_speak(const struct telemetry *telemetry, int64_t now_us)
{
    return aircraft_fresh(telemetry->others_us, now_us) &&
           !telemetry_autopilot_speaks(telemetry, now_us);
}

bool telemetry_autopilot_speaks(const struct telemetry *telemetry, int64_t now_us)
{
    return aircraft_fresh(telemetry->autopilots_us, now_us);
}

bool telemetry_heartbeat_missing(const struct telemetry *telemetry, int64_t now_us)
{
    int64_t heartbeat_us = telemetry_heartbeat_us(telemetry);
    int64_t since_us = heartbeat_us != INT64_MIN ? heartbeat_us : telemetry->first_us;

    return telemetry_autopilot_speaks(telemetry, now_us) &&
           telemetry->autopilots_us - since_us >= AIRCRAFT_FRESH_US;
}

bool telemetry_vehicle_signs(const struct telemetry *telemetry)
{
    return telemetry->signs;
}

int telemetry_vehicle_stream(const struct telemetry *telemetry)
{
    return telemetry->vehicle_stream;
}

int64_t telemetry_heartbeat_us(const struct telemetry *telemetry)
{
    return telemetry->vehicle.heartbeat_us;
}

bool telemetry_contradicted(const struct telemetry *telemetry, int64_t now_us)
{
    return belief_contradicted(&telemetry->belief, now_us);
}

const struct telemetry_counters *telemetry_counters(const struct telemetry *telemetry)
{
    return &telemetry->counters;
}
