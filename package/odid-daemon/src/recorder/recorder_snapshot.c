#include "recorder/recorder_snapshot.h"

#include <stdio.h>
#include <string.h>

#include "base/utf8.h"
#include "flights/recorder_json.h"

/* An answer is handed out for a quarter of a second, and may wait for its reader's patience. */
#define OLDEST_US 3000000

/* When the answer was made: its ages are counted back from there. */
static int64_t made_us(struct json_object *status, int64_t now_us)
{
    int64_t at_us = recorder_json_us(status, "at_s", now_us);

    return at_us > now_us || now_us - at_us > OLDEST_US ? now_us : at_us;
}

/* When something was that is an age in the status, and not in the future; INT64_MIN for never. */
static int64_t instant(struct json_object *object, const char *path, int64_t now_us)
{
    int64_t age_us = recorder_json_us(object, path, INT64_MIN);

    return age_us == INT64_MIN ? INT64_MIN : now_us - (age_us > 0 ? age_us : 0);
}

static void read_channel(struct recorder_channel_status *out, struct json_object *channel,
                         int64_t now_us)
{
    const char *state = recorder_json_text(channel, "state", "unknown");
    char text[256];

    out->required = recorder_json_true(channel, "required");
    out->on_air = strcmp(state, "on air") == 0;
    out->disabled = strcmp(state, "disabled") == 0;
    out->known = out->on_air ? recorder_json_known(channel) : RADIO_SET;
    out->confirmed_us = instant(channel, "confirmed_s", now_us);
    out->unbroken_us = instant(channel, "unbroken_s", now_us);
    out->paused_us = instant(channel, "paused_s", now_us);
    if (out->confirmed_us == INT64_MIN || out->unbroken_us == INT64_MIN) {
        out->confirmed_us = out->unbroken_us = INT64_MIN; /* neither without the other */
    }
    snprintf(text, sizeof(text), "%s (%s)", state,
             recorder_json_text(channel, "detail", "no details"));
    utf8_clean(out->text, sizeof(out->text), text);
}

void recorder_snapshot(struct recorder_snapshot *snapshot, struct json_object *status,
                       int64_t now_us)
{
    struct json_object *armed = recorder_json_find(status, "aircraft.armed");
    struct json_object *ids = recorder_json_find(status, "identity.basic_ids");
    const char *broadcast = recorder_json_text(status, "position.status", "");
    char path[32];

    now_us = made_us(status, now_us);
    snapshot->answered = true;
    snapshot->daemon_start_us = now_us - recorder_json_us(status, "uptime_s", 0);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        snprintf(path, sizeof(path), "channels.%s", channel_name(channel));
        read_channel(&snapshot->channels[channel], recorder_json_find(status, path), now_us);
    }
    snapshot->armed_known = json_object_is_type(armed, json_type_boolean);
    snapshot->armed = snapshot->armed_known && json_object_get_boolean(armed);
    snapshot->link = strcmp(recorder_json_text(status, "link.state", ""), "alive") == 0 &&
                     recorder_json_true(status, "aircraft.heartbeat");
    snapshot->speaks = recorder_json_true(status, "aircraft.speaks");
    snapshot->another_id = recorder_json_true(status, "aircraft.another_id");
    snapshot->position = recorder_json_true(status, "position.fresh");
    snapshot->identity = json_object_is_type(ids, json_type_array) &&
                         json_object_array_length(ids) > 0 &&
                         recorder_json_find(status, "identity.operator_id.operator_id") != NULL;
    snapshot->emergency = strcmp(broadcast, "emergency") == 0;
    /* Without a position it is said as well: that is that fault, and not two. */
    snapshot->failure = snapshot->position && strcmp(broadcast, "remote ID system failure") == 0;
    snapshot->simulated = recorder_json_true(status, "aircraft.simulated");
    snapshot->two_sources = recorder_json_true(status, "mavlink.contradicted");
    snapshot->unix_us = recorder_json_utc_us(status, "time.utc");
}
