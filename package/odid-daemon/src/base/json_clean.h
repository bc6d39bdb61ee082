/* JSON that others have written, before a terminal sees it. */
#ifndef ODID_JSON_CLEAN_H
#define ODID_JSON_CLEAN_H

#include <json-c/json_object.h>

/*
 * What a terminal would obey becomes '?' in every text, however deep, and ends
 * it where it is a zero; what has a name that isn't plain is left out. The daemon
 * speaks with the network's words, and it or the recorder may have been taken
 * over. Texts are cut at 1 KiB.
 */
void json_clean(struct json_object *value);

#endif
