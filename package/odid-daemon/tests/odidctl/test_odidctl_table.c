/* The table that odidctl makes of the status. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <json-c/json_tokener.h>
#include <stdio.h>
#include <string.h>

#include "base/duration.h"
#include "odidctl/odidctl_table.h"
#include "status_fixture.h"

static void draw(struct json_object *status, bool colour, char *out, size_t size)
{
    FILE *file = fmemopen(out, size, "w");

    assert_non_null(file);
    odidctl_table(file, status, colour);
    fclose(file);
    assert_null(strstr(out, "nan"));
    assert_null(strstr(out, "inf"));
    assert_null(strstr(out, "null"));
}

static void draw_fixture(bool colour, char *out, size_t size)
{
    struct json_object *made = make_json();
    /* As odidctl does: what was written, read again. */
    struct json_object *status = json_tokener_parse(json_object_to_json_string(made));

    draw(status, colour, out, size);
    json_object_put(status);
    json_object_put(made);
}

static void table_of_a_good_one(void **state)
{
    char text[8192];

    (void)state;
    draw_fixture(false, text, sizeof(text));
    assert_non_null(strstr(text, "REMOTE ID IS ON THE AIR "));
    assert_non_null(strstr(text, "Nothing stands against flying."));
    assert_non_null(strstr(text, "running for 90 s"));
    assert_non_null(strstr(text, "57.708900, 11.974600 (telemetry, 0.2 s old)"));
    assert_non_null(strstr(text, "course unknown"));
    assert_non_null(strstr(text, "SSRS5GBG01 (serial, aeroplane, from configuration): valid"));
    assert_non_null(strstr(text, "What is wrong, and what to do\n  nothing\n"));
    assert_null(strchr(text, '\033'));
    draw_fixture(true, text, sizeof(text));
    assert_non_null(strchr(text, '\033'));
}

static void table_of_a_bad_one(void **state)
{
    char text[8192];

    (void)state;
    fixture.radios[CHANNEL_WIFI].state = RADIO_ABSENT;
    fixture.radios[CHANNEL_WIFI].accepted_us = INT64_MIN;
    strcpy(fixture.radios[CHANNEL_WIFI].detail, "no control socket");
    fixture.radios[CHANNEL_BT5].replaced = 7;
    asking.message[4].refusals = asking.message[5].refusals = 2;
    draw_fixture(false, text, sizeof(text));
    assert_non_null(strstr(text, "REMOTE ID IS ONLY PARTLY ON THE AIR"));
    assert_non_null(strstr(text, "Do not fly: EU: Bluetooth 4 is not enough"));
    assert_non_null(strstr(text, "FAULT    Wi-Fi beacon off: absent"));
    assert_non_null(strstr(text, "no control socket"));
    assert_non_null(strstr(text, ", 7 never taken"));
    assert_non_null(strstr(text, "to send 245 242 (numbers of MAVLink messages)"));
    fixture.radios[CHANNEL_BT4].state = RADIO_BLOCKED;
    draw_fixture(false, text, sizeof(text));
    assert_non_null(strstr(text, "REMOTE ID IS NOT ON THE AIR"));
}

/* An older or newer daemon's answer, or nonsense: shown as unknown. */
static void table_of_something_else(void **state)
{
    static const char *const texts[] = {
        "{}",
        "{\"channels\":7,\"link\":[],\"identity\":\"x\",\"problems\":{},\"position\":null}",
        "{\"channels\":{\"bt4\":3,\"wifi\":{\"state\":1}},\"problems\":[1,null,{}],"
        "\"configuration\":{\"sentences\":[1,null]},\"identity\":{\"basic_ids\":[null,5]}}",
    };
    char text[8192];

    (void)state;
    for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
        struct json_object *status = json_tokener_parse(texts[i]);

        assert_non_null(status);
        draw(status, false, text, sizeof(text));
        assert_non_null(strstr(text, "NOT ON THE AIR"));
        assert_non_null(strstr(text, "unknown"));
        json_object_put(status);
    }
}

static void durations(void **state)
{
    static const struct {
        double seconds;
        const char *text;
    } cases[] = {{0, "0.0 s"},       {9.94, "9.9 s"},   {10, "10 s"},  {119.4, "119 s"},
                 {120, "2 min"},     {7199, "119 min"}, {7200, "2 h"}, {172799, "47 h"},
                 {172800, "2 days"}, {NAN, "unknown"}};
    char text[32];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        duration_text(text, sizeof(text), cases[i].seconds);
        assert_string_equal(text, cases[i].text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(table_of_a_good_one),
        TEST(table_of_a_bad_one),
        TEST(table_of_something_else),
        TEST(durations),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
