/*
 * The answers of the technician's page, each with the headers that keep a
 * browser from taking anything from elsewhere and from keeping anything.
 * Each queues one answer; MHD_NO: there is no memory for it.
 */
#ifndef ODID_WEB_ANSWER_H
#define ODID_WEB_ANSWER_H

#include <json-c/json_object.h>
#include <microhttpd.h>
#include <stddef.h>

/* JSON that was allocated: it is taken. */
enum MHD_Result web_give_text(struct MHD_Connection *connection, unsigned code, char *text,
                              size_t length);

/* Takes the object. */
enum MHD_Result web_give_json(struct MHD_Connection *connection, unsigned code,
                              struct json_object *object);

/* {"sentence": ...} */
enum MHD_Result web_give_sentence(struct MHD_Connection *connection, unsigned code,
                                  const char *sentence);

/* A regular file, or 404. download: the name to save it under; NULL: it is shown. */
enum MHD_Result web_give_file(struct MHD_Connection *connection, const char *path, const char *type,
                              const char *download);

/* An empty object and the session's cookie; more: further attributes, each after "; ". */
enum MHD_Result web_give_cookie(struct MHD_Connection *connection, const char *token,
                                const char *more);

#endif
