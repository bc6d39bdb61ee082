#include "appliance/status_fetch.h"

#include <errno.h>
#include <json-c/json_tokener.h>

#include "appliance/status_ask.h"
#include "base/json_clean.h"

#define PATIENCE_MS 3000

struct json_object *status_fetch(const char *run_dir, int *error)
{
    static char answer[STATUS_ANSWER_MAX];
    ssize_t length = status_ask(run_dir, PATIENCE_MS, answer);
    struct json_tokener *tokener;
    struct json_object *status = NULL;

    if (length < 0) {
        *error = (int)-length;
        return NULL;
    }
    tokener = json_tokener_new();
    if (tokener != NULL) {
        status = json_tokener_parse_ex(tokener, answer, (int)length);
        json_tokener_free(tokener);
    }
    if (!json_object_is_type(status, json_type_object)) {
        json_object_put(status);
        *error = EBADMSG;
        return NULL;
    }
    json_clean(status);
    return status;
}
