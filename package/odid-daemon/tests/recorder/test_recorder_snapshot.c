/* The daemon's own JSON, as the recorder reads it; and how it is asked for. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <json-c/json_tokener.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "appliance/status_ask.h"
#include "flights/recorder_json.h"
#include "recorder/recorder_snapshot.h"
#include "status_fixture.h"

static struct recorder_snapshot snapshot;

/* As it goes over the socket: written, then parsed. */
static void take_fixture(void)
{
    struct json_object *made = make_json();
    const char *text = json_object_to_json_string_ext(made, JSON_C_TO_STRING_PLAIN);
    struct json_object *status = recorder_json_parse(text, strlen(text));

    assert_non_null(status);
    memset(&snapshot, 0, sizeof(snapshot));
    recorder_snapshot(&snapshot, status, NOW);
    json_object_put(status);
    json_object_put(made);
}

static void all_is_well(void **state)
{
    (void)state;
    fixture.condition.armed = true;
    fixture.radios[CHANNEL_WIFI].known = RADIO_COUNTED;
    take_fixture();
    assert_true(snapshot.answered);
    assert_int_equal(snapshot.channels[CHANNEL_WIFI].known, RADIO_COUNTED);
    assert_int_equal(snapshot.channels[CHANNEL_BT4].known, RADIO_SET);
    assert_int_equal(snapshot.daemon_start_us, NOW - 90000000);
    assert_true(snapshot.channels[CHANNEL_WIFI].required);
    assert_true(snapshot.channels[CHANNEL_WIFI].on_air);
    assert_int_equal(snapshot.channels[CHANNEL_WIFI].confirmed_us, NOW - 50000);
    assert_int_equal(snapshot.channels[CHANNEL_WIFI].unbroken_us, NOW - 4900000);
    assert_false(snapshot.channels[CHANNEL_BT5].required);
    assert_false(snapshot.channels[CHANNEL_BT5].disabled);
    assert_int_equal(snapshot.channels[CHANNEL_BT5].confirmed_us, INT64_MIN);
    assert_true(snapshot.armed_known && snapshot.armed);
    assert_true(snapshot.link && snapshot.position && snapshot.identity);
    assert_false(snapshot.two_sources || snapshot.emergency || snapshot.simulated);
    assert_int_equal(snapshot.unix_us, INT64_C(1767323045000000));
}

/* Two looks at one answer, or an answer that waited, are no gap in the broadcast. */
static void an_answer_of_a_moment_ago_tells_of_that_moment(void **state)
{
    static const struct {
        const char *text;
        int64_t expected_us;
    } answers[] = {
        {"{\"at_s\":99.75,\"uptime_s\":9}", 90750000},
        {"{\"at_s\":100.25,\"uptime_s\":9}", 91000000}, /* not made yet: no instant to count from */
        {"{\"at_s\":90.00,\"uptime_s\":9}", 91000000},  /* nobody waited so long */
        {"{\"uptime_s\":9}", 91000000},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(answers) / sizeof(answers[0]); i++) {
        struct json_object *status = recorder_json_parse(answers[i].text, strlen(answers[i].text));

        memset(&snapshot, 0, sizeof(snapshot));
        recorder_snapshot(&snapshot, status, 100000000);
        assert_int_equal(snapshot.daemon_start_us, answers[i].expected_us);
        json_object_put(status);
    }
}

static void nothing_is_well(void **state)
{
    (void)state;
    fixture.condition.heartbeat_fresh = fixture.condition.time_known = false;
    fixture.view.location.position_fresh = false;
    fixture.input.contradicted = true;
    fixture.view.operator_id[0] = fixture.config.operator_id[0] = '\0';
    radio_init(&fixture.radios[CHANNEL_WIFI], RADIO_ABSENT, NOW);
    radio_init(&fixture.radios[CHANNEL_BT5], RADIO_DISABLED, NOW);
    strcpy(fixture.radios[CHANNEL_WIFI].detail, "no \"socket\"");
    take_fixture();
    assert_false(snapshot.armed_known || snapshot.armed);
    assert_false(snapshot.link || snapshot.position || snapshot.identity);
    assert_true(snapshot.two_sources);
    assert_int_equal(snapshot.unix_us, 0);
    assert_true(snapshot.channels[CHANNEL_WIFI].required);
    assert_false(snapshot.channels[CHANNEL_WIFI].on_air);
    assert_true(snapshot.channels[CHANNEL_BT5].disabled);
    assert_int_equal(snapshot.channels[CHANNEL_WIFI].unbroken_us, INT64_MIN);
    assert_string_equal(snapshot.channels[CHANNEL_WIFI].text, "absent (no \"socket\")");
}

static void a_link_without_heartbeat_is_none(void **state)
{
    (void)state;
    fixture.link.state = LINK_SILENT;
    take_fixture();
    assert_false(snapshot.link);
    fixture.link.state = LINK_ALIVE;
    fixture.condition.heartbeat_fresh = false;
    take_fixture();
    assert_false(snapshot.link);
    assert_true(snapshot.speaks);
    fixture.input.speaks = false;
    take_fixture();
    assert_false(snapshot.speaks || snapshot.another_id);
    fixture.input.another_id = true;
    take_fixture();
    assert_true(snapshot.another_id);
    fixture.condition.heartbeat_fresh = true;
    fixture.view.basic_ids = 0;
    take_fixture();
    assert_true(snapshot.link);
    assert_false(snapshot.identity);
}

/* Whoever says it: aircraft.emergency isn't true of an autopilot's native status. A failure that is
 * a missing position's is that fault alone. */
static void what_is_broadcast_counts(void **state)
{
    (void)state;
    fixture.view.location.status = AIRCRAFT_EMERGENCY;
    take_fixture();
    assert_true(snapshot.emergency);
    assert_false(snapshot.failure);
    fixture.view.location.status = AIRCRAFT_REMOTE_ID_FAILURE;
    take_fixture();
    assert_true(snapshot.failure && snapshot.position);
    assert_false(snapshot.emergency);
    fixture.view.location.position_fresh = false;
    take_fixture();
    assert_false(snapshot.failure || snapshot.position);
}

/* A daemon that was taken over said once that it will be on the air in eleven days, and no silence
 * counted until then. */
static void nothing_was_in_the_future(void **state)
{
    static const char text[] = "{\"channels\":{\"bt4\":{\"state\":\"on air\",\"required\":true,"
                               "\"confirmed_s\":-1000000,\"unbroken_s\":-1000000}}}";
    struct json_object *status = recorder_json_parse(text, strlen(text));

    (void)state;
    memset(&snapshot, 0, sizeof(snapshot));
    recorder_snapshot(&snapshot, status, NOW);
    assert_true(snapshot.channels[CHANNEL_BT4].confirmed_us == NOW);
    assert_true(snapshot.channels[CHANNEL_BT4].unbroken_us == NOW);
    json_object_put(status);
}

static void something_else(void **state)
{
    static const char *const texts[] = {
        "{}",
        "{\"channels\":7,\"aircraft\":{\"armed\":\"yes\"},\"uptime_s\":\"1\",\"time\":{\"utc\":3}}",
        "{\"channels\":{\"bt4\":{\"state\":1,\"required\":1,\"confirmed_s\":1e99,\"unbroken_s\":0}}"
        "}",
        "{\"time\":{\"utc\":\"2026-01-02T03:04:05Z and more\"},\"identity\":{\"basic_ids\":{}}}",
    };

    (void)state;
    for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
        struct json_object *status = recorder_json_parse(texts[i], strlen(texts[i]));

        assert_non_null(status);
        memset(&snapshot, 0, sizeof(snapshot));
        recorder_snapshot(&snapshot, status, NOW);
        assert_false(snapshot.armed_known || snapshot.link || snapshot.identity);
        assert_int_equal(snapshot.unix_us, 0);
        assert_int_equal(snapshot.channels[CHANNEL_BT4].confirmed_us, INT64_MIN);
        json_object_put(status);
    }
    assert_null(recorder_json_parse("[1]", 3));
    assert_null(recorder_json_parse("{\"a\":", 5));
    assert_null(recorder_json_parse("", 0));
}

/* ---- asking ---- */

static char directory[] = "/tmp/odid-ask-XXXXXX";
static char answer[STATUS_ANSWER_MAX];

static int listen_there(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    snprintf(address.sun_path, sizeof(address.sun_path), "%s/%s", directory, STATUS_SOCKET);
    unlink(address.sun_path);
    assert_int_equal(bind(fd, (const struct sockaddr *)&address, sizeof(address)), 0);
    assert_int_equal(listen(fd, 1), 0);
    return fd;
}

/* In two pieces, with a pause between them. */
static void *answer_slowly(void *context)
{
    int fd = accept(*(int *)context, NULL, NULL);

    assert_int_equal(write(fd, "{\"a\"", 4), 4);
    usleep(50000);
    assert_int_equal(write(fd, ":1}", 3), 3);
    close(fd);
    return NULL;
}

static void asking_the_daemon(void **state)
{
    char path[128], long_directory[200];
    pthread_t thread;
    int64_t begin_us;
    int server;

    (void)state;
    assert_non_null(mkdtemp(directory));
    assert_int_equal(status_ask(directory, 500, answer), -ENOENT);
    server = listen_there();
    assert_int_equal(pthread_create(&thread, NULL, answer_slowly, &server), 0);
    assert_int_equal(status_ask(directory, 5000, answer), 7);
    assert_memory_equal(answer, "{\"a\":1}", 7);
    pthread_join(thread, NULL);
    begin_us = loop_now_us();
    for (int i = 0; i < 6; i++) { /* it hangs; then its backlog is full, too */
        assert_int_equal(status_ask(directory, 100, answer), -EAGAIN);
    }
    assert_true(loop_now_us() - begin_us >= 100000);
    close(server);
    assert_int_equal(status_ask(directory, 500, answer), -ECONNREFUSED);
    memset(long_directory, 'x', sizeof(long_directory) - 1);
    long_directory[sizeof(long_directory) - 1] = '\0';
    assert_int_equal(status_ask(long_directory, 500, answer), -ENAMETOOLONG);
    snprintf(path, sizeof(path), "%s/%s", directory, STATUS_SOCKET);
    unlink(path);
    rmdir(directory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(all_is_well),
        TEST(an_answer_of_a_moment_ago_tells_of_that_moment),
        TEST(nothing_is_well),
        TEST(a_link_without_heartbeat_is_none),
        TEST(what_is_broadcast_counts),
        TEST(nothing_was_in_the_future),
        TEST(something_else),
        TEST(asking_the_daemon),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
