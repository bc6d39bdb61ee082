#include "daemon/telemetry_odid.h"

#include <math.h>
#include <opendroneid.h>
#include <string.h>

bool telemetry_odid_is(uint32_t message_id)
{
    switch (message_id) {
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_AUTHENTICATION:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SELF_ID:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_UPDATE:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_OPERATOR_ID:
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK:
        return true;
    default:
        return false;
    }
}

static bool all_zero(const void *bytes, size_t length)
{
    const uint8_t *byte = bytes;

    for (size_t i = 0; i < length; i++) {
        if (byte[i] != 0) {
            return false;
        }
    }
    return true;
}

/* A MAVLink text field, with or without terminator, into a terminated string. */
static void copy_text(char *to, const void *from, size_t length)
{
    memcpy(to, from, length);
    to[length] = '\0';
}

void telemetry_odid_address(const mavlink_message_t *message, struct telemetry_odid_address *to)
{
    uint8_t id_or_mac[20] = {0};

    switch (message->msgid) {
#define ADDRESS(ID, name)                                                                          \
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_##ID:                                                        \
        to->system = mavlink_msg_open_drone_id_##name##_get_target_system(message);                \
        to->component = mavlink_msg_open_drone_id_##name##_get_target_component(message);
#define ADDRESS_AND_MAC(ID, name)                                                                  \
    ADDRESS(ID, name)                                                                              \
    mavlink_msg_open_drone_id_##name##_get_id_or_mac(message, id_or_mac);                          \
    break;
        ADDRESS_AND_MAC(BASIC_ID, basic_id)
        ADDRESS_AND_MAC(LOCATION, location)
        ADDRESS_AND_MAC(AUTHENTICATION, authentication)
        ADDRESS_AND_MAC(SELF_ID, self_id)
        ADDRESS_AND_MAC(SYSTEM, system)
        ADDRESS_AND_MAC(OPERATOR_ID, operator_id)
        ADDRESS_AND_MAC(MESSAGE_PACK, message_pack)
        ADDRESS(SYSTEM_UPDATE, system_update)
        break;
#undef ADDRESS_AND_MAC
#undef ADDRESS
    default:
        to->system = to->component = 0;
        break;
    }
    to->other_aircraft = !all_zero(id_or_mac, sizeof(id_or_mac));
}

/* -1000 m is "unknown" in every altitude field, and so is what none of them can say. */
static double altitude(double value_m)
{
    return value_m > MIN_ALT && value_m <= MAX_ALT ? value_m : NAN;
}

/* 0,0 means unknown, for both; so does what is nowhere on Earth. */
static void place(double latitude_deg, double longitude_deg, double *latitude, double *longitude)
{
    bool known = (latitude_deg != 0 || longitude_deg != 0) && fabs(latitude_deg) <= 90 &&
                 fabs(longitude_deg) <= 180;

    *latitude = known ? latitude_deg : NAN;
    *longitude = known ? longitude_deg : NAN;
}

/* A number that no document knows says nothing about what the text is. */
static bool is_id_type(unsigned id_type)
{
    return id_type > ODID_IDTYPE_NONE && id_type <= ODID_IDTYPE_SPECIFIC_SESSION_ID;
}

static bool read_basic_id(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_basic_id_t id;

    mavlink_msg_open_drone_id_basic_id_decode(message, &id);
    update->kind = TELEMETRY_BASIC_ID;
    update->basic_id.id_type = id.id_type;
    update->basic_id.ua_type = id.ua_type;
    copy_text(update->basic_id.uas_id, id.uas_id, sizeof(id.uas_id));
    /* Binary in the newer types: a zero at its beginning is no end. */
    return is_id_type(id.id_type) && !all_zero(id.uas_id, sizeof(id.uas_id));
}

static bool read_location(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_location_t in;

    mavlink_msg_open_drone_id_location_decode(message, &in);
    memset(update, 0, sizeof(*update));
    update->kind = TELEMETRY_LOCATION;
    update->location.status = in.status;
    update->location.height_reference = in.height_reference;
    /* 36000 is no value of the definition; some round up to it. */
    update->location.direction_deg = in.direction <= 36000 ? in.direction % 36000 / 100.0 : NAN;
    update->location.speed_mps = in.speed_horizontal < 25500 ? in.speed_horizontal / 100.0 : NAN;
    update->location.vertical_speed_mps =
        in.speed_vertical < 6300 && in.speed_vertical > -6300 ? in.speed_vertical / 100.0 : NAN;
    place(in.latitude * 1e-7, in.longitude * 1e-7, &update->location.latitude_deg,
          &update->location.longitude_deg);
    update->location.altitude_barometric_m = altitude(in.altitude_barometric);
    update->location.altitude_geodetic_m = altitude(in.altitude_geodetic);
    update->location.height_m = altitude(in.height);
    update->location.horizontal_accuracy = in.horizontal_accuracy;
    update->location.vertical_accuracy = in.vertical_accuracy;
    update->location.barometer_accuracy = in.barometer_accuracy;
    update->location.speed_accuracy = in.speed_accuracy;
    update->location.timestamp_accuracy = in.timestamp_accuracy;
    update->location.timestamp_s =
        in.timestamp >= 0 && in.timestamp <= MAX_TIMESTAMP ? (double)in.timestamp : NAN;
    return true;
}

static bool read_authentication(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_authentication_t page;

    mavlink_msg_open_drone_id_authentication_decode(message, &page);
    update->kind = TELEMETRY_AUTHENTICATION;
    update->authentication.type = page.authentication_type;
    update->authentication.page = page.data_page;
    update->authentication.last_page = page.last_page_index;
    update->authentication.length = page.length;
    update->authentication.timestamp_2019_s = page.timestamp;
    memcpy(update->authentication.data, page.authentication_data,
           sizeof(update->authentication.data));
    return page.authentication_type != MAV_ODID_AUTH_TYPE_NONE && page.authentication_type <= 15 &&
           page.data_page < TELEMETRY_AUTH_PAGES && page.last_page_index < TELEMETRY_AUTH_PAGES;
}

/* Also an empty one: by that what was said before is taken back. */
static void read_self_id(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_self_id_t self;

    mavlink_msg_open_drone_id_self_id_decode(message, &self);
    update->kind = TELEMETRY_SELF_ID;
    update->self_id.type = self.description_type;
    copy_text(update->self_id.text, self.description, sizeof(self.description));
}

static bool read_system(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_system_t in;

    mavlink_msg_open_drone_id_system_decode(message, &in);
    update->kind = TELEMETRY_SYSTEM;
    update->system.operator_location_type = in.operator_location_type;
    update->system.classification_type = in.classification_type;
    update->system.category_eu = in.category_eu;
    update->system.class_eu = in.class_eu;
    place(in.operator_latitude * 1e-7, in.operator_longitude * 1e-7,
          &update->system.operator_latitude_deg, &update->system.operator_longitude_deg);
    update->system.operator_altitude_m = altitude(in.operator_altitude_geo);
    update->system.area_count = in.area_count;
    update->system.area_radius_m = in.area_radius;
    update->system.area_ceiling_m = altitude(in.area_ceiling);
    update->system.area_floor_m = altitude(in.area_floor);
    update->system.timestamp_2019_s = in.timestamp;

    /* Addressed or not, nobody filled it. */
    in.target_system = in.target_component = 0;
    return !all_zero(&in, MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_LEN); /* without padding */
}

static bool read_system_update(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_system_update_t in;

    mavlink_msg_open_drone_id_system_update_decode(message, &in);
    memset(update, 0, sizeof(*update));
    update->kind = TELEMETRY_SYSTEM_UPDATE;
    place(in.operator_latitude * 1e-7, in.operator_longitude * 1e-7,
          &update->system.operator_latitude_deg, &update->system.operator_longitude_deg);
    update->system.operator_altitude_m = altitude(in.operator_altitude_geo);
    update->system.timestamp_2019_s = in.timestamp;
    in.target_system = in.target_component = 0;
    return !all_zero(&in, MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_UPDATE_LEN);
}

static bool read_operator_id(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_open_drone_id_operator_id_t operator_id;

    mavlink_msg_open_drone_id_operator_id_decode(message, &operator_id);
    update->kind = TELEMETRY_OPERATOR_ID;
    update->operator_id.type = operator_id.operator_id_type;
    copy_text(update->operator_id.operator_id, operator_id.operator_id,
              sizeof(operator_id.operator_id));
    return operator_id.operator_id[0] != '\0';
}

/* ---- MESSAGE_PACK: the messages as they go on the air, decoded by opendroneid-core-c ---- */

static void pack_basic_id(const ODID_BasicID_data *in, struct telemetry_update *update)
{
    update->kind = TELEMETRY_BASIC_ID;
    update->basic_id.id_type = (uint8_t)in->IDType;
    update->basic_id.ua_type = (uint8_t)in->UAType;
    copy_text(update->basic_id.uas_id, in->UASID, ODID_ID_SIZE);
}

static void pack_location(const ODID_Location_data *in, struct telemetry_update *update)
{
    memset(update, 0, sizeof(*update));
    update->kind = TELEMETRY_LOCATION;
    update->location.status = (uint8_t)in->Status;
    update->location.height_reference = (uint8_t)in->HeightType;
    update->location.direction_deg = in->Direction < 360 ? (double)in->Direction : NAN;
    update->location.speed_mps =
        in->SpeedHorizontal < INV_SPEED_H ? (double)in->SpeedHorizontal : NAN;
    update->location.vertical_speed_mps =
        fabsf(in->SpeedVertical) < INV_SPEED_V ? (double)in->SpeedVertical : NAN;
    place(in->Latitude, in->Longitude, &update->location.latitude_deg,
          &update->location.longitude_deg);
    update->location.altitude_barometric_m = altitude((double)in->AltitudeBaro);
    update->location.altitude_geodetic_m = altitude((double)in->AltitudeGeo);
    update->location.height_m = altitude((double)in->Height);
    update->location.horizontal_accuracy = (uint8_t)in->HorizAccuracy;
    update->location.vertical_accuracy = (uint8_t)in->VertAccuracy;
    update->location.barometer_accuracy = (uint8_t)in->BaroAccuracy;
    update->location.speed_accuracy = (uint8_t)in->SpeedAccuracy;
    update->location.timestamp_accuracy = (uint8_t)in->TSAccuracy;
    update->location.timestamp_s =
        in->TimeStamp >= 0 && in->TimeStamp <= MAX_TIMESTAMP ? (double)in->TimeStamp : NAN;
}

static void pack_authentication(const ODID_Auth_data *in, struct telemetry_update *update)
{
    size_t size =
        in->DataPage == 0 ? ODID_AUTH_PAGE_ZERO_DATA_SIZE : ODID_AUTH_PAGE_NONZERO_DATA_SIZE;

    memset(update, 0, sizeof(*update));
    update->kind = TELEMETRY_AUTHENTICATION;
    update->authentication.type = (uint8_t)in->AuthType;
    update->authentication.page = in->DataPage;
    update->authentication.last_page = in->LastPageIndex;
    update->authentication.length = in->Length;
    update->authentication.timestamp_2019_s = in->Timestamp;
    memcpy(update->authentication.data, in->AuthData, size);
}

/* As ArduPilot sends it when nobody filled it; an altitude of 0 on the air is -1000 m. */
static bool is_empty_system(const ODID_System_data *in)
{
    return in->OperatorLatitude == 0 && in->OperatorLongitude == 0 && in->Timestamp == 0 &&
           in->OperatorLocationType == 0 && in->ClassificationType == 0 && in->CategoryEU == 0 &&
           in->ClassEU == 0 && in->OperatorAltitudeGeo <= INV_ALT && in->AreaRadius == 0;
}

static void pack_system(const ODID_System_data *in, struct telemetry_update *update)
{
    update->kind = TELEMETRY_SYSTEM;
    update->system.operator_location_type = (uint8_t)in->OperatorLocationType;
    update->system.classification_type = (uint8_t)in->ClassificationType;
    update->system.category_eu = (uint8_t)in->CategoryEU;
    update->system.class_eu = (uint8_t)in->ClassEU;
    place(in->OperatorLatitude, in->OperatorLongitude, &update->system.operator_latitude_deg,
          &update->system.operator_longitude_deg);
    update->system.operator_altitude_m = altitude((double)in->OperatorAltitudeGeo);
    update->system.area_count = in->AreaCount;
    update->system.area_radius_m = in->AreaRadius;
    update->system.area_ceiling_m = altitude((double)in->AreaCeiling);
    update->system.area_floor_m = altitude((double)in->AreaFloor);
    update->system.timestamp_2019_s = in->Timestamp;
}

static void read_pack(const mavlink_message_t *message, telemetry_fn *deliver, void *context,
                      int64_t now_us)
{
    ODID_MessagePack_encoded pack = {0};
    ODID_UAS_Data uas;
    struct telemetry_update update;

    pack.ProtoVersion = ODID_PROTOCOL_VERSION;
    pack.MessageType = ODID_MESSAGETYPE_PACKED;
    pack.SingleMessageSize =
        mavlink_msg_open_drone_id_message_pack_get_single_message_size(message);
    pack.MsgPackSize = mavlink_msg_open_drone_id_message_pack_get_msg_pack_size(message);
    mavlink_msg_open_drone_id_message_pack_get_messages(message, pack.Messages[0].rawData);
    odid_initUasData(&uas);
    if (pack.MsgPackSize == 0 || decodeMessagePack(&uas, &pack) != ODID_SUCCESS) {
        return;
    }
    for (int i = 0; i < ODID_BASIC_ID_MAX_MESSAGES; i++) {
        if (uas.BasicIDValid[i] && is_id_type(uas.BasicID[i].IDType) &&
            !all_zero(uas.BasicID[i].UASID, ODID_ID_SIZE)) {
            pack_basic_id(&uas.BasicID[i], &update);
            deliver(context, &update, now_us);
        }
    }
    if (uas.LocationValid) {
        pack_location(&uas.Location, &update);
        deliver(context, &update, now_us);
    }
    for (int i = 0; i < ODID_AUTH_MAX_PAGES; i++) {
        if (uas.AuthValid[i] && uas.Auth[i].AuthType != ODID_AUTH_NONE) {
            pack_authentication(&uas.Auth[i], &update);
            deliver(context, &update, now_us);
        }
    }
    if (uas.SelfIDValid) {
        update.kind = TELEMETRY_SELF_ID;
        update.self_id.type = (uint8_t)uas.SelfID.DescType;
        copy_text(update.self_id.text, uas.SelfID.Desc, ODID_STR_SIZE);
        deliver(context, &update, now_us);
    }
    if (uas.SystemValid && !is_empty_system(&uas.System)) {
        pack_system(&uas.System, &update);
        deliver(context, &update, now_us);
    }
    if (uas.OperatorIDValid && uas.OperatorID.OperatorId[0] != '\0') {
        update.kind = TELEMETRY_OPERATOR_ID;
        update.operator_id.type = (uint8_t)uas.OperatorID.OperatorIdType;
        copy_text(update.operator_id.operator_id, uas.OperatorID.OperatorId, ODID_ID_SIZE);
        deliver(context, &update, now_us);
    }
}

void telemetry_odid_read(const mavlink_message_t *message, telemetry_fn *deliver, void *context,
                         int64_t now_us)
{
    struct telemetry_update update;
    bool filled = false;

    switch (message->msgid) {
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID:
        filled = read_basic_id(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION:
        filled = read_location(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_AUTHENTICATION:
        filled = read_authentication(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SELF_ID:
        read_self_id(message, &update);
        filled = true;
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM:
        filled = read_system(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_UPDATE:
        filled = read_system_update(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_OPERATOR_ID:
        filled = read_operator_id(message, &update);
        break;
    case MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK:
        read_pack(message, deliver, context, now_us);
        break;
    default:
        break;
    }
    if (filled) {
        deliver(context, &update, now_us);
    }
}
