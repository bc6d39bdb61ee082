/*
 * Any view, any bit pattern in its numbers -> messages and packs that every
 * receiver takes. Only what aircraft guarantees is kept: counts within their
 * arrays, terminated texts, pages numbered from 0.
 */
#include "on_air.h"

static struct aircraft_view view;

static bool as_bool(uint8_t byte)
{
    return byte & 1;
}

/* A bool of an arbitrary bit pattern would be undefined behaviour in itself. */
static void repair(const uint8_t *data, size_t size)
{
    uint8_t choice = size > 0 ? data[0] : 0;

    view.basic_ids = choice % 3;
    view.auth_pages = (choice >> 3) % (TELEMETRY_AUTH_PAGES + 1);
    view.self_id_set = as_bool(choice >> 2);
    view.location.height_above_ground = as_bool(choice >> 7);
    view.location.position_fresh = false;
    view.description_spare = as_bool(choice >> 6);
    view.description[sizeof(view.description) - 1] = '\0';
    view.operator_id[sizeof(view.operator_id) - 1] = '\0';
    for (unsigned i = 0; i < TELEMETRY_AUTH_PAGES; i++) {
        view.auth[i].page = (uint8_t)i;
        view.auth[i].last_page %= TELEMETRY_AUTH_PAGES;
    }
    /* What takes the room of enumerations holds one of their values. */
    view.location.status = (enum aircraft_status)(choice % 5);
    view.location.status_source = view.location.position_source = SOURCE_NONE;
    view.location.motion_source = view.system.operator_source = SOURCE_NONE;
    view.basic_id[0].source = view.basic_id[1].source = SOURCE_NONE;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct messages_counters counters = {0};
    struct messages_counter counter = {0};

    memset(&view, 0, sizeof(view));
    if (size > 1) {
        memcpy(&view, data + 1, size - 1 < sizeof(view) ? size - 1 : sizeof(view));
    }
    repair(data, size);
    judge_legacy(&view, &counters);
    judge_pack(&view, &counter);
    return 0;
}
