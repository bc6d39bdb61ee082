/* The take-off point over a restart. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "takeoff_file.h"

static char directory[] = "/tmp/odid-takeoff-XXXXXX";

static int make_directory(void **state)
{
    (void)state;
    return mkdtemp(directory) == NULL ? -1 : 0;
}

static int remove_directory(void **state)
{
    const struct aircraft_takeoff none = {.known = false};

    (void)state;
    takeoff_file_write(directory, &none);
    return rmdir(directory);
}

static void write_text(const char *text)
{
    char path[64];
    FILE *file;

    snprintf(path, sizeof(path), "%s/takeoff", directory);
    file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void what_was_written_is_read(void **state)
{
    const struct aircraft_takeoff in = {.known = true,
                                        .latitude_deg = 57.7089123,
                                        .longitude_deg = -11.9746001,
                                        .altitude_msl_m = 12.5,
                                        .altitude_geodetic_m = NAN};
    struct aircraft_takeoff out;

    (void)state;
    assert_int_equal(takeoff_file_write(directory, &in), 0);
    takeoff_file_read(directory, &out);
    assert_true(out.known);
    assert_true(fabs(out.latitude_deg - in.latitude_deg) < 1e-8);
    assert_true(fabs(out.longitude_deg - in.longitude_deg) < 1e-8);
    assert_true(fabs(out.altitude_msl_m - in.altitude_msl_m) < 1e-3);
    assert_true(isnan(out.altitude_geodetic_m));
}

static void an_unknown_point_removes_the_file(void **state)
{
    const struct aircraft_takeoff none = {.known = false};
    struct aircraft_takeoff out;

    (void)state;
    write_text("1 2 3 4\n");
    assert_int_equal(takeoff_file_write(directory, &none), 0);
    takeoff_file_read(directory, &out);
    assert_false(out.known);
    assert_int_equal(takeoff_file_write(directory, &none), 0); /* nothing to remove is no error */
}

static void nonsense_is_unknown(void **state)
{
    static const char *const texts[] = {"",          "57.7",      "a b c d", "91 0 0 0",
                                        "0 181 0 0", "nan 0 0 0", "1 2 3"};
    struct aircraft_takeoff out;

    (void)state;
    for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
        write_text(texts[i]);
        takeoff_file_read(directory, &out);
        assert_false(out.known);
    }
}

static void a_directory_that_is_gone_is_an_error(void **state)
{
    const struct aircraft_takeoff in = {.known = true};
    struct aircraft_takeoff out;

    (void)state;
    assert_int_equal(takeoff_file_write("/nonexistent", &in), -ENOENT);
    takeoff_file_read("/nonexistent", &out);
    assert_false(out.known);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_written_is_read),
        cmocka_unit_test(an_unknown_point_removes_the_file),
        cmocka_unit_test(nonsense_is_unknown),
        cmocka_unit_test(a_directory_that_is_gone_is_an_error),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
