/* JSON that others have written, before a terminal sees it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <json-c/json_tokener.h>
#include <string.h>

#include "base/json_clean.h"

static void assert_cleaned(const char *text, const char *expected)
{
    struct json_object *value = json_tokener_parse(text);

    assert_non_null(value);
    json_clean(value);
    assert_string_equal(json_object_to_json_string_ext(value, JSON_C_TO_STRING_PLAIN), expected);
    json_object_put(value);
}

static void texts_move_no_cursor(void **state)
{
    (void)state;
    assert_cleaned("{\"a\":\"x\\u001b[2Jy\"}", "{\"a\":\"x?[2Jy\"}");
    assert_cleaned("{\"a\":[{\"b\":\"\302\2332J\\u007f\"}]}", "{\"a\":[{\"b\":\"?2J?\"}]}");
    assert_cleaned("{\"a\":\"G\303\266teborg\"}", "{\"a\":\"G\303\266teborg\"}");
}

/* What came behind it was left as it was. */
static void a_zero_ends_a_text(void **state)
{
    (void)state;
    assert_cleaned("{\"a\":\"ok\\u0000\302\2332J\"}", "{\"a\":\"ok\"}");
}

static void names_move_none_either(void **state)
{
    (void)state;
    assert_cleaned("{\"\302\2332J\":1,\"b\":{\"\\u007f\":2,\"c\":3},\"\\u001b\":4}",
                   "{\"b\":{\"c\":3}}");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(texts_move_no_cursor),
        cmocka_unit_test(a_zero_ends_a_text),
        cmocka_unit_test(names_move_none_either),
    };

    return cmocka_run_group_tests_name("odidctl, JSON", tests, NULL, NULL);
}
