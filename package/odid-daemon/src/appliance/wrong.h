/* What is wrong, and what is since something was done. */
#ifndef ODID_WRONG_H
#define ODID_WRONG_H

#include <json-c/json_object.h>
#include <stddef.h>

#include "appliance/places.h"

/* All that is wrong now: array of sentences, the appliance's faults and the daemon's. The caller
 * puts it back. */
struct json_object *wrong_now(const struct places *places);

/* What is wrong and wasn't before, once what was started again has had its time: a second if
 * nothing is, fifteen otherwise. out: a sentence, or "". */
void wrong_since(const struct places *places, struct json_object *before, char *out, size_t size);

#endif
