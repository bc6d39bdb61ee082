#include "daemon/asking.h"

#include <common/mavlink.h>
#include <string.h>

/* An answer that takes longer is none. */
#define ANSWER_US 1000000
/* What comes of itself comes within this time. */
#define SETTLE_US 2000000
#define AGAIN_US 3000000
#define AGAIN_MAX_US 48000000
#define VITAL_AGAIN_MAX_US 6000000
/* So much slower than it was asked for is as often as needed. */
#define SLOWER(interval_us) ((interval_us)*13 / 10)
#define MISSED 3
#define VITAL 3 /* the first ones of those that are needed */
#define REFUSALS 2
/* What begins so long after it was asked for was asked for in vain, and begins by itself. */
#define DONE_US 1500000
/* So many questions without any answer: nobody hears them. */
#define UNHEARD 10
/* Without another question; and where the last one had no answer, until that is sure. */
#define PROBE_US 20000000
#define PROBE_AGAIN_US 3000000

static const struct {
    enum telemetry_kind kind;
    struct asking_request request;
} needed[ASKING_MESSAGES] = {
    {TELEMETRY_HEARTBEAT, {MAVLINK_MSG_ID_HEARTBEAT, 1000000}},
    {TELEMETRY_GPS_RAW, {MAVLINK_MSG_ID_GPS_RAW_INT, 1000000}}, /* no position counts without */
    {TELEMETRY_GLOBAL_POSITION, {MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 200000}},
    {TELEMETRY_SYSTEM_TIME, {MAVLINK_MSG_ID_SYSTEM_TIME, 1000000}},
    {TELEMETRY_LANDED_STATE, {MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1000000}},
    {TELEMETRY_HOME, {MAVLINK_MSG_ID_HOME_POSITION, 1000000}},
    {TELEMETRY_GPS2_RAW, {MAVLINK_MSG_ID_GPS2_RAW, 1000000}},
};
enum { HEARTBEAT = 0, GPS_RAW = 1, GPS2_RAW = ASKING_MESSAGES - 1 };

void asking_begin(struct asking *asking, int64_t now_us)
{
    memset(asking, 0, sizeof(*asking));
    asking->asked = -1;
    asking->asked_us = now_us;
    for (unsigned i = 0; i < ASKING_MESSAGES; i++) {
        asking->message[i].heard_us = INT64_MIN;
        asking->message[i].from_us = now_us + SETTLE_US;
        asking->message[i].wait_us = AGAIN_US;
    }
}

/* An answer doesn't say to what; it may be to another station's command, or a late one. */
static bool is_refused(const struct asking *asking, unsigned which)
{
    return asking->message[which].refusals >= REFUSALS;
}

/* What no position counts without is asked for all the same. */
static bool is_given_up(const struct asking *asking, unsigned which)
{
    return which >= VITAL && is_refused(asking, which);
}

static int64_t longest_wait_us(unsigned which)
{
    return which < VITAL ? VITAL_AGAIN_MAX_US : AGAIN_MAX_US;
}

static void take_ack(struct asking *asking, const struct telemetry_update *update)
{
    if (update->command_ack.command != MAV_CMD_SET_MESSAGE_INTERVAL) {
        return; /* nor does MAVLink 1 say to whom */
    }
    asking->unanswered = 0;
    if (asking->asked < 0) {
        return;
    }
    if (update->command_ack.result == MAV_RESULT_DENIED ||
        update->command_ack.result == MAV_RESULT_UNSUPPORTED) {
        asking->message[asking->asked].refusals++;
    }
    asking->asked = -1;
}

static void measure(struct asking_message *message, int64_t now_us)
{
    if (message->heard_us != INT64_MIN) {
        int64_t interval_us = now_us - message->heard_us;

        message->mean_us +=
            message->mean_us == 0 ? interval_us : (interval_us - message->mean_us) / 4;
    }
    message->heard_us = now_us;
}

/* As often as needed, as far as is known. */
static bool is_often(const struct asking_message *message, const struct asking_request *request)
{
    return message->mean_us <= SLOWER((int64_t)request->interval_us);
}

void asking_heard(struct asking *asking, const struct telemetry_update *update, int64_t now_us)
{
    if (update->kind == TELEMETRY_COMMAND_ACK) {
        take_ack(asking, update);
        return;
    }
    if (update->kind == TELEMETRY_GPS_RAW) {
        asking->fix = update->gps_raw.fix_type >= GPS_FIX_TYPE_2D_FIX;
    }
    for (unsigned i = 0; i < ASKING_MESSAGES; i++) {
        struct asking_message *message = &asking->message[i];

        if (needed[i].kind == update->kind) {
            message->done =
                message->asked_for && (message->done || now_us - message->asked_us <= DONE_US);
            measure(message, now_us);
            /* It is obeyed, so whoever switches it off again, or makes it slower, is answered as
             * soon as it is missed. */
            if (i < VITAL && message->asked_for && is_often(message, &needed[i].request)) {
                message->from_us = now_us + MISSED * (int64_t)needed[i].request.interval_us;
                message->wait_us = AGAIN_US;
            }
        }
    }
}

static bool comes(const struct asking_message *message, const struct asking_request *request,
                  int64_t now_us)
{
    return message->mean_us != 0 && is_often(message, request) &&
           now_us - message->heard_us <= MISSED * (int64_t)request->interval_us;
}

static bool is_needed(const struct asking *asking, unsigned which, bool apart, int64_t now_us)
{
    return which != GPS2_RAW || !asking->fix || apart ||
           !comes(&asking->message[GPS_RAW], &needed[GPS_RAW].request, now_us);
}

static void put_question(struct asking *asking, int which, int64_t now_us,
                         struct asking_request *request)
{
    *request = needed[which].request;
    asking->asked = which;
    asking->asked_us = now_us;
    asking->unanswered++;
}

static bool is_waited_for(struct asking *asking, int64_t now_us)
{
    if (asking->asked >= 0 && now_us - asking->asked_us >= ANSWER_US) {
        asking->asked = -1;
    }
    return asking->asked >= 0;
}

bool asking_probe(struct asking *asking, int64_t now_us, struct asking_request *request)
{
    bool unsure = asking->unanswered > 0 && asking->unanswered < UNHEARD;

    if (is_waited_for(asking, now_us) ||
        now_us - asking->asked_us < (unsure ? PROBE_AGAIN_US : PROBE_US)) {
        return false;
    }
    put_question(asking, HEARTBEAT, now_us, request);
    return true;
}

bool asking_next(struct asking *asking, bool apart, int64_t now_us, struct asking_request *request)
{
    if (is_waited_for(asking, now_us)) {
        return false;
    }
    for (int i = 0; i < ASKING_MESSAGES; i++) {
        struct asking_message *message = &asking->message[i];

        if (comes(message, &needed[i].request, now_us)) {
            if (message->done) { /* that is an answer */
                asking->unanswered = 0;
                message->done = false;
            }
            message->wait_us = AGAIN_US;
        } else if (is_needed(asking, (unsigned)i, apart, now_us) &&
                   !is_given_up(asking, (unsigned)i) && now_us >= message->from_us &&
                   asking->asked < 0) {
            put_question(asking, i, now_us, request);
            message->asked_for = true;
            message->asked_us = now_us;
            message->done = false;
            message->from_us = now_us + message->wait_us;
            message->wait_us *= message->wait_us < longest_wait_us((unsigned)i) ? 2 : 1;
            message->heard_us = INT64_MIN; /* measured anew */
            message->mean_us = 0;
        }
    }
    return asking->asked >= 0 || asking_probe(asking, now_us, request);
}

bool asking_unheard(const struct asking *asking)
{
    return asking->unanswered >= UNHEARD;
}

unsigned asking_refused(const struct asking *asking, int64_t now_us,
                        uint16_t message_ids[ASKING_MESSAGES])
{
    unsigned count = 0;

    for (unsigned i = 0; i < ASKING_MESSAGES; i++) {
        if (i != GPS2_RAW && is_refused(asking, i) &&
            !comes(&asking->message[i], &needed[i].request, now_us)) {
            message_ids[count++] = needed[i].request.message_id;
        }
    }
    return count;
}
