/* The status: the JSON, the socket. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <json-c/json_tokener.h>
#include <json-c/linkhash.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "appliance/status_ask.h"
#include "daemon/status.h"
#include "loop_until.h"
#include "status_fixture.h"

/* What a process with CAP_NET_ADMIN can make the kernel's default of each socket: the least. */
int accept4(int fd, struct sockaddr *address, socklen_t *size, int flags)
{
    const int least = 0;
    int accepted = (int)syscall(SYS_accept4, fd, address, size, flags);

    setsockopt(accepted, SOL_SOCKET, SO_SNDBUF, &least, sizeof(least));
    return accepted;
}

/* ---- JSON ---- */

/* Each key, in order: what odidctl(1) documents. */
static void field_names(struct json_object *object, char *out, size_t size)
{
    size_t filled = strlen(out);

    json_object_object_foreach(object, name, value)
    {
        filled += (size_t)snprintf(out + filled, size - filled, "%s%s", filled ? " " : "", name);
        (void)value;
    }
}

static void expect_fields(struct json_object *root, const char *path, const char *fields)
{
    struct json_object *object = path == NULL ? root : json_object_object_get(root, path);
    char names[512] = "";

    assert_non_null(object);
    field_names(object, names, sizeof(names));
    assert_string_equal(names, fields);
}

static void stable_names(void **state)
{
    struct json_object *root = make_json(), *channels;

    (void)state;
    expect_fields(
        root, NULL,
        "version at_s uptime_s on_air reason channels link mavlink vehicle identity position "
        "operator time aircraft problems configuration schedule privilege");
    expect_fields(root, "channels", "bt4 bt5 wifi");
    channels = json_object_object_get(root, "channels");
    expect_fields(channels, "bt4",
                  "title state detail known required stuck silent since_s last_accepted_s "
                  "confirmed_s unbroken_s paused_s payloads replaced starts repairs failures");
    expect_fields(root, "link",
                  "name state detail since_s bytes_in bytes_out bytes_dropped overrun opened "
                  "senders");
    expect_fields(root, "mavlink",
                  "frames bad_crc unknown_id refused other_transmitter other_aircraft "
                  "other_system not_needed not_believed contradicted");
    expect_fields(root, "identity", "basic_ids operator_id self_id classification");
    expect_fields(root, "position",
                  "source fresh age_s latitude_deg longitude_deg altitude_geodetic_m "
                  "altitude_barometric_m height_m height_above motion_source direction_deg "
                  "speed_mps vertical_speed_mps timestamp_s status status_source");
    expect_fields(root, "operator", "source location_type latitude_deg longitude_deg altitude_m");
    expect_fields(root, "time", "known utc");
    expect_fields(root, "aircraft",
                  "heartbeat speaks another_id armed emergency simulated mav_type autopilot "
                  "restarts takeoff_known "
                  "takeoff_is_home takeoff_is_late fix_known vertical_inverted position_rate_hz "
                  "refused_messages");
    expect_fields(root, "configuration", "errors fingerprint sentences");
    expect_fields(root, "schedule", "slots skipped slot_lateness_p99_us slot_lateness_max_us");
    expect_fields(root, "privilege", "realtime filter filter_logging");
    json_object_put(root);
}

static void expect_json(const char *path, const char *expected)
{
    struct json_object *root = make_json(), *object = root;
    char name[64];

    for (const char *dot; path != NULL; path = dot == NULL ? NULL : dot + 1) {
        dot = strchr(path, '.');
        snprintf(name, sizeof(name), "%.*s", dot == NULL ? 63 : (int)(dot - path), path);
        object = json_object_object_get(object, name);
    }
    assert_string_equal(json_object_to_json_string_ext(object, JSON_C_TO_STRING_PLAIN), expected);
    json_object_put(root);
}

static void values(void **state)
{
    (void)state;
    expect_json("uptime_s", "90.00");
    expect_json("on_air", "true");
    expect_json("reason", "null");
    expect_json("vehicle", "1");
    expect_json("channels.bt5.required", "false");
    expect_json("channels.bt5.last_accepted_s", "null");
    expect_json("channels.wifi.last_accepted_s", "0.10");
    expect_json("channels.wifi.confirmed_s", "0.05");
    expect_json("channels.wifi.unbroken_s", "4.90");
    expect_json("channels.bt5.unbroken_s", "null");
    expect_json("channels.wifi.paused_s", "5.90");
    expect_json("position.latitude_deg", "57.7089000");
    expect_json("position.altitude_barometric_m", "null");
    expect_json("position.direction_deg", "null");
    expect_json("position.vertical_speed_mps", "-0.25");
    expect_json("position.age_s", "0.25");
    expect_json("time.utc", "\"2026-01-02T03:04:05Z\"");
    expect_json("identity.basic_ids",
                "[{\"uas_id\":\"SSRS5GBG01\",\"id_type\":\"serial\",\"ua_type\":\"aeroplane\","
                "\"source\":\"configuration\",\"validity\":\"valid\"}]");
    expect_json("identity.operator_id",
                "{\"operator_id\":\"SWE3jxza7qbzvu5d\",\"source\":\"configuration\","
                "\"validity\":\"structure right\"}");
    expect_json("identity.classification",
                "{\"type\":\"eu\",\"category\":\"specific\",\"class\":\"C4\",\"source\":null}");
    expect_json("problems", "[]");
    expect_json("configuration",
                "{\"errors\":0,\"fingerprint\":\"0123456789abcdef\",\"sentences\":[]}");
    expect_json("schedule", "{\"slots\":0,\"skipped\":0,\"slot_lateness_p99_us\":null,"
                            "\"slot_lateness_max_us\":null}");
}

static void what_is_unknown_is_null(void **state)
{
    (void)state;
    fixture.view = (struct aircraft_view){.location.fix_us = INT64_MIN};
    fixture.view.location.latitude_deg = fixture.view.location.speed_mps = NAN;
    fixture.view.location.altitude_geodetic_m = INFINITY;
    fixture.view.system.operator_latitude_deg = NAN;
    fixture.condition = (struct aircraft_condition){.position_rate_hz = NAN};
    fixture.config.description[0] = fixture.config.operator_id[0] = '\0';
    expect_json("position.source", "null");
    expect_json("position.latitude_deg", "null");
    expect_json("position.altitude_geodetic_m", "null");
    expect_json("position.age_s", "null");
    expect_json("operator.source", "null");
    expect_json("time.utc", "null");
    expect_json("aircraft.armed", "null");
    expect_json("aircraft.position_rate_hz", "null");
    expect_json("identity.operator_id", "{\"operator_id\":null,\"source\":null,\"validity\":null}");
    expect_json("identity.basic_ids", "[]");
    expect_json("identity.self_id.source", "null");
}

/* Its HEARTBEATs are kept from us: the page and the flight record had no word of what is broadcast.
 */
static void what_flies_without_heartbeats_is_armed(void **state)
{
    (void)state;
    fixture.condition.heartbeat_fresh = false;
    fixture.condition.armed = fixture.condition.emergency = true;
    expect_json("aircraft.heartbeat", "false");
    expect_json("aircraft.armed", "true");
    expect_json("aircraft.emergency", "true");
    fixture.condition.armed = fixture.condition.emergency = false;
    expect_json("aircraft.armed", "null");
    expect_json("aircraft.emergency", "null");
}

/* From outside come any bytes, and numbers with their secret part. */
static void foreign_bytes(void **state)
{
    (void)state;
    strcpy(fixture.view.description, "R\xE4"
                                     "dd\x01ning");
    expect_json("identity.self_id.description", "\"R?dd?ning\"");
    strcpy(fixture.view.operator_id, "FIN87astrdge12k8-xyz");
    fixture.config.operator_id[0] = '\0';
    expect_json("identity.operator_id",
                "{\"operator_id\":\"FIN87astrdge12k8\",\"source\":\"native\","
                "\"validity\":\"valid\"}");
}

static void problems_and_sentences(void **state)
{
    (void)state;
    fixture.view.basic_ids = 0;
    fixture.input.config_errors = 1;
    strcpy(sentences[0], "odid.conf line 2: [mavlink] udp_port = \"0\": expected 1-65535");
    expect_json("reason", "\"missing basic_id message\"");
    expect_json("problems", "[{\"id\":\"basic-id-missing\",\"severity\":\"fault\",\"reason\":"
                            "\"missing basic_id message\",\"advice\":\"Set "
                            "[basic_id] uas_id in odid.conf to the aircraft's serial number.\"},"
                            "{\"id\":\"configuration-values\",\"severity\":\"warning\",\"reason\":"
                            "\"configuration: 1 value not "
                            "usable\",\"advice\":\"odidctl check FILE lists them, and what is used "
                            "instead.\"}]");
    expect_json("configuration.fingerprint", "\"0123456789abcdef\"");
    expect_json("configuration.sentences",
                "[\"odid.conf line 2: [mavlink] udp_port = \\\"0\\\": expected 1-65535\"]");
}

/* ---- the socket ---- */

static char directory[] = "/tmp/odid-status-XXXXXX";
static char answer[65536];

static int connect_to_status(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    snprintf(address.sun_path, sizeof(address.sun_path), "%s/%s", directory, STATUS_SOCKET);
    if (connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        close(fd);
        return -1;
    }
    return fd;
}

static int reader = -1;

static bool is_answered(void)
{
    return poll(&(struct pollfd){.fd = reader, .events = POLLRDHUP}, 1, 0) == 1;
}

static void read_answer(void)
{
    size_t filled = 0;
    ssize_t got;

    while ((got = read(reader, answer + filled, sizeof(answer) - 1 - filled)) > 0) {
        filled += (size_t)got;
    }
    answer[filled] = '\0';
}

/* One that never reads and one that leaves at once are among those who ask. */
static void over_the_socket(void **state)
{
    char path[64];
    struct json_object *status;
    struct stat file;
    unsigned calls = 0;
    int silent;

    (void)state;
    for (int i = 0; i < 2; i++) { /* control characters are six octets each */
        memset(sentences[i], '\x01', sizeof(sentences[i]) - 1);
        sentences[i][sizeof(sentences[i]) - 1] = '\0';
    }
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    assert_non_null(mkdtemp(directory));
    snprintf(path, sizeof(path), "%s/%s", directory, STATUS_SOCKET);
    fclose(fopen(path, "we")); /* left behind by the one before */
    assert_int_equal(loop_init(), 0);
    assert_int_equal(status_start(directory, gather, &calls), 0);
    assert_int_equal(stat(path, &file), 0);
    assert_true(S_ISSOCK(file.st_mode));
    assert_int_equal(file.st_mode & 0777, 0660);
    silent = connect_to_status();
    close(connect_to_status());
    reader = connect_to_status();
    assert_true(loop_until(is_answered, 200)); /* whole, before anything of it is read */
    read_answer();
    close(reader);
    close(silent);
    assert_int_equal(calls, 1); /* made once for all that ask within a quarter of a second */
    status = json_tokener_parse(answer);
    assert_non_null(status);
    assert_true(json_object_get_boolean(json_object_object_get(status, "on_air")));
    json_object_put(status);
    unlink(path);
    rmdir(directory);
}

/* A daemon that was taken over owns the folder: what a name there leads to isn't asked. */
static void a_link_is_not_followed(void **state)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int other = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    static char said[STATUS_ANSWER_MAX];
    char path[64];

    (void)state;
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    assert_non_null(mkdtemp(directory));
    snprintf(address.sun_path, sizeof(address.sun_path), "%s/other", directory);
    snprintf(path, sizeof(path), "%s/%s", directory, STATUS_SOCKET);
    assert_int_equal(bind(other, (struct sockaddr *)&address, sizeof(address)), 0);
    assert_int_equal(listen(other, 1), 0);
    assert_int_equal(status_ask(directory, 100, said), -ENOENT);
    assert_int_equal(symlink(address.sun_path, path), 0);
    assert_int_equal(status_ask(directory, 100, said), -ECONNREFUSED);
    assert_int_equal(accept(other, NULL, NULL), -1);
    unlink(path);
    unlink(address.sun_path);
    rmdir(directory);
    close(other);
}

/* ---- a flood ---- */

#define FLOOD_MS 1500

static struct {
    pthread_t threads[4];
    unsigned joined;
    atomic_bool over;
    atomic_uint connections;
    ssize_t length; /* of what somebody got who asks beside it */
} flood;

static void *connect_for_ever(void *context)
{
    (void)context;
    while (!flood.over) {
        int fd = connect_to_status();
        char octet;

        if (fd >= 0 && read(fd, &octet, 1) == 1) { /* was taken, not only queued */
            flood.connections++;
        }
        close(fd);
    }
    return NULL;
}

static void *ask_beside_it(void *context)
{
    static char said[STATUS_ANSWER_MAX];

    (void)context;
    flood.length = status_ask(directory, FLOOD_MS, said);
    return NULL;
}

/* Whoever waits for an answer waits for the loop. */
static bool all_have_ended(void)
{
    while (flood.joined < 4 && pthread_tryjoin_np(flood.threads[flood.joined], NULL) == 0) {
        flood.joined++;
    }
    return flood.joined == 4;
}

static int64_t own_time_us(void)
{
    struct timespec used;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    return used.tv_sec * INT64_C(1000000) + used.tv_nsec / 1000;
}

/* A thousand times what anybody needs: nearly all of the time is still the broadcast's. */
static void a_flood_of_connections(void **state)
{
    unsigned calls = 0;
    int64_t begun_us, used_us, took_ms;
    char path[64];

    (void)state;
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    assert_non_null(mkdtemp(directory));
    assert_int_equal(loop_init(), 0);
    assert_int_equal(status_start(directory, gather, &calls), 0);
    begun_us = loop_now_us();
    for (int i = 0; i < 3; i++) {
        assert_int_equal(pthread_create(&flood.threads[i], NULL, connect_for_ever, NULL), 0);
    }
    assert_int_equal(pthread_create(&flood.threads[3], NULL, ask_beside_it, NULL), 0);
    used_us = own_time_us();
    run_ms(FLOOD_MS);
    used_us = own_time_us() - used_us;
    flood.over = true;
    assert_true(loop_until(all_have_ended, 300));
    took_ms = (loop_now_us() - begun_us) / 1000;
    print_message("%u answers made, %u connections taken, %lld us of processor time in %d ms\n",
                  calls, flood.connections, (long long)used_us, FLOOD_MS);
    assert_in_range(calls, 1, took_ms / 250 + 2);
    assert_in_range(flood.connections, 1, took_ms / 125 * 8 + 8);
    assert_true(flood.length > 0);
    snprintf(path, sizeof(path), "%s/%s", directory, STATUS_SOCKET);
    unlink(path);
    rmdir(directory);
}

/* Nor while the whole system has no descriptor left. */
static bool is_there(void)
{
    char path[64];
    struct stat file;

    snprintf(path, sizeof(path), "%s/later/%s", directory, STATUS_SOCKET);
    return stat(path, &file) == 0;
}

static void a_place_that_is_there_later(void **state)
{
    static char later[64];
    unsigned calls = 0;
    char path[80];

    (void)state;
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    assert_non_null(mkdtemp(directory));
    snprintf(later, sizeof(later), "%s/later", directory);
    assert_int_equal(loop_init(), 0);
    assert_int_equal(status_start(later, gather, &calls), -ENOENT);
    assert_int_equal(mkdir(later, 0700), 0);
    for (int i = 0; i < 600 && !is_there(); i++) {
        run_ms(100);
    }
    assert_true(is_there());
    snprintf(path, sizeof(path), "%s/%s", later, STATUS_SOCKET);
    unlink(path);
    rmdir(later);
    rmdir(directory);
}

static void places_where_it_cannot_be(void **state)
{
    char long_name[200];
    unsigned calls = 0;

    (void)state;
    memset(long_name, 'x', sizeof(long_name) - 1);
    long_name[0] = '/';
    long_name[sizeof(long_name) - 1] = '\0';
    assert_int_equal(status_start(long_name, gather, &calls), -ENAMETOOLONG);
    assert_int_equal(status_start("/nonexistent", gather, &calls), -ENOENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(stable_names),
        TEST(values),
        TEST(what_is_unknown_is_null),
        TEST(what_flies_without_heartbeats_is_armed),
        TEST(foreign_bytes),
        TEST(problems_and_sentences),
        TEST(a_place_that_is_there_later),
        TEST(over_the_socket),
        TEST(a_link_is_not_followed),
        TEST(a_flood_of_connections),
        TEST(places_where_it_cannot_be),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
