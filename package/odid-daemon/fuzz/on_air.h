/*
 * What must hold for everything that goes on the air, whatever came in:
 * judged by opendroneid-core-c's decoder. A broken rule ends the process.
 */
#ifndef ODID_FUZZ_ON_AIR_H
#define ODID_FUZZ_ON_AIR_H

#include <math.h>
#include <opendroneid.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/messages.h"

#define MUST(rule)                                                                                 \
    do {                                                                                           \
        if (!(rule)) {                                                                             \
            fprintf(stderr, "%s:%d: broken: %s\n", __FILE__, __LINE__, #rule);                     \
            abort();                                                                               \
        }                                                                                          \
    } while (0)

static inline void judge_altitude(float metres)
{
    MUST(metres == INV_ALT || (metres >= -999.5F && metres <= MAX_ALT));
}

static inline void judge_place(double latitude, double longitude)
{
    MUST(latitude >= -90 && latitude <= 90);
    MUST(longitude >= -180 && longitude <= 180);
}

static inline void judge_location(const ODID_Location_data *at)
{
    MUST(at->Status <= ODID_STATUS_REMOTE_ID_SYSTEM_FAILURE);
    MUST((at->Direction >= 0 && at->Direction < 360) || at->Direction == INV_DIR);
    MUST((at->SpeedHorizontal >= 0 && at->SpeedHorizontal <= MAX_SPEED_H) ||
         at->SpeedHorizontal == INV_SPEED_H);
    MUST((at->SpeedVertical >= MIN_SPEED_V && at->SpeedVertical <= MAX_SPEED_V) ||
         at->SpeedVertical == INV_SPEED_V);
    judge_place(at->Latitude, at->Longitude);
    judge_altitude(at->AltitudeBaro);
    judge_altitude(at->AltitudeGeo);
    judge_altitude(at->Height);
    MUST(at->HorizAccuracy <= ODID_HOR_ACC_1_METER);
    MUST(at->VertAccuracy <= ODID_VER_ACC_1_METER);
    MUST(at->BaroAccuracy <= ODID_VER_ACC_1_METER);
    MUST(at->SpeedAccuracy <= ODID_SPEED_ACC_0_3_METERS_PER_SECOND);
    MUST(at->TSAccuracy <= ODID_TIME_ACC_1_5_SECOND);
    MUST((at->TimeStamp >= 0 && at->TimeStamp <= MAX_TIMESTAMP) || at->TimeStamp == INV_TIMESTAMP);
}

static inline void judge_system(const ODID_System_data *of)
{
    MUST(of->OperatorLocationType <= ODID_OPERATOR_LOCATION_TYPE_FIXED);
    MUST(of->ClassificationType <= ODID_CLASSIFICATION_TYPE_EU);
    MUST(of->CategoryEU <= ODID_CATEGORY_EU_CERTIFIED);
    MUST(of->ClassEU <= ODID_CLASS_EU_CLASS_6);
    MUST(of->AreaRadius <= MAX_AREA_RADIUS);
    judge_place(of->OperatorLatitude, of->OperatorLongitude);
    judge_altitude(of->OperatorAltitudeGeo);
    judge_altitude(of->AreaCeiling);
    judge_altitude(of->AreaFloor);
}

static inline void judge_message(const uint8_t *message)
{
    ODID_Location_data location;
    ODID_System_data system;
    ODID_BasicID_data id;
    ODID_Auth_data auth;
    ODID_SelfID_data self;
    ODID_OperatorID_data operator_id;

    MUST((message[0] & 15) == ODID_PROTOCOL_VERSION);
    switch (message[0] >> 4) {
    case MESSAGE_BASIC_ID:
        MUST(decodeBasicIDMessage(&id, (const void *)message) == ODID_SUCCESS);
        MUST(id.IDType <= ODID_IDTYPE_SPECIFIC_SESSION_ID && id.UAType <= ODID_UATYPE_OTHER);
        break;
    case MESSAGE_LOCATION:
        MUST(decodeLocationMessage(&location, (const void *)message) == ODID_SUCCESS);
        judge_location(&location);
        break;
    case MESSAGE_AUTHENTICATION:
        MUST(decodeAuthMessage(&auth, (const void *)message) == ODID_SUCCESS);
        break;
    case MESSAGE_SELF_ID:
        MUST(decodeSelfIDMessage(&self, (const void *)message) == ODID_SUCCESS);
        break;
    case MESSAGE_SYSTEM:
        MUST(decodeSystemMessage(&system, (const void *)message) == ODID_SUCCESS);
        judge_system(&system);
        break;
    case MESSAGE_OPERATOR_ID:
        MUST(decodeOperatorIDMessage(&operator_id, (const void *)message) == ODID_SUCCESS);
        break;
    default:
        MUST(!"a type that does not exist");
    }
}

/* Every message that exists can be sent, and the same content twice has the same counter. */
static inline void judge_legacy(const struct aircraft_view *view,
                                struct messages_counters *counters)
{
    uint8_t data[MESSAGES_LEGACY_SIZE], again[MESSAGES_LEGACY_SIZE];

    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        unsigned count = messages_available(view, type);

        MUST(count > 0 || (type != MESSAGE_LOCATION && type != MESSAGE_SYSTEM));
        MUST(count <= (type == MESSAGE_BASIC_ID         ? 2
                       : type == MESSAGE_AUTHENTICATION ? TELEMETRY_AUTH_PAGES
                                                        : 1));
        for (unsigned index = 0; index < count; index++) {
            MUST(messages_legacy(counters, view, type, index, data));
            MUST(data[0] == 0x1E && data[4] == 0x0D && data[6] >> 4 == (uint8_t)type);
            judge_message(data + 6);
            MUST(messages_legacy(counters, view, type, index, again));
            MUST(memcmp(data, again, sizeof(data)) == 0);
        }
        MUST(!messages_legacy(counters, view, type, count, data) || count == 1);
    }
}

/* Every receiver would take the pack: its shape, the order, nothing twice. */
static inline void judge_pack(const struct aircraft_view *view, struct messages_counter *counter)
{
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_EXTENDED_SIZE], element[MESSAGES_ELEMENT_SIZE];
    size_t size = messages_pack(view, MESSAGES_PACK_MAX, pack);
    ODID_MessagePack_encoded encoded;
    ODID_UAS_Data uas;

    MUST(pack[0] == 0xF2 && pack[1] == MESSAGE_SIZE);
    MUST(pack[2] >= 2 && pack[2] <= MESSAGES_PACK_MAX && size == 3U + pack[2] * MESSAGE_SIZE);
    for (unsigned i = 0; i < pack[2]; i++) {
        judge_message(pack + 3 + i * MESSAGE_SIZE);
        MUST(i == 0 || pack[3 + i * MESSAGE_SIZE] >= pack[3 + (i - 1) * MESSAGE_SIZE]);
    }
    memset(&encoded, 0, sizeof(encoded));
    memcpy(&encoded, pack, size);
    odid_initUasData(&uas);
    MUST(decodeMessagePack(&uas, &encoded) == ODID_SUCCESS);
    MUST(uas.LocationValid && uas.SystemValid);
    MUST(messages_extended(counter, pack, size, data) == size + 6 && data[0] == size + 5);
    MUST(messages_element(counter, pack, size, element) == size + 7 && element[1] == size + 5);
    MUST(data[5] == element[6]);
}

#endif
