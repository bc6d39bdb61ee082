/* What is wrong, from a folder that isn't root's on a computer with systemd: root reads it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <json-c/json.h>
#include <stdlib.h>
#include <string.h>

#include "appliance/faults.h"
#include "own_folder.h"

static const char *sentence_of(struct json_object *faults, const char *name)
{
    for (size_t i = 0; i < json_object_array_length(faults); i++) {
        struct json_object *fault = json_object_array_get_idx(faults, i), *value;

        if (json_object_object_get_ex(fault, "name", &value) &&
            strcmp(json_object_get_string(value), name) == 0) {
            json_object_object_get_ex(fault, "sentence", &value);
            return json_object_get_string(value);
        }
    }
    return "";
}

/* The first line of anything was on root's screen, and a watchdog's device was opened. */
static void a_link_is_not_followed(void **state)
{
    struct json_object *faults;

    (void)state;
    assert_int_equal(system("mkdir f && echo secret >others && ln -s ../others f/link && "
                            "echo There is none. >f/radio && mkfifo f/fifo && mkdir f/folder"),
                     0);
    faults = faults_list("f");
    assert_string_equal(sentence_of(faults, "radio"), "There is none.");
    assert_string_equal(sentence_of(faults, "link"),
                        "what is wrong can't be read: Too many levels of symbolic links");
    assert_null(strstr(json_object_to_json_string(faults), "secret"));
    json_object_put(faults);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_link_is_not_followed),
    };

    return enter_own_folder() < 0 || cmocka_run_group_tests(tests, NULL, leave_own_folder);
}
