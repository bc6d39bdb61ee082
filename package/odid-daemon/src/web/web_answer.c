#include "web/web_answer.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "web/web_request.h"

#define JSON_TYPE "application/json"

static void header(struct MHD_Response *response, const char *name, const char *value)
{
    MHD_add_response_header(response, name, value);
}

/* The browser is to take nothing from elsewhere, to send nothing elsewhere, and to keep nothing. */
static void add_headers(struct MHD_Response *response, const char *type)
{
    header(response, "Content-Type", type);
    header(response, "Cache-Control", "no-store");
    header(response, "Content-Security-Policy",
           "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
           "connect-src 'self'; form-action 'none'; frame-ancestors 'none'; base-uri 'none'");
    header(response, "X-Content-Type-Options", "nosniff");
    header(response, "Referrer-Policy", "no-referrer");
    header(response, "Cross-Origin-Resource-Policy", "same-origin");
}

/* Takes the response. */
static enum MHD_Result give(struct MHD_Connection *connection, unsigned code,
                            struct MHD_Response *response, const char *type)
{
    enum MHD_Result result;

    if (response == NULL) {
        return MHD_NO;
    }
    add_headers(response, type);
    result = MHD_queue_response(connection, code, response);
    MHD_destroy_response(response);
    return result;
}

/* Takes the text, which was allocated. */
enum MHD_Result web_give_text(struct MHD_Connection *connection, unsigned code, char *text,
                              size_t length)
{
    return give(connection, code,
                MHD_create_response_from_buffer(length, text, MHD_RESPMEM_MUST_FREE), JSON_TYPE);
}

static struct MHD_Response *response_of(struct json_object *object)
{
    const char *text = json_object_to_json_string_ext(object, JSON_C_TO_STRING_PLAIN |
                                                                  JSON_C_TO_STRING_NOSLASHESCAPE);

    return MHD_create_response_from_buffer(strlen(text), (void *)text, MHD_RESPMEM_MUST_COPY);
}

/* Takes the object. */
enum MHD_Result web_give_json(struct MHD_Connection *connection, unsigned code,
                              struct json_object *object)
{
    struct MHD_Response *response = response_of(object);

    json_object_put(object);
    return give(connection, code, response, JSON_TYPE);
}

static struct json_object *sentence_json(const char *sentence)
{
    struct json_object *object = json_object_new_object();

    json_object_object_add(object, "sentence", json_object_new_string(sentence));
    return object;
}

enum MHD_Result web_give_sentence(struct MHD_Connection *connection, unsigned code,
                                  const char *sentence)
{
    return web_give_json(connection, code, sentence_json(sentence));
}

enum MHD_Result web_give_file(struct MHD_Connection *connection, const char *path, const char *type,
                              const char *download)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    struct MHD_Response *response;
    char disposition[64];
    struct stat file;

    if (fd < 0 || fstat(fd, &file) < 0 || !S_ISREG(file.st_mode)) {
        log_warning("%s can't be given: %s", path, fd < 0 ? strerror(errno) : "no file");
        if (fd >= 0) {
            close(fd);
        }
        return web_give_sentence(connection, MHD_HTTP_NOT_FOUND,
                                 "That isn't there, or not any more.");
    }
    response = MHD_create_response_from_fd64((uint64_t)file.st_size, fd);
    if (response == NULL) {
        close(fd);
    } else if (download != NULL) {
        snprintf(disposition, sizeof(disposition), "attachment; filename=\"%s\"", download);
        header(response, "Content-Disposition", disposition);
    }
    return give(connection, MHD_HTTP_OK, response, type);
}

enum MHD_Result web_give_cookie(struct MHD_Connection *connection, const char *token,
                                const char *more)
{
    struct json_object *object = json_object_new_object();
    struct MHD_Response *response = response_of(object);
    char cookie[128];

    json_object_put(object);
    if (response != NULL) {
        snprintf(cookie, sizeof(cookie), WEB_COOKIE "=%s; Path=/; HttpOnly; SameSite=Strict%s",
                 token, more);
        header(response, "Set-Cookie", cookie);
    }
    return give(connection, MHD_HTTP_OK, response, JSON_TYPE);
}
