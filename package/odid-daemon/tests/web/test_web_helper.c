/* The half of odid-web that has rights: what it does for the other one, and what it doesn't. */
#include "odidctl_bench.h"

#include <sys/prctl.h>

#include "appliance/maintenance_key.h"
#include "appliance/password.h"
#include "web/web_helper.h"

#define ANSWER "{\"on_air\": true}"
#define NUMBER "FIN87astrdge12k8"

static struct places places;
static pid_t helper_process;
static char said_here[WEB_SAID_SIZE];

static int begin_helper(void)
{
    int ends[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
    helper_process = fork();
    assert_true(helper_process >= 0);
    if (helper_process == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* a test that fails doesn't get as far as end_helper */
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

#define PASSWORD "saltwater"

static void keep_password(void)
{
    char key[MAINTENANCE_KEY_SIZE];

    put("data/secrets/wifi_ssid", "RemoteID-0A1B\n");
    maintenance_key(PASSWORD, "RemoteID-0A1B", key);
    put("data/secrets/maintenance.psk", key);
}

static enum web_password verdict_on(int helper, const char *password)
{
    struct web_login login;

    web_helper_login(helper, WEB_BY_CABLE, password, &login);
    assert_int_equal(login.verdict == WEB_PASSWORD_RIGHT, login.token[0] != '\0');
    assert_int_equal(login.verdict == WEB_PASSWORD_WAIT, login.wait_s > 0);
    return login.verdict;
}

/* A helper with somebody who has logged in. */
static int begin_session(char token[WEB_TOKEN_SIZE])
{
    int helper = begin_helper();
    struct web_login login;

    keep_password();
    web_helper_login(helper, WEB_BY_CABLE, PASSWORD, &login);
    assert_int_equal(login.verdict, WEB_PASSWORD_RIGHT);
    assert_int_equal(strlen(login.token), WEB_TOKEN_SIZE - 1);
    memcpy(token, login.token, WEB_TOKEN_SIZE);
    return helper;
}

static void another_password_ends_who_gave_the_first(void **state)
{
    char token[WEB_TOKEN_SIZE];
    int helper = begin_session(token);
    char key[MAINTENANCE_KEY_SIZE];

    (void)state;
    assert_true(web_helper_known(helper, token));
    maintenance_key("freshwater", "RemoteID-0A1B", key);
    put("data/secrets/maintenance.psk", key);
    assert_false(web_helper_known(helper, token));
    assert_int_equal(verdict_on(helper, "freshwater"), WEB_PASSWORD_RIGHT);
    end_helper(helper);
}

/* Whoever guesses at the cable takes no try away from the access point, and there are only five. */
static void who_tries_by_cable_does_not_lock_the_access_point(void **state)
{
    int helper = begin_helper();
    struct web_login login;

    (void)state;
    keep_password();
    while (verdict_on(helper, "guess") != WEB_PASSWORD_WAIT) {
    }
    web_helper_login(helper, WEB_BY_ACCESS_POINT, PASSWORD, &login);
    assert_int_equal(login.verdict, WEB_PASSWORD_RIGHT);
    end_helper(helper);
}

static void without_a_password_nobody_gets_in(void **state)
{
    int helper = begin_helper();

    (void)state;
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_NONE);
    put("data/secrets/maintenance.psk", ""); /* as a full disk may leave it */
    assert_int_equal(verdict_on(helper, ""), WEB_PASSWORD_NONE);
    end_helper(helper);
}

static void passwords(void **state)
{
    char key[MAINTENANCE_KEY_SIZE];
    int helper = begin_helper();

    (void)state;
    keep_password();
    maintenance_key(PASSWORD, "RemoteID-0A1B", key);
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_RIGHT);
    assert_int_equal(verdict_on(helper, "saltwate"), WEB_PASSWORD_WRONG);
    assert_int_equal(verdict_on(helper, "saltwaterx"), WEB_PASSWORD_WRONG);
    assert_int_equal(verdict_on(helper, ""), WEB_PASSWORD_WRONG);
    assert_int_equal(verdict_on(helper, key), WEB_PASSWORD_WRONG); /* what is kept is none */
    put("data/secrets/wifi_ssid", "RemoteID-FFFF\n"); /* another network's name, another key */
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_WRONG);
    end_helper(helper);
}

/* A power cut at the first start took the access point's name, and the board made another one. */
static void a_password_outlives_the_access_point_s_name(void **state)
{
    int helper = begin_helper();

    (void)state;
    put("data/secrets/wifi_ssid", "RemoteID-0A1B\n");
    assert_int_equal(password_keep("data", PASSWORD), 0);
    put("data/secrets/wifi_ssid", "RemoteID-FFFF\n");
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_RIGHT);
    assert_int_equal(verdict_on(helper, "saltwate"), WEB_PASSWORD_WRONG);
    end_helper(helper);
}

/* ---- by a half that was taken over: each of these orders it can give ---- */

static void passwords_can_not_be_tried_one_after_the_other(void **state)
{
    int helper = begin_helper();

    (void)state;
    keep_password();
    for (int i = 0; i < WEB_TRIES; i++) {
        assert_int_equal(verdict_on(helper, "a wrong one"), WEB_PASSWORD_WRONG);
    }
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_WAIT);
    end_helper(helper);
}

static void nothing_without_a_session(void **state)
{
    static const char *const tokens[] = {"", "0", "00000000000000000000000000000000"};
    pid_t daemon = answer_with(ANSWER);
    int helper = begin_helper();

    (void)state;
    keep_armed("no");
    keep_password();
    for (size_t i = 0; i < 3; i++) {
        char token[WEB_TOKEN_SIZE] = "";

        strcpy(token, tokens[i]);
        assert_false(web_helper_known(helper, token));
        assert_false(web_helper_set(helper, token, WEB_SERIAL, "SSRS5GBG01", said_here));
        assert_string_equal(said_here, "Give the maintenance password first.");
        assert_int_equal(web_helper_update(helper, token, said_here, sizeof(said_here)), -1);
        assert_string_equal(said_here, "Give the maintenance password first.");
    }
    expect_none("data/odid/odid.conf");
    end_helper(helper);
    end(daemon);
}

static void a_session_ends(void **state)
{
    char token[WEB_TOKEN_SIZE];
    int helper = begin_session(token);

    (void)state;
    assert_true(web_helper_known(helper, token));
    web_helper_leave(helper, token);
    assert_false(web_helper_known(helper, token));
    assert_false(web_helper_set(helper, token, WEB_SERIAL, "SSRS5GBG01", said_here));
    expect_none("data/odid/odid.conf");
    end_helper(helper);
}

/* What stands in an update's way is looked at here; the connection itself: tests/web. */
static void no_update_while_armed(void **state)
{
    char token[WEB_TOKEN_SIZE];
    pid_t daemon = answer_with(ANSWER);
    int helper = begin_session(token);

    (void)state;
    keep_armed("yes");
    assert_int_equal(web_helper_update(helper, token, said_here, sizeof(said_here)), -1);
    assert_non_null(strstr(said_here, "The aircraft is armed"));
    end(daemon);
    daemon = answer_with(ANSWER);
    keep_armed("no");
    assert_int_equal(web_helper_update(helper, token, said_here, sizeof(said_here)), -1);
    assert_non_null(strstr(said_here, "The updater isn't running"));
    end(daemon); /* which has the socket, too */
    end_helper(helper);
}

/* ---- what it does for a session ---- */

static void settings(void **state)
{
    char token[WEB_TOKEN_SIZE];
    pid_t daemon = answer_with(ANSWER);
    int helper = begin_session(token);

    (void)state;
    keep_armed("no");
    put("lib/odid/apply-configuration", "#!/bin/sh\ntouch applied\n");
    chmod("lib/odid/apply-configuration", 0755);
    assert_true(web_helper_set(helper, token, WEB_OPERATOR, NUMBER "-xyz", said_here));
    assert_non_null(strstr(said_here, "check character right; the secret part is not kept"));
    assert_non_null(strstr(said_here, "Saved, and in effect."));
    assert_null(strstr(said_here, "xyz"));
    expect_file("data/odid/odid.conf", "[operator]\noperator_id = " NUMBER "\n");
    assert_int_equal(access("applied", F_OK), 0);
    assert_true(web_helper_set(helper, token, WEB_SERIAL, "SSRS5GBG01", said_here));
    assert_non_null(strstr(got("data/odid/odid.conf"), "[basic_id]\nuas_id = SSRS5GBG01\n"));
    unlink("applied");
    end_helper(helper);
    end(daemon);
}

static void wrong_values_change_nothing(void **state)
{
    char token[WEB_TOKEN_SIZE];
    pid_t daemon = answer_with(ANSWER);
    int helper = begin_session(token);

    (void)state;
    keep_armed("no");
    put("data/odid/odid.conf", "[basic_id]\nuas_id = SSRS5GBG01\n");
    assert_false(web_helper_set(helper, token, WEB_SERIAL, "SSRS5GBG01SSRS5GBG01X", said_here));
    assert_non_null(strstr(said_here, "fit on the air"));
    assert_non_null(strstr(said_here, "Nothing was changed."));
    assert_false(web_helper_set(helper, token, WEB_SERIAL, NUMBER "-xyz",
                                said_here)); /* in the wrong field */
    assert_non_null(strstr(said_here, "secret part of an operator number"));
    assert_null(strstr(said_here, "xyz"));
    expect_file("data/odid/odid.conf", "[basic_id]\nuas_id = SSRS5GBG01\n");
    end_helper(helper);
    end(daemon);
}

static void nothing_is_set_while_armed(void **state)
{
    char token[WEB_TOKEN_SIZE];
    pid_t daemon = answer_with(ANSWER);
    int helper = begin_session(token);

    (void)state;
    keep_armed("yes");
    assert_false(web_helper_set(helper, token, WEB_OPERATOR, NUMBER, said_here));
    assert_string_equal(said_here, "The aircraft is armed: nothing was changed.");
    expect_none("data/odid/odid.conf");
    end(daemon);
    keep_armed("no"); /* and nobody answers */
    assert_false(web_helper_set(helper, token, WEB_OPERATOR, NUMBER, said_here));
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
    assert_int_equal(verdict_on(helper, PASSWORD), WEB_PASSWORD_NONE);
    expect_none("data/odid/odid.conf");
    end_helper(helper);
}

static void the_others_end_is_seen(void **state)
{
    char token[WEB_TOKEN_SIZE] = "";
    int ends[2];

    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
    close(ends[1]);
    assert_int_equal(verdict_on(ends[0], PASSWORD), WEB_NO_HELPER);
    assert_false(web_helper_known(ends[0], token));
    assert_int_equal(web_helper_update(ends[0], token, said_here, sizeof(said_here)), -1);
    assert_false(web_helper_set(ends[0], token, WEB_SERIAL, "X", said_here));
    assert_non_null(strstr(said_here, "nothing was changed"));
    close(ends[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(without_a_password_nobody_gets_in, bench_clear),
        cmocka_unit_test_setup(another_password_ends_who_gave_the_first, bench_clear),
        cmocka_unit_test_setup(who_tries_by_cable_does_not_lock_the_access_point, bench_clear),
        cmocka_unit_test_setup(passwords, bench_clear),
        cmocka_unit_test_setup(a_password_outlives_the_access_point_s_name, bench_clear),
        cmocka_unit_test_setup(passwords_can_not_be_tried_one_after_the_other, bench_clear),
        cmocka_unit_test_setup(nothing_without_a_session, bench_clear),
        cmocka_unit_test_setup(a_session_ends, bench_clear),
        cmocka_unit_test_setup(no_update_while_armed, bench_clear),
        cmocka_unit_test_setup(settings, bench_clear),
        cmocka_unit_test_setup(wrong_values_change_nothing, bench_clear),
        cmocka_unit_test_setup(nothing_is_set_while_armed, bench_clear),
        cmocka_unit_test_setup(nonsense_is_no_order, bench_clear),
        cmocka_unit_test_setup(the_others_end_is_seen, bench_clear),
    };

    places_under(&places, ".");
    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
