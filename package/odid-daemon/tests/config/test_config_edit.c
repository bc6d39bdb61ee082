/* Changes in a configuration's text: one value, a password taken, secrets left out. */
#include "config_helper.h"

#include <errno.h>

#include "config/config_edit.h"
#include "config/config_ini.h"

static void expect_set(const char *text, const char *section, const char *name, const char *value,
                       const char *expected)
{
    size_t length = 0;
    char *made =
        config_edit_set(text, strlen(text), config_key_find(section, name), value, &length);

    if (expected == NULL) {
        assert_null(made);
        assert_int_equal(errno, EINVAL);
        return;
    }
    assert_non_null(made);
    assert_string_equal(made, expected);
    assert_int_equal(length, strlen(expected));
    free(made);
}

static void a_line_that_is_there(void **state)
{
    (void)state;
    expect_set("[wifi]\nchannel = 6\n", "wifi", "channel", "11", "[wifi]\nchannel = 11\n");
    expect_set("[wifi]\r\nchannel=6;why\r\ncountry = NO\r\n", "wifi", "channel", "11",
               "[wifi]\r\nchannel= 11;why\r\ncountry = NO\r\n");
    expect_set("# a\n[ WIFI ] ; b\n  Channel : '6' # c\n; d", "wifi", "channel", "11",
               "# a\n[ WIFI ] ; b\n  Channel : \"11\" # c\n; d");
    expect_set("[wifi]\nchannel = 6   ; why\n", "wifi", "channel", "1",
               "[wifi]\nchannel = 1   ; why\n");
    expect_set("[wifi]\nchannel =\n", "wifi", "channel", "1", "[wifi]\nchannel = 1\n");
    expect_set("[wifi]\nchannel = ; why\n", "wifi", "channel", "1", "[wifi]\nchannel = 1 ; why\n");
    expect_set("[wifi]\rchannel = 6", "wifi", "channel", "1", "[wifi]\rchannel = 1");
    expect_set("[wifi]\nchannel = \"6\n", "wifi", "channel", "1", "[wifi]\nchannel = \"1\"\n");
    /* A byte-order mark; the last one of two counts; another section's key of the same name. */
    expect_set("\xEF\xBB\xBF[wifi]\nchannel = 6\n", "wifi", "channel", "1",
               "\xEF\xBB\xBF[wifi]\nchannel = 1\n");
    expect_set("[wifi]\nchannel = 6\nchannel = 7\n", "wifi", "channel", "1",
               "[wifi]\nchannel = 6\nchannel = 1\n");
    expect_set("[mavlink]\nbaud = 57600\n[autopilot]\nbaud = 57600\n", "autopilot", "baud",
               "115200", "[mavlink]\nbaud = 57600\n[autopilot]\nbaud = 115200\n");
}

static void a_new_line(void **state)
{
    (void)state;
    expect_set("", "wifi", "channel", "1", "[wifi]\nchannel = 1\n");
    expect_set("; nothing yet\n", "wifi", "channel", "1", "; nothing yet\n\n[wifi]\nchannel = 1\n");
    expect_set("; nothing yet", "wifi", "channel", "1", "; nothing yet\n\n[wifi]\nchannel = 1\n");
    expect_set("[wifi]\n", "wifi", "channel", "1", "[wifi]\nchannel = 1\n");
    expect_set("[wifi]", "wifi", "channel", "1", "[wifi]\nchannel = 1");
    expect_set("[wifi]\r\ncountry = NO\r\n\r\n[system]\r\n", "wifi", "channel", "1",
               "[wifi]\r\ncountry = NO\r\nchannel = 1\r\n\r\n[system]\r\n");
    /* A section that comes twice, and one that only seems to be it. */
    expect_set("[wifi]\n[system]\n[wifi]\ncountry = NO\n", "wifi", "channel", "1",
               "[wifi]\n[system]\n[wifi]\ncountry = NO\nchannel = 1\n");
    expect_set("[wifii]\nchannel = 6\n", "wifi", "channel", "1",
               "[wifii]\nchannel = 6\n\n[wifi]\nchannel = 1\n");
}

static void values_that_need_quotes(void **state)
{
    (void)state;
    expect_set("", "self_id", "description", "a; b", "[self_id]\ndescription = \"a; b\"\n");
    expect_set("", "self_id", "description", "say \"a\"", "[self_id]\ndescription = 'say \"a\"'\n");
    expect_set("", "self_id", "description", "", "[self_id]\ndescription = \"\"\n");
    expect_set("", "self_id", "description", "# a", "[self_id]\ndescription = \"# a\"\n");
    expect_set("", "self_id", "description",
               "\xE2\x80\x9C"
               "a",
               "[self_id]\ndescription = \"\xE2\x80\x9C"
               "a\"\n");
}

/* Nothing but the value itself gets into the file. */
static void values_that_no_line_holds(void **state)
{
    char longer[300];

    (void)state;
    expect_set("", "self_id", "description", "it's \"a\"", NULL);
    expect_set("", "self_id", "description", "a\n[wifi]\nchannel = 1", NULL);
    expect_set("", "self_id", "description", "a\rb", NULL);
    expect_set("", "self_id", "description", " a", NULL);
    expect_set("", "self_id", "description", "a ", NULL);
    memset(longer, 'a', sizeof(longer) - 1);
    longer[sizeof(longer) - 1] = '\0';
    expect_set("", "self_id", "description", longer, NULL);
}

/* Every key: what was set is what is read. */
static void every_key_reads_back(void **state)
{
    static const char text[] = "; begin\n[system]\ncategory = open ; c\n[wifi]\n[board]\n; end\n";

    (void)state;
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        size_t length;
        char shown[200], *made;

        config_defaults(&config);
        config_key_show(key, &config, shown, sizeof(shown));
        made = config_edit_set(text, strlen(text), key, shown, &length);
        assert_non_null(made);
        assert_non_null(strstr(made, "; begin\n[system]\n"));
        assert_non_null(strstr(made, " ; c\n"));
        assert_non_null(strstr(made, "; end\n"));
        parse(made);
        free(made);
    }
}

static void a_password_is_taken(void **state)
{
    static const struct {
        const char *text, *left, *password;
        unsigned lines;
    } cases[] = {
        {"[maintenance]\npassword = hunter2hunter2 ; mine\nat_boot = yes\n",
         "[maintenance]\n; password: taken over          \nat_boot = yes\n", "hunter2hunter2", 1},
        {"[maintenance]\r\n\tPassword='a b;c d e'\r\n",
         "[maintenance]\r\n\t; password: taken ov\r\n", "a b;c d e", 1},
        {"[maintenance]\npassword=12345678", "[maintenance]\n; password: taken", "12345678", 1},
        {"[maintenance]\npassword = 12345678\npassword = 87654321\n",
         "[maintenance]\n; password: taken o\n; password: taken o\n", "87654321", 2},
        {"[maintenance]\npassword =\n", "[maintenance]\npassword =\n", "", 0},
        {"[maintenance]\n; password = 12345678\n", "[maintenance]\n; password = 12345678\n", "", 0},
        {"[maintenance]\npassword = short\n", "[maintenance]\n; password: take\n", "", 1},
        /* What power failures left of an earlier time. */
        {"[maintenance]\n;assword = 12345678\n", "[maintenance]\n; password: taken o\n", "", 1},
        {"[maintenance]\n ;assword: taken over\n", "[maintenance]\n ; password: taken ov\n", "", 1},
        {"[wifi]\npassword = 12345678\n", "[wifi]\npassword = 12345678\n", "", 0},
        {"", "", "", 0},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        char text[200], password[CONFIG_PASSWORD_MAX + 1];

        snprintf(text, sizeof(text), "%s", cases[i].text);
        assert_int_equal(config_edit_take_password(text, strlen(text), password), cases[i].lines);
        assert_string_equal(text, cases[i].left);
        assert_string_equal(password, cases[i].password);
        /* And the same once more, when nothing is left to be taken. */
        if (cases[i].lines > 0) {
            assert_int_equal(config_edit_take_password(text, strlen(text), password), 0);
            assert_string_equal(text, cases[i].left);
        }
    }
}

static void secrets_are_left_out(void **state)
{
    static const struct {
        const char *text, *left;
    } cases[] = {
        {"[operator]\noperator_id = FIN87astrdge12k8-xyz ; mine\n",
         "[operator]\noperator_id = FIN87astrdge12k8 ; mine\n"},
        {"[operator]\r\noperator_id=\"FIN87astrdge12k8-xyz\"\r\n",
         "[operator]\r\noperator_id=\"FIN87astrdge12k8\"\r\n"},
        {"[operator]\noperator_id = FIN87astrdge12k8\xE2\x80\x93xyz\n",
         "[operator]\noperator_id = FIN87astrdge12k8\n"},
        {"[operator]\noperator_id = FIN87astrdge12k8xyz\n",
         "[operator]\noperator_id = FIN87astrdge12k8\n"},
        {"; FIN87astrdge12k8-xyz\n[operator]\noperator_id = FIN87astrdge12k8-xyz\n"
         "operator_id = 'FIN87astrdge12k8-abc' # FIN87astrdge12k8-xyz\n",
         "; FIN87astrdge12k8\n[operator]\noperator_id = FIN87astrdge12k8\n"
         "operator_id = \"FIN87astrdge12k8\" # FIN87astrdge12k8\n"},
        {"[operator]\noperator_id = FIN87astrdge12k8\n",
         "[operator]\noperator_id = FIN87astrdge12k8\n"},
        {"; nothing\n", "; nothing\n"},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        size_t length;
        char *left = config_edit_without_secrets(cases[i].text, strlen(cases[i].text), &length);

        assert_non_null(left);
        assert_string_equal(left, cases[i].left);
        assert_int_equal(length, strlen(left));
        free(left);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_that_is_there),    cmocka_unit_test(a_new_line),
        cmocka_unit_test(values_that_need_quotes), cmocka_unit_test(values_that_no_line_holds),
        cmocka_unit_test(every_key_reads_back),    cmocka_unit_test(a_password_is_taken),
        cmocka_unit_test(secrets_are_left_out),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
