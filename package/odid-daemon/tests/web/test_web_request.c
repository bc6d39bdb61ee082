/* What a browser asks for, who asks, and what it brings along. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "web/web_request.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* ---- what is asked for ---- */

static void paths(void **state)
{
    static const struct {
        const char *method, *path;
        enum web_route route;
    } cases[] = {
        {"GET", "/", WEB_FILE},
        {"GET", "/page.js", WEB_FILE},
        {"GET", "/style.css", WEB_FILE},
        {"GET", "/icon.svg", WEB_FILE},
        {"POST", "/", WEB_WRONG_METHOD},
        {"HEAD", "/page.js", WEB_WRONG_METHOD},
        {"GET", "", WEB_NOWHERE},
        {"GET", "//", WEB_NOWHERE},
        {"GET", "/index.html", WEB_NOWHERE}, /* it has one address */
        {"GET", "/../etc/passwd", WEB_NOWHERE},
        {"GET", "/page.js/../../odid.conf", WEB_NOWHERE},
        {"POST", "/api/session", WEB_LOGIN},
        {"DELETE", "/api/session", WEB_LOGOUT},
        {"GET", "/api/session", WEB_WRONG_METHOD},
        {"GET", "/api/status", WEB_STATUS},
        {"POST", "/api/status", WEB_WRONG_METHOD},
        {"POST", "/api/settings", WEB_SET},
        {"GET", "/api/settings", WEB_WRONG_METHOD},
        {"POST", "/api/update", WEB_UPLOAD},
        {"DELETE", "/api/update", WEB_CANCEL},
        {"PUT", "/api/update", WEB_WRONG_METHOD},
        {"GET", "/api/flights", WEB_FLIGHTS},
        {"GET", "/api/flights/", WEB_NOWHERE},
        {"GET", "/api/flights/00042.jsonl", WEB_FLIGHT},
        {"DELETE", "/api/flights/00042.jsonl", WEB_WRONG_METHOD},
        {"GET", "/api/flights/42.jsonl", WEB_NOWHERE}, /* no record has that name */
        {"GET", "/api/flights/00000.jsonl", WEB_NOWHERE},
        {"GET", "/api/flights/00042.jsonl/", WEB_NOWHERE},
        {"GET", "/api/flights/../odid.conf", WEB_NOWHERE},
        {"GET", "/api/flights/00042.jsonl\n", WEB_NOWHERE},
        {"GET", "/api/", WEB_NOWHERE},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        struct web_target target = web_target(cases[i].method, cases[i].path);

        if (target.route != cases[i].route) {
            fail_msg("%s %s: %d", cases[i].method, cases[i].path, target.route);
        }
        assert_int_equal(target.route == WEB_FILE, target.route == WEB_FILE && target.file != NULL);
    }
    assert_int_equal(web_target("GET", "/api/flights/00042.jsonl").number, 42);
    assert_string_equal(web_target("GET", "/").file->name, "index.html");
}

/* ---- who asks ---- */

static void only_near_names_are_answered(void **state)
{
    static const char *const near[] = {"192.168.41.1", "192.168.41.1:80", "127.0.0.1:8080",
                                       "localhost",    "localhost:8080",  "odid",
                                       "[fe80::1]",    "[::1]:8080",      "Odid-2"};
    static const char *const far[] = {
        "",
        ":80",
        "evil.example",
        "evil.example:80",
        "192.168.41.1.evil.example",
        "192.168.41",
        "192.168.41.1:80x",
        "192.168.41.1/",
        "user@odid",
        "[evil.example]",
        "[odid]",
        "[::1",
        "[::1]x",
        "[]",
        "odid.",
        "od id",
        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"};
    struct web_head head = {0};

    (void)state;
    assert_non_null(web_refusal(&head, WEB_FILE));
    for (size_t i = 0; i < COUNT(near); i++) {
        head.host = near[i];
        if (web_refusal(&head, WEB_STATUS) != NULL) {
            fail_msg("%s is refused", near[i]);
        }
    }
    for (size_t i = 0; i < COUNT(far); i++) {
        head.host = far[i];
        if (web_refusal(&head, WEB_FILE) == NULL) {
            fail_msg("%s is answered", far[i]);
        }
    }
}

static void foreign_pages_change_nothing(void **state)
{
    static const enum web_route changing[] = {WEB_LOGIN, WEB_LOGOUT, WEB_SET, WEB_UPLOAD,
                                              WEB_CANCEL};
    static const char *const foreign[] = {
        "http://evil.example", "https://192.168.41.1",     "http://192.168.41.1:8080", "null", "",
        "192.168.41.1",        "http://192.168.41.1.evil", "http://192.168.41.1/",
    };
    struct web_head head = {.host = "192.168.41.1"};

    (void)state;
    for (size_t i = 0; i < COUNT(changing); i++) {
        head.page = head.origin = NULL;
        assert_non_null(web_refusal(&head, changing[i])); /* a form of any page could do that */
        head.page = "1";
        assert_null(web_refusal(&head, changing[i])); /* old browsers send no Origin */
        head.origin = "http://192.168.41.1";
        assert_null(web_refusal(&head, changing[i]));
        head.page = NULL;
        assert_non_null(web_refusal(&head, changing[i]));
        head.page = "1";
        for (size_t j = 0; j < COUNT(foreign); j++) {
            head.origin = foreign[j];
            if (web_refusal(&head, changing[i]) == NULL) {
                fail_msg("%s may do it", foreign[j]);
            }
        }
    }
    head.page = NULL;
    assert_null(web_refusal(&head, WEB_STATUS)); /* reading needs the password all the same */
}

static void cookies(void **state)
{
    static const char good[] = "0123456789abcdef0123456789abcdef";
    static const char *const with[] = {
        "odid=0123456789abcdef0123456789abcdef",
        "a=b; odid=0123456789abcdef0123456789abcdef; c=d",
        "odid=; odid=0123456789abcdef0123456789abcdef",
        ";; odid=0123456789abcdef0123456789abcdef;",
    };
    static const char *const without[] = {
        "",
        "odid",
        "odid=",
        "odid=0123456789abcdef0123456789abcde",
        "odid=0123456789abcdef0123456789abcdef0",
        "odid=0123456789ABCDEF0123456789ABCDEF",
        "odid=0123456789abcdef;0123456789abcdef",
        "xodid=0123456789abcdef0123456789abcdef",
        "a=odid=0123456789abcdef0123456789abcdef",
        "; ; ;",
    };
    char token[WEB_TOKEN_SIZE];

    (void)state;
    assert_false(web_cookie(NULL, token));
    for (size_t i = 0; i < COUNT(with); i++) {
        memset(token, 0, sizeof(token));
        assert_true(web_cookie(with[i], token));
        assert_string_equal(token, good);
    }
    for (size_t i = 0; i < COUNT(without); i++) {
        if (web_cookie(without[i], token)) {
            fail_msg("\"%s\" has a token", without[i]);
        }
    }
}

/* ---- bodies ---- */

static bool password_of(const char *body, char password[CONFIG_PASSWORD_MAX + 1])
{
    return web_read_password(body, strlen(body), password);
}

static void passwords(void **state)
{
    static const char *const wrong[] = {
        "",
        "{}",
        "null",
        "[]",
        "\"password\"",
        "{\"password\": null}",
        "{\"password\": 12345678}",
        "{\"password\": {\"password\": \"x\"}}",
        "{\"password\": \"saltwater\"",
        "{\"password\": \"saltwater\"} {}",
        "{\"password\": \"salt\\u0000water\"}",
        "{\"password\": \"salt\\nwater\"}",
        "{\"password\": \"0123456789012345678901234567890123456789012345678901234567890123\"}",
        "password=saltwater",
    };
    char password[CONFIG_PASSWORD_MAX + 1];

    (void)state;
    assert_true(password_of("{\"password\": \"salt \\\"water\\\" \\u00e5\"}", password));
    assert_string_equal(password, "salt \"water\" \xC3\xA5");
    assert_true(password_of(
        "{\"password\": \"012345678901234567890123456789012345678901234567890123456789012\"}",
        password));
    assert_int_equal(strlen(password), CONFIG_PASSWORD_MAX);
    for (size_t i = 0; i < COUNT(wrong); i++) {
        if (password_of(wrong[i], password)) {
            fail_msg("%s is taken", wrong[i]);
        }
    }
}

static bool settings_of(const char *body, struct web_settings *settings)
{
    return web_read_settings(body, strlen(body), settings);
}

static void settings(void **state)
{
    static const char *const wrong[] = {
        "",
        "{}",
        "[]",
        "{\"channel\": \"6\"}",
        "{\"operator\": 5}",
        "{\"operator\": \"a\", \"serial\": null}",
        "{\"serial\": \"a\\nb\"}",
        "{\"serial\": \"a\\u007fb\"}",
    };
    char body[WEB_BODY_MAX + 2];
    struct web_settings read;

    (void)state;
    assert_true(settings_of("{\"operator\": \"FIN87astrdge12k8-xyz\"}", &read));
    assert_true(read.operator_given && !read.serial_given);
    assert_string_equal(read.operator_number, "FIN87astrdge12k8-xyz");
    assert_true(settings_of("{\"serial\": \"\", \"operator\": \"x\", \"more\": 1}", &read));
    assert_true(read.operator_given && read.serial_given);
    assert_string_equal(read.serial, "");
    for (size_t i = 0; i < COUNT(wrong); i++) {
        if (settings_of(wrong[i], &read)) {
            fail_msg("%s is taken", wrong[i]);
        }
    }
    memset(body, ' ', sizeof(body));
    memcpy(body, "{\"serial\":\"x\"}", 14);
    assert_true(web_read_settings(body, WEB_BODY_MAX, &read));
    assert_false(web_read_settings(body, WEB_BODY_MAX + 1, &read));
    memset(body, '[', sizeof(body)); /* deep */
    assert_false(web_read_settings(body, WEB_BODY_MAX, &read));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),
        cmocka_unit_test(only_near_names_are_answered),
        cmocka_unit_test(foreign_pages_change_nothing),
        cmocka_unit_test(cookies),
        cmocka_unit_test(passwords),
        cmocka_unit_test(settings),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
