/* Sessions of the technician's page, and how often a password may be tried. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "web/web_session.h"

#define S INT64_C(1000000)

static void begin(struct web_sessions *sessions, uint8_t fill, int64_t now_us,
                  char token[WEB_TOKEN_SIZE])
{
    uint8_t random[WEB_TOKEN_BYTES];

    memset(random, fill, sizeof(random));
    web_sessions_begin(sessions, WEB_BY_CABLE, random, now_us, token);
}

static void a_session_is_known_until_it_ends(void **state)
{
    struct web_sessions sessions = {0};
    char token[WEB_TOKEN_SIZE], other[WEB_TOKEN_SIZE] = "";

    (void)state;
    assert_false(web_sessions_known(&sessions, other, 0)); /* a free place is no session */
    begin(&sessions, 0xA5, 1000 * S, token);
    assert_string_equal(token, "a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5");
    assert_true(web_sessions_known(&sessions, token, 1001 * S));
    memcpy(other, token, sizeof(other));
    other[WEB_TOKEN_SIZE - 2] = '6';
    assert_false(web_sessions_known(&sessions, other, 1001 * S));
    web_sessions_end(&sessions, other);
    assert_true(web_sessions_known(&sessions, token, 1001 * S));
    web_sessions_end(&sessions, token);
    assert_false(web_sessions_known(&sessions, token, 1001 * S));
}

static void a_session_ends_when_it_is_not_used(void **state)
{
    struct web_sessions sessions = {0};
    char token[WEB_TOKEN_SIZE];

    (void)state;
    begin(&sessions, 1, 0, token);
    assert_true(web_sessions_known(&sessions, token, WEB_SESSION_IDLE_US));
    assert_true(web_sessions_known(&sessions, token, 2 * WEB_SESSION_IDLE_US));
    assert_false(web_sessions_known(&sessions, token, 3 * WEB_SESSION_IDLE_US + 1));
    assert_false(web_sessions_known(&sessions, token, 2 * WEB_SESSION_IDLE_US)); /* for good */
}

static void the_least_used_session_gives_way(void **state)
{
    struct web_sessions sessions = {0};
    char tokens[WEB_SESSIONS_MAX + 1][WEB_TOKEN_SIZE];

    (void)state;
    for (uint8_t i = 0; i < WEB_SESSIONS_MAX; i++) {
        begin(&sessions, i, i * S, tokens[i]);
    }
    assert_true(web_sessions_known(&sessions, tokens[0], 10 * S)); /* so it isn't the least used */
    begin(&sessions, 99, 11 * S, tokens[WEB_SESSIONS_MAX]);
    assert_false(web_sessions_known(&sessions, tokens[1], 12 * S));
    for (uint8_t i = 0; i <= WEB_SESSIONS_MAX; i++) {
        assert_int_equal(web_sessions_known(&sessions, tokens[i], 12 * S), i != 1);
    }
}

static unsigned tries_at(struct web_sessions *sessions, int64_t now_us)
{
    unsigned tries = 0, wait_s;

    while (tries < 1000 && web_sessions_try(sessions, WEB_BY_CABLE, now_us, &wait_s)) {
        tries++;
    }
    return tries;
}

static void passwords_are_tried_only_so_often(void **state)
{
    struct web_sessions sessions = {0};
    unsigned wait_s = 99;

    (void)state;
    assert_int_equal(tries_at(&sessions, 100 * S), WEB_TRIES);
    assert_false(web_sessions_try(&sessions, WEB_BY_CABLE, 100 * S, &wait_s));
    assert_in_range(wait_s, 10, 11);
    assert_int_equal(tries_at(&sessions, 109 * S), 0);
    assert_true(
        web_sessions_try(&sessions, WEB_BY_CABLE, 100 * S + wait_s * S, &wait_s)); /* as was said */
    assert_int_equal(tries_at(&sessions, 120 * S), 1);
    assert_int_equal(tries_at(&sessions, 150 * S), 3);
    assert_int_equal(tries_at(&sessions, 100000 * S), WEB_TRIES); /* never more at once */
}

static void a_right_password_costs_no_try(void **state)
{
    struct web_sessions sessions = {0};
    char token[WEB_TOKEN_SIZE];
    unsigned wait_s;

    (void)state;
    for (unsigned i = 0; i < 100; i++) {
        assert_true(web_sessions_try(&sessions, WEB_BY_CABLE, 100 * S, &wait_s));
        begin(&sessions, 1, 100 * S, token);
    }
    assert_int_equal(tries_at(&sessions, 100 * S), WEB_TRIES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_session_is_known_until_it_ends),
        cmocka_unit_test(a_session_ends_when_it_is_not_used),
        cmocka_unit_test(the_least_used_session_gives_way),
        cmocka_unit_test(passwords_are_tried_only_so_often),
        cmocka_unit_test(a_right_password_costs_no_try),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
