#include "daemon/messages.h"

#include <math.h>
#include <opendroneid.h>
#include <string.h>

/* Open Drone ID application code, after the 16-bit service UUID or the vendor's OUI. */
#define APPLICATION_CODE 0x0D

/* ---- one field at a time ---- */

static double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* NAN becomes the field's own "unknown"; what is too far out goes to the end of the range. */
static float known_or(double value, double low, double high, float unknown)
{
    return isfinite(value) ? (float)clamp(value, low, high) : unknown;
}

static uint8_t enumerated(uint8_t value, uint8_t highest)
{
    return value <= highest ? value : 0; /* 0 is "unknown" or "undeclared" in each */
}

/* The lowest altitude on the air means "unknown", and so does all below it: nothing flies there. */
static float altitude(double value_m)
{
    return value_m < MIN_ALT ? INV_ALT : known_or(value_m, MIN_ALT + 0.5, MAX_ALT, INV_ALT);
}

static void place(double latitude_deg, double longitude_deg, double *latitude, double *longitude)
{
    bool known = isfinite(latitude_deg) && isfinite(longitude_deg) &&
                 fabs(latitude_deg) <= MAX_LAT && fabs(longitude_deg) <= MAX_LON;

    /* A wrong place is worse than none: not clamped. */
    *latitude = known ? latitude_deg : 0;
    *longitude = known ? longitude_deg : 0;
}

/* Whole degrees on the air: 359.6 rounds to 0, not to 360. */
static float direction(double direction_deg)
{
    if (!isfinite(direction_deg) || direction_deg < 0 || direction_deg > MAX_DIR) {
        return INV_DIR;
    }
    return (float)fmod(round(direction_deg), 360);
}

static float timestamp(double timestamp_s)
{
    if (!isfinite(timestamp_s) || timestamp_s < 0 || timestamp_s > MAX_TIMESTAMP) {
        return INV_TIMESTAMP;
    }
    return (float)timestamp_s;
}

/* NUL-padded on the air, without terminator at full length; to is all zero before. */
static void text(char *to, const char *from, size_t size)
{
    memcpy(to, from, strnlen(from, size));
}

/* ---- the messages ---- */

static bool encode_basic_id(const struct aircraft_view *view, unsigned index, uint8_t *message)
{
    ODID_BasicID_data data;

    if (index >= view->basic_ids) {
        return false;
    }
    odid_initBasicIDData(&data);
    data.IDType =
        (ODID_idtype_t)enumerated(view->basic_id[index].id_type, ODID_IDTYPE_SPECIFIC_SESSION_ID);
    data.UAType = (ODID_uatype_t)enumerated(view->basic_id[index].ua_type, ODID_UATYPE_OTHER);
    memcpy(data.UASID, view->basic_id[index].uas_id, ODID_ID_SIZE); /* text or binary, NUL-padded */
    return encodeBasicIDMessage((ODID_BasicID_encoded *)(void *)message, &data) == ODID_SUCCESS;
}

static bool encode_location(const struct aircraft_view *view, uint8_t *message)
{
    const struct aircraft_location *in = &view->location;
    ODID_Location_data data;

    odid_initLocationData(&data);
    data.Status =
        (ODID_status_t)enumerated((uint8_t)in->status, ODID_STATUS_REMOTE_ID_SYSTEM_FAILURE);
    data.Direction = direction(in->direction_deg);
    data.SpeedHorizontal = known_or(in->speed_mps, 0, (double)MAX_SPEED_H, INV_SPEED_H);
    data.SpeedVertical = known_or(in->vertical_speed_mps, MIN_SPEED_V, MAX_SPEED_V, INV_SPEED_V);
    place(in->latitude_deg, in->longitude_deg, &data.Latitude, &data.Longitude);
    data.AltitudeBaro = altitude(in->altitude_barometric_m);
    data.AltitudeGeo = altitude(in->altitude_geodetic_m);
    data.HeightType =
        in->height_above_ground ? ODID_HEIGHT_REF_OVER_GROUND : ODID_HEIGHT_REF_OVER_TAKEOFF;
    data.Height = altitude(in->height_m);
    data.HorizAccuracy =
        (ODID_Horizontal_accuracy_t)enumerated(in->horizontal_accuracy, ODID_HOR_ACC_1_METER);
    data.VertAccuracy =
        (ODID_Vertical_accuracy_t)enumerated(in->vertical_accuracy, ODID_VER_ACC_1_METER);
    data.BaroAccuracy =
        (ODID_Vertical_accuracy_t)enumerated(in->barometer_accuracy, ODID_VER_ACC_1_METER);
    data.SpeedAccuracy =
        (ODID_Speed_accuracy_t)enumerated(in->speed_accuracy, ODID_SPEED_ACC_0_3_METERS_PER_SECOND);
    data.TSAccuracy =
        (ODID_Timestamp_accuracy_t)enumerated(in->timestamp_accuracy, ODID_TIME_ACC_1_5_SECOND);
    data.TimeStamp = timestamp(in->timestamp_s);
    return encodeLocationMessage((ODID_Location_encoded *)(void *)message, &data) == ODID_SUCCESS;
}

static bool encode_authentication(const struct aircraft_view *view, unsigned index,
                                  uint8_t *message)
{
    const struct aircraft_auth_page *in;
    ODID_Auth_data data;
    unsigned room;

    if (index >= view->auth_pages) {
        return false;
    }
    in = &view->auth[index];
    room = ODID_AUTH_PAGE_ZERO_DATA_SIZE + in->last_page * ODID_AUTH_PAGE_NONZERO_DATA_SIZE;
    odid_initAuthData(&data);
    data.DataPage = in->page;
    data.AuthType = (ODID_authtype_t)(in->type & 0xF);
    data.LastPageIndex = in->last_page;
    data.Length = in->length <= room ? in->length : (uint8_t)room;
    data.Timestamp = in->timestamp_2019_s;
    memcpy(data.AuthData, in->data,
           in->page == 0 ? ODID_AUTH_PAGE_ZERO_DATA_SIZE : ODID_AUTH_PAGE_NONZERO_DATA_SIZE);
    return encodeAuthMessage((ODID_Auth_encoded *)(void *)message, &data) == ODID_SUCCESS;
}

static bool encode_self_id(const struct aircraft_view *view, uint8_t *message)
{
    ODID_SelfID_data data;

    if (!view->self_id_set) {
        return false;
    }
    odid_initSelfIDData(&data);
    data.DescType = (ODID_desctype_t)view->description_type;
    text(data.Desc, view->description, ODID_STR_SIZE);
    return encodeSelfIDMessage((ODID_SelfID_encoded *)(void *)message, &data) == ODID_SUCCESS;
}

static bool encode_system(const struct aircraft_view *view, uint8_t *message)
{
    const struct aircraft_system *in = &view->system;
    ODID_System_data data;

    odid_initSystemData(&data);
    data.OperatorLocationType = (ODID_operator_location_type_t)enumerated(
        in->operator_location_type, ODID_OPERATOR_LOCATION_TYPE_FIXED);
    data.ClassificationType = (ODID_classification_type_t)enumerated(in->classification_type,
                                                                     ODID_CLASSIFICATION_TYPE_EU);
    place(in->operator_latitude_deg, in->operator_longitude_deg, &data.OperatorLatitude,
          &data.OperatorLongitude);
    data.AreaCount = in->area_count;
    data.AreaRadius = in->area_radius_m <= MAX_AREA_RADIUS ? in->area_radius_m : MAX_AREA_RADIUS;
    data.AreaCeiling = altitude(in->area_ceiling_m);
    data.AreaFloor = altitude(in->area_floor_m);
    if (data.ClassificationType == ODID_CLASSIFICATION_TYPE_EU) {
        data.CategoryEU =
            (ODID_category_EU_t)enumerated(in->category_eu, ODID_CATEGORY_EU_CERTIFIED);
        data.ClassEU = (ODID_class_EU_t)enumerated(in->class_eu, ODID_CLASS_EU_CLASS_6);
    }
    data.OperatorAltitudeGeo = altitude(in->operator_altitude_m);
    data.Timestamp = in->timestamp_2019_s;
    return encodeSystemMessage((ODID_System_encoded *)(void *)message, &data) == ODID_SUCCESS;
}

static bool encode_operator_id(const struct aircraft_view *view, uint8_t *message)
{
    ODID_OperatorID_data data;

    if (view->operator_id[0] == '\0') {
        return false;
    }
    odid_initOperatorIDData(&data);
    data.OperatorIdType = (ODID_operatorIdType_t)view->operator_id_type;
    text(data.OperatorId, view->operator_id, ODID_ID_SIZE);
    return encodeOperatorIDMessage((ODID_OperatorID_encoded *)(void *)message, &data) ==
           ODID_SUCCESS;
}

unsigned messages_available(const struct aircraft_view *view, enum message_type type)
{
    switch (type) {
    case MESSAGE_BASIC_ID:
        return view->basic_ids;
    case MESSAGE_AUTHENTICATION:
        return view->auth_pages;
    case MESSAGE_SELF_ID:
        return view->self_id_set ? 1 : 0;
    case MESSAGE_OPERATOR_ID:
        return view->operator_id[0] != '\0' ? 1 : 0;
    case MESSAGE_LOCATION:
    case MESSAGE_SYSTEM:
        return 1;
    case MESSAGE_TYPES:
        break;
    }
    return 0;
}

bool messages_encode(const struct aircraft_view *view, enum message_type type, unsigned index,
                     uint8_t message[MESSAGE_SIZE])
{
    memset(message, 0, MESSAGE_SIZE);
    switch (type) {
    case MESSAGE_BASIC_ID:
        return encode_basic_id(view, index, message);
    case MESSAGE_LOCATION:
        return encode_location(view, message);
    case MESSAGE_AUTHENTICATION:
        return encode_authentication(view, index, message);
    case MESSAGE_SELF_ID:
        return encode_self_id(view, message);
    case MESSAGE_SYSTEM:
        return encode_system(view, message);
    case MESSAGE_OPERATOR_ID:
        return encode_operator_id(view, message);
    case MESSAGE_TYPES:
        break;
    }
    return false;
}

/* ---- counters and wrapping ---- */

/* FNV-1a, seeded with what went before. */
static uint32_t hash(uint32_t seed, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        seed = (seed ^ bytes[i]) * 16777619U;
    }
    return seed;
}
#define HASH_START 2166136261U

/* The counter's value for this content: one on when it is another than the last. */
static uint8_t counter_for(struct messages_counter *counter, uint32_t content_hash)
{
    if (counter->used && counter->content_hash != content_hash) {
        counter->value++;
    }
    counter->used = true;
    counter->content_hash = content_hash;
    return counter->value;
}

/* All pages of one Authentication message carry the same counter: its content is all of them. */
static uint32_t authentication_hash(const struct aircraft_view *view)
{
    uint8_t page[MESSAGE_SIZE];
    uint32_t value = HASH_START;

    for (unsigned i = 0; i < view->auth_pages; i++) {
        if (messages_encode(view, MESSAGE_AUTHENTICATION, i, page)) {
            value = hash(value, page, sizeof(page));
        }
    }
    return value;
}

bool messages_legacy(struct messages_counters *counters, const struct aircraft_view *view,
                     enum message_type type, unsigned index, uint8_t data[MESSAGES_LEGACY_SIZE])
{
    uint8_t message[MESSAGE_SIZE];
    uint32_t content;

    if (!messages_encode(view, type, index, message)) {
        return false;
    }
    content = type == MESSAGE_AUTHENTICATION ? authentication_hash(view)
                                             : hash(HASH_START, message, sizeof(message));
    data[0] = MESSAGES_LEGACY_SIZE - 1;
    data[1] = 0x16; /* Service Data, 16-bit UUID */
    data[2] = 0xFA; /* 0xFFFA, ASTM Remote ID */
    data[3] = 0xFF;
    data[4] = APPLICATION_CODE;
    data[5] = counter_for(&counters->legacy[type], content);
    memcpy(data + 6, message, MESSAGE_SIZE);
    return true;
}

/* What goes first where there isn't room for all; part of a signature proves nothing. A position
 * without a serial number is nobody's, so these two stay. Who is on the ground takes no signature
 * away by a description. */
static void make_room(const struct aircraft_view *view, unsigned counts[MESSAGE_TYPES],
                      unsigned most)
{
    static const struct {
        enum message_type type;
        unsigned left;
    } order[] = {{MESSAGE_AUTHENTICATION, 0}, {MESSAGE_SELF_ID, 0},     {MESSAGE_BASIC_ID, 1},
                 {MESSAGE_SYSTEM, 0},         {MESSAGE_OPERATOR_ID, 0}, {MESSAGE_BASIC_ID, 0}};
    unsigned total = 0;

    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        total += counts[type];
    }
    if (view->description_spare && total - counts[MESSAGE_SELF_ID] == most) {
        total = most;
        counts[MESSAGE_SELF_ID] = 0;
    }
    for (size_t i = 0; total > most && i < sizeof(order) / sizeof(order[0]); i++) {
        unsigned *count = &counts[order[i].type];

        if (*count > order[i].left) {
            total -= *count - order[i].left;
            *count = order[i].left;
        }
    }
}

static void count_pack(const struct aircraft_view *view, unsigned most,
                       unsigned counts[MESSAGE_TYPES])
{
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        counts[type] = messages_available(view, type);
    }
    make_room(view, counts, most < MESSAGES_PACK_MAX ? most : MESSAGES_PACK_MAX);
}

bool messages_left_out(const struct aircraft_view *view, unsigned most, enum message_type type)
{
    unsigned whole[MESSAGE_TYPES], small[MESSAGE_TYPES];

    count_pack(view, MESSAGES_PACK_MAX, whole);
    count_pack(view, most, small);
    return small[type] < whole[type];
}

bool messages_exceed_pack(const struct aircraft_view *view, enum message_type type)
{
    unsigned whole[MESSAGE_TYPES];

    count_pack(view, MESSAGES_PACK_MAX, whole);
    return whole[type] < messages_available(view, type);
}

/* Returns the size of a pack whose messages end here. */
static size_t finish_pack(uint8_t pack[MESSAGES_PACK_SIZE], const uint8_t *end)
{
    pack[0] = ODID_MESSAGETYPE_PACKED << 4 | ODID_PROTOCOL_VERSION;
    pack[1] = MESSAGE_SIZE;
    pack[2] = (uint8_t)((end - (pack + 3)) / MESSAGE_SIZE);
    return (size_t)(end - pack);
}

size_t messages_pack_of(const struct aircraft_view *view, enum message_type type, unsigned index,
                        uint8_t pack[MESSAGES_PACK_SIZE])
{
    bool there = messages_encode(view, type, index, pack + 3);

    return finish_pack(pack, pack + 3 + (there ? MESSAGE_SIZE : 0));
}

size_t messages_pack(const struct aircraft_view *view, unsigned most,
                     uint8_t pack[MESSAGES_PACK_SIZE])
{
    unsigned counts[MESSAGE_TYPES];
    uint8_t *message = pack + 3;

    count_pack(view, most, counts);
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        for (unsigned index = 0; index < counts[type]; index++) {
            if (messages_encode(view, type, index, message)) {
                message += MESSAGE_SIZE;
            }
        }
    }
    return finish_pack(pack, message);
}

size_t messages_extended(struct messages_counter *counter, const uint8_t *pack, size_t pack_size,
                         uint8_t data[MESSAGES_EXTENDED_SIZE])
{
    data[0] = (uint8_t)(5 + pack_size);
    data[1] = 0x16;
    data[2] = 0xFA;
    data[3] = 0xFF;
    data[4] = APPLICATION_CODE;
    data[5] = counter_for(counter, hash(HASH_START, pack, pack_size));
    memcpy(data + 6, pack, pack_size);
    return 6 + pack_size;
}

size_t messages_element(struct messages_counter *counter, const uint8_t *pack, size_t pack_size,
                        uint8_t element[MESSAGES_ELEMENT_SIZE])
{
    element[0] = 0xDD; /* 802.11 vendor specific */
    element[1] = (uint8_t)(5 + pack_size);
    element[2] = 0xFA; /* ASD-STAN's OUI */
    element[3] = 0x0B;
    element[4] = 0xBC;
    element[5] = APPLICATION_CODE;
    element[6] = counter_for(counter, hash(HASH_START, pack, pack_size));
    memcpy(element + 7, pack, pack_size);
    return 7 + pack_size;
}
