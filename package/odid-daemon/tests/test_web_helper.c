/* The half of odid-web that has rights: what it does for the other one, and what it doesn't. */
#include "odidctl_bench.h"

#include "maintenance_key.h"
#include "web_helper.h"

#define ARMED "{\"aircraft\": {\"armed\": true}}"
#define DISARMED "{\"aircraft\": {\"armed\": false}}"
#define NUMBER "FIN87astrdge12k8"

static const struct odidctl_places places = {
    .run_dir = "run", .data = "data", .faults = "faults", .state = "state", .apply = "./apply"};

static pid_t helper_process;
static char said_here[WEB_SAID_SIZE];

static int begin_helper(void)
{
    int ends[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
    helper_process = fork();
    assert_true(helper_process >= 0);
    if (helper_process == 0) {
        close(ends[0]);
        web_helper_serve(ends[1], &places);
        _exit(0);
    }
    close(ends[1]);
    return ends[0];
}

/* It ends by itself when the other half is gone. */
static void end_helper(int helper)
{
    int status;

    close(helper);
    assert_int_equal(waitpid(helper_process, &status, 0), helper_process);
    assert_int_equal(status, 0);
}

static void passwords(void **state)
{
    char key[MAINTENANCE_KEY_SIZE];
    int helper = begin_helper();

    (void)state;
    assert_int_equal(web_helper_password(helper, "saltwater"), WEB_PASSWORD_NONE);
    put("data/secrets/maintenance.psk", ""); /* as a full disk may leave it */
    assert_int_equal(web_helper_password(helper, ""), WEB_PASSWORD_NONE);
    put("data/secrets/wifi_ssid", "RemoteID-0A1B\n");
    maintenance_key("saltwater", "RemoteID-0A1B", key);
    put("data/secrets/maintenance.psk", key);
    assert_int_equal(web_helper_password(helper, "saltwater"), WEB_PASSWORD_RIGHT);
    assert_int_equal(web_helper_password(helper, "saltwate"), WEB_PASSWORD_WRONG);
    assert_int_equal(web_helper_password(helper, "saltwaterx"), WEB_PASSWORD_WRONG);
    assert_int_equal(web_helper_password(helper, ""), WEB_PASSWORD_WRONG);
    assert_int_equal(web_helper_password(helper, key),
                     WEB_PASSWORD_WRONG);             /* what is kept is none */
    put("data/secrets/wifi_ssid", "RemoteID-FFFF\n"); /* another network's name, another key */
    assert_int_equal(web_helper_password(helper, "saltwater"), WEB_PASSWORD_WRONG);
    end_helper(helper);
}

static void settings(void **state)
{
    pid_t daemon = answer_with(DISARMED);
    int helper = begin_helper();

    (void)state;
    put("apply", "#!/bin/sh\ntouch applied\n");
    chmod("apply", 0755);
    assert_true(web_helper_set(helper, WEB_OPERATOR, NUMBER "-xyz", said_here));
    assert_non_null(strstr(said_here, "check character right; the secret part is not kept"));
    assert_non_null(strstr(said_here, "Saved, and in effect."));
    assert_null(strstr(said_here, "xyz"));
    expect_file("data/odid/odid.conf", "[operator]\noperator_id = " NUMBER "\n");
    assert_int_equal(access("applied", F_OK), 0);
    assert_true(web_helper_set(helper, WEB_SERIAL, "SSRS5GBG01", said_here));
    assert_non_null(strstr(got("data/odid/odid.conf"), "[basic_id]\nuas_id = SSRS5GBG01\n"));
    unlink("applied");
    end_helper(helper);
    end(daemon);
}

static void wrong_values_change_nothing(void **state)
{
    pid_t daemon = answer_with(DISARMED);
    int helper = begin_helper();

    (void)state;
    put("data/odid/odid.conf", "[basic_id]\nuas_id = SSRS5GBG01\n");
    assert_false(web_helper_set(helper, WEB_SERIAL, "SSRS5GBG01SSRS5GBG01X", said_here));
    assert_non_null(strstr(said_here, "fit on the air"));
    assert_non_null(strstr(said_here, "Nothing was changed."));
    assert_false(
        web_helper_set(helper, WEB_SERIAL, NUMBER "-xyz", said_here)); /* in the wrong field */
    assert_non_null(strstr(said_here, "secret part of an operator number"));
    assert_null(strstr(said_here, "xyz"));
    expect_file("data/odid/odid.conf", "[basic_id]\nuas_id = SSRS5GBG01\n");
    end_helper(helper);
    end(daemon);
}

static void nothing_is_set_while_armed(void **state)
{
    pid_t daemon = answer_with(ARMED);
    int helper = begin_helper();

    (void)state;
    assert_false(web_helper_set(helper, WEB_OPERATOR, NUMBER, said_here));
    assert_string_equal(said_here, "The aircraft is armed: nothing was changed.");
    expect_none("data/odid/odid.conf");
    end(daemon);
    put("state/armed", ""); /* lost after arming: armed */
    assert_false(web_helper_set(helper, WEB_OPERATOR, NUMBER, said_here));
    expect_none("data/odid/odid.conf");
    end_helper(helper);
}

/* The other half may have been taken over. */
static void nonsense_is_no_order(void **state)
{
    static const char nonsense[4096] = {1, 0, 0, 0, 77};
    int helper = begin_helper();

    (void)state;
    for (size_t length = 1; length < sizeof(nonsense); length *= 3) {
        assert_int_equal(send(helper, nonsense, length, 0), (ssize_t)length);
    }
    assert_int_equal(web_helper_password(helper, "saltwater"), WEB_PASSWORD_NONE);
    expect_none("data/odid/odid.conf");
    end_helper(helper);
}

static void the_others_end_is_seen(void **state)
{
    int ends[2];

    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
    close(ends[1]);
    assert_int_equal(web_helper_password(ends[0], "saltwater"), WEB_NO_HELPER);
    assert_false(web_helper_set(ends[0], WEB_SERIAL, "X", said_here));
    assert_non_null(strstr(said_here, "nothing was changed"));
    close(ends[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(passwords, bench_clear),
        cmocka_unit_test_setup(settings, bench_clear),
        cmocka_unit_test_setup(wrong_values_change_nothing, bench_clear),
        cmocka_unit_test_setup(nothing_is_set_while_armed, bench_clear),
        cmocka_unit_test_setup(nonsense_is_no_order, bench_clear),
        cmocka_unit_test_setup(the_others_end_is_seen, bench_clear),
    };

    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
