#include "base/json_clean.h"

#include <json-c/linkhash.h>
#include <string.h>

#include "base/utf8.h"

#define TEXT_SIZE 1024

/* Ours are all of printable ASCII. */
static bool is_plain(const char *name)
{
    while (*name >= ' ' && *name <= '~') {
        name++;
    }
    return *name == '\0';
}

static void clean_text(struct json_object *value)
{
    char text[TEXT_SIZE];
    size_t length = (size_t)json_object_get_string_len(value);

    if (utf8_clean(text, sizeof(text), json_object_get_string(value)) > 0 ||
        strlen(text) != length) {
        json_object_set_string(value, text);
    }
}

/* Deeper than the tokener goes there is nothing. */
void json_clean(struct json_object *value)
{
    switch (json_object_get_type(value)) {
    case json_type_string:
        clean_text(value);
        break;
    case json_type_array:
        for (size_t i = 0; i < json_object_array_length(value); i++) {
            json_clean(json_object_array_get_idx(value, i));
        }
        break;
    case json_type_object: {
        json_object_object_foreach(value, name, inner)
        {
            if (is_plain(name)) {
                json_clean(inner);
            } else {
                json_object_object_del(value, name);
            }
        }
        break;
    }
    default:
        break;
    }
}
