#include "web/web_server.h"

#include <errno.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>

#include "base/log.h"
#include "base/loop.h"
#include "base/utf8.h"
#include "web/web_answer.h"
#include "web/web_helper.h"
#include "web/web_places.h"
#include "web/web_request.h"
#include "web/web_status.h"
#include "web/web_upload.h"

/* 192.168.41.0/24 (lib/odid/maintenance). */
#define ACCESS_POINT_NETWORK UINT32_C(0xC0A82900)
#define SENTENCE_SIZE 512
#define CONNECTIONS_MAX (WEB_PLACES_MAX - 8)
#define IDLE_S 30 /* also of a browser that is gone in the middle of an upload */

/* From the first line of a request to the last octet of its answer. */
struct request {
    struct web_target target;
    struct MHD_Connection *connection;
    char token[WEB_TOKEN_SIZE];   /* of its session; "": none is needed */
    unsigned code;                /* of a refusal; 0: none yet */
    char sentence[SENTENCE_SIZE]; /* of that */
    char body[WEB_BODY_MAX + 1];
    size_t length; /* more than WEB_BODY_MAX: too long, and not kept */
    int updater;   /* where the bundle goes; -1: nowhere */
    uint64_t sent; /* of it, octets that came from the browser */
};

static struct {
    const struct web_server *server;
    struct MHD_Daemon *http;
    struct request *uploading; /* the one that has an updater; NULL: none */
    bool waiting;              /* for room in the updater */
} self;

/* ---- password and sessions, which root's half keeps ---- */

static enum MHD_Result give_patience(struct request *request, unsigned wait_s)
{
    char sentence[SENTENCE_SIZE];

    snprintf(sentence, sizeof(sentence),
             "Too many wrong passwords. Wait %u seconds before the next one.", wait_s);
    return web_give_sentence(request->connection, MHD_HTTP_TOO_MANY_REQUESTS, sentence);
}

static int fd_of(struct MHD_Connection *connection)
{
    return MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
}

/* By the address at which the page was found. */
static enum web_network network_of(struct MHD_Connection *connection)
{
    struct sockaddr_in here = {0};
    socklen_t size = sizeof(here);

    return getsockname(fd_of(connection), (struct sockaddr *)&here, &size) == 0 &&
                   here.sin_family == AF_INET &&
                   (ntohl(here.sin_addr.s_addr) & 0xFFFFFF00) == ACCESS_POINT_NETWORK
               ? WEB_BY_ACCESS_POINT
               : WEB_BY_CABLE;
}

static enum MHD_Result login(struct request *request)
{
    char password[CONFIG_PASSWORD_MAX + 1];
    struct web_login login;

    /* What can't be read is no password, and counts as a wrong one. */
    if (!web_read_password(request->body, request->length, password)) {
        password[0] = '\0';
    }
    web_helper_login(self.server->helper, network_of(request->connection), password, &login);
    explicit_bzero(password, sizeof(password));
    switch (login.verdict) {
    case WEB_PASSWORD_RIGHT:
        return web_give_cookie(request->connection, login.token, "");
    case WEB_PASSWORD_WAIT:
        return give_patience(request, login.wait_s);
    case WEB_PASSWORD_NONE:
        return web_give_sentence(
            request->connection, MHD_HTTP_FORBIDDEN,
            "No maintenance password was ever set. Set [maintenance] password in "
            "odid.conf on the volume CONFIG.");
    case WEB_NO_HELPER:
        return web_give_sentence(request->connection, MHD_HTTP_SERVICE_UNAVAILABLE,
                                 "The page's service is ending. Try again in a moment.");
    default:
        return web_give_sentence(request->connection, MHD_HTTP_FORBIDDEN,
                                 "That is not the maintenance password.");
    }
}

static bool token_of(struct MHD_Connection *connection, char token[WEB_TOKEN_SIZE])
{
    return web_cookie(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Cookie"), token);
}

static enum MHD_Result logout(struct request *request)
{
    char token[WEB_TOKEN_SIZE];

    if (token_of(request->connection, token)) {
        web_helper_leave(self.server->helper, token);
    }
    return web_give_cookie(request->connection, "", "; Max-Age=0");
}

static enum MHD_Result cancel_update(struct request *request)
{
    char token[WEB_TOKEN_SIZE], sentence[SENTENCE_SIZE];
    bool done = token_of(request->connection, token) &&
                web_helper_cancel(self.server->helper, token, sentence, sizeof(sentence));

    return web_give_sentence(request->connection, done ? MHD_HTTP_OK : MHD_HTTP_CONFLICT, sentence);
}

/* ---- settings ---- */

/* Sentences by lines -> an array of them. */
static struct json_object *lines_of(char *said)
{
    struct json_object *array = json_object_new_array();
    char clean[SENTENCE_SIZE], *rest = said, *line;

    while ((line = strsep(&rest, "\r\n")) != NULL) {
        utf8_clean(clean, sizeof(clean), line);
        if (clean[0] != '\0') {
            json_object_array_add(array, json_object_new_string(clean));
        }
    }
    return array;
}

static void set_one(const struct request *request, struct json_object *answer, const char *name,
                    enum web_setting setting, const char *value)
{
    static char said[WEB_SAID_SIZE];
    struct json_object *result = json_object_new_object();
    bool done = web_helper_set(self.server->helper, request->token, setting, value, said);

    json_object_object_add(result, "done", json_object_new_boolean(done));
    json_object_object_add(result, "said", lines_of(said));
    json_object_object_add(answer, name, result);
}

static enum MHD_Result set(struct request *request)
{
    struct json_object *answer;
    struct web_settings settings;

    if (!web_read_settings(request->body, request->length, &settings)) {
        explicit_bzero(&settings, sizeof(settings));
        return web_give_sentence(
            request->connection, MHD_HTTP_BAD_REQUEST,
            "These settings can't be understood; nothing was changed. A value is "
            "at most 127 characters on one line.");
    }
    answer = json_object_new_object();
    if (settings.serial_given) {
        set_one(request, answer, "serial", WEB_SERIAL, settings.serial);
    }
    if (settings.operator_given) {
        set_one(request, answer, "operator", WEB_OPERATOR, settings.operator_number);
    }
    explicit_bzero(&settings, sizeof(settings));
    return web_give_json(request->connection, MHD_HTTP_OK, answer);
}

/* ---- flight records ---- */

static enum MHD_Result flights(struct request *request)
{
    size_t length;
    char *text = web_flights(self.server->places, &length);

    if (text == NULL) {
        return web_give_sentence(request->connection, MHD_HTTP_NOT_FOUND,
                                 "The flight records can't be read.");
    }
    return web_give_text(request->connection, MHD_HTTP_OK, text, length);
}

static enum MHD_Result flight(struct request *request)
{
    char path[PLACES_PATH_SIZE], name[40];

    snprintf(path, sizeof(path), "%s/%05u.jsonl", self.server->places->flights,
             request->target.number);
    snprintf(name, sizeof(name), "flight-%05u.jsonl", request->target.number);
    return web_give_file(request->connection, path, "application/jsonl", name);
}

static enum MHD_Result page_file(struct request *request)
{
    char path[PLACES_PATH_SIZE];

    snprintf(path, sizeof(path), "%s/%s", self.server->places->page, request->target.file->name);
    return web_give_file(request->connection, path, request->target.file->type, NULL);
}

/* ---- the bundle ---- */

static void refuse_request(struct request *request, unsigned code, const char *sentence)
{
    request->code = code;
    snprintf(request->sentence, sizeof(request->sentence), "%s", sentence);
}

static void begin_upload(struct request *request)
{
    char sentence[SENTENCE_SIZE];

    if (self.uploading != NULL) {
        refuse_request(request, MHD_HTTP_CONFLICT, "Another file is being sent already.");
        return;
    }
    request->updater =
        web_helper_update(self.server->helper, request->token, sentence, sizeof(sentence));
    if (request->updater < 0) {
        refuse_request(request, MHD_HTTP_CONFLICT, sentence);
        return;
    }
    self.uploading = request;
    log_info("a bundle is being sent to the page");
}

/* In order, or because it can't go on: what SWUpdate has then is too short. */
static void close_upload(struct request *request)
{
    web_upload_close(request->updater);
    request->updater = -1;
    self.uploading = NULL;
    self.waiting = false;
}

static void stop_upload(struct request *request, unsigned code, const char *sentence)
{
    close_upload(request);
    refuse_request(request, code, sentence);
}

/*
 * What comes after a refusal is read and dropped: a browser shows an answer
 * only when it could send all it had.
 */
static void take_bundle(struct request *request, const char *data, size_t *length)
{
    ssize_t done;

    if (request->updater < 0) {
        *length = 0;
        return;
    }
    done = web_upload_give(request->updater, data, *length);
    if (done < 0) {
        stop_upload(request, MHD_HTTP_BAD_GATEWAY,
                    "The updater stopped taking the bundle: it was refused, or the update failed.");
        *length = 0;
        return;
    }
    request->sent += (uint64_t)done;
    if (request->sent > WEB_UPLOAD_MAX) {
        stop_upload(request, MHD_HTTP_CONTENT_TOO_LARGE,
                    "That is far too large for an update; it wasn't installed.");
        *length = 0;
        return;
    }
    *length -= (size_t)done;
    if (*length > 0) { /* until SWUpdate takes more, nothing more is read from the browser */
        MHD_suspend_connection(request->connection);
        self.waiting = true;
    }
}

static enum MHD_Result end_upload(struct request *request)
{
    close_upload(request);
    log_info("the bundle is sent");
    return web_give_sentence(request->connection, MHD_HTTP_ACCEPTED,
                             "The whole bundle is with the updater.");
}

/* ---- requests ---- */

/* Keeps its token for what root's half is asked. */
static bool is_known(struct request *request)
{
    bool known = token_of(request->connection, request->token) &&
                 web_helper_known(self.server->helper, request->token);

    web_places_know(fd_of(request->connection), known);
    return known;
}

/* Judges a request by its head, before its body was read. */
static void judge_head(struct request *request)
{
    struct MHD_Connection *connection = request->connection;
    enum web_route route = request->target.route;
    bool known = is_known(request);
    const struct web_head head = {
        .host = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Host"),
        .origin = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Origin"),
        .page = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, WEB_PAGE_HEADER),
    };
    const char *refusal = web_refusal(&head, route);

    if (refusal != NULL) {
        refuse_request(request, MHD_HTTP_FORBIDDEN, refusal);
    } else if (route == WEB_NOWHERE) {
        refuse_request(request, MHD_HTTP_NOT_FOUND, "There is nothing of that name here.");
    } else if (route == WEB_WRONG_METHOD) {
        refuse_request(request, MHD_HTTP_METHOD_NOT_ALLOWED, "That can't be done with this.");
    } else if (route != WEB_FILE && route != WEB_LOGIN && route != WEB_LOGOUT && !known) {
        refuse_request(request, MHD_HTTP_UNAUTHORIZED, "Give the maintenance password first.");
    } else if (route == WEB_UPLOAD) {
        begin_upload(request);
    }
}

static enum MHD_Result begin_request(struct MHD_Connection *connection, const char *path,
                                     const char *method, void **context)
{
    struct request *request = calloc(1, sizeof(*request));

    if (request == NULL) {
        return MHD_NO;
    }
    *context = request;
    request->connection = connection;
    request->updater = -1;
    request->target = web_target(method, path);
    judge_head(request);
    return MHD_YES;
}

static void take_body(struct request *request, const char *data, size_t *length)
{
    if (request->target.route == WEB_UPLOAD) {
        take_bundle(request, data, length);
        return;
    }
    if (request->length + *length <= WEB_BODY_MAX) {
        memcpy(request->body + request->length, data, *length);
        request->length += *length;
    } else {
        request->length = WEB_BODY_MAX + 1;
    }
    *length = 0;
}

static enum MHD_Result answer_request(struct request *request)
{
    if (request->code != 0) {
        return web_give_sentence(request->connection, request->code, request->sentence);
    }
    if (request->length > WEB_BODY_MAX) {
        return web_give_sentence(request->connection, MHD_HTTP_CONTENT_TOO_LARGE,
                                 "That is too long.");
    }
    switch (request->target.route) {
    case WEB_FILE:
        return page_file(request);
    case WEB_LOGIN:
        return login(request);
    case WEB_LOGOUT:
        return logout(request);
    case WEB_STATUS:
        return web_give_json(request->connection, MHD_HTTP_OK, web_status(self.server->places));
    case WEB_SET:
        return set(request);
    case WEB_UPLOAD:
        return end_upload(request);
    case WEB_CANCEL:
        return cancel_update(request);
    case WEB_FLIGHTS:
        return flights(request);
    case WEB_FLIGHT:
        return flight(request);
    default:
        return MHD_NO;
    }
}

/* Called with the head, then with each piece of the body, then once more for the answer. */
static enum MHD_Result on_request(void *closure, struct MHD_Connection *connection,
                                  const char *path, const char *method, const char *version,
                                  const char *data, size_t *length, void **context)
{
    struct request *request = *context;

    (void)closure;
    (void)version;
    if (request == NULL) {
        return begin_request(connection, path, method, context);
    }
    if (*length > 0) {
        take_body(request, data, length);
        return MHD_YES;
    }
    return answer_request(request);
}

/* Also of a connection that was cut: SWUpdate then sees the bundle's end too early. */
static void on_over(void *closure, struct MHD_Connection *connection, void **context,
                    enum MHD_RequestTerminationCode how)
{
    struct request *request = *context;

    (void)closure;
    web_places_answered(fd_of(connection), loop_now_us());
    if (request == NULL) {
        return;
    }
    if (request->updater >= 0) {
        log_warning("the bundle was cut short on its way to the page");
        close_upload(request);
    }
    (void)how;
    explicit_bzero(request->body, sizeof(request->body));
    free(request);
    *context = NULL;
}

static void on_connection(void *closure, struct MHD_Connection *connection, void **context,
                          enum MHD_ConnectionNotificationCode what)
{
    (void)closure;
    (void)context;
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
        web_places_come(fd_of(connection), loop_now_us());
    } else {
        web_places_go(fd_of(connection));
    }
}

/* ---- the loop ---- */

__attribute__((format(printf, 2, 0))) static void on_log(void *closure, const char *format,
                                                         va_list arguments)
{
    char line[256];

    (void)closure;
    vsnprintf(line, sizeof(line), format, arguments);
    line[strcspn(line, "\r\n")] = '\0';
    log_debug("http: %s", line);
}

/*
 * One round. select(), for libmicrohttpd's way with epoll overlooks the end of
 * a connection that it reads together with the last data: a bundle that was
 * cut short would wait for its time-out.
 */
static int round_once(void)
{
    int64_t now_us = loop_now_us(), next_us = web_places_expire(now_us);
    MHD_UNSIGNED_LONG_LONG wait_ms = 0;
    fd_set readable, writable, broken;
    struct timeval wait = {0};
    bool limited;
    int highest = -1;

    FD_ZERO(&readable);
    FD_ZERO(&writable);
    FD_ZERO(&broken);
    if (MHD_get_fdset(self.http, &readable, &writable, &broken, &highest) != MHD_YES) {
        return -EIO;
    }
    if (self.waiting) {
        FD_SET(self.uploading->updater, &writable);
        highest = self.uploading->updater > highest ? self.uploading->updater : highest;
    }
    limited = MHD_get_timeout(self.http, &wait_ms) == MHD_YES;
    if (next_us != INT64_MAX &&
        (!limited || (MHD_UNSIGNED_LONG_LONG)(next_us - now_us) / 1000 < wait_ms)) {
        limited = true;
        wait_ms = (MHD_UNSIGNED_LONG_LONG)(next_us - now_us) / 1000 + 1;
    }
    wait.tv_sec = (time_t)(wait_ms / 1000);
    wait.tv_usec = (suseconds_t)(wait_ms % 1000 * 1000);
    if (select(highest + 1, &readable, &writable, &broken, limited ? &wait : NULL) < 0) {
        return errno == EINTR ? 0 : -errno;
    }
    /* It takes more, or has closed its end: what is left is then offered again. */
    if (self.waiting && FD_ISSET(self.uploading->updater, &writable)) {
        self.waiting = false;
        MHD_resume_connection(self.uploading->connection);
    }
    return MHD_run_from_select(self.http, &readable, &writable, &broken) == MHD_YES ? 0 : -EIO;
}

int web_server_run(const struct web_server *server)
{
    int result = 0;

    self.server = server;
    self.http = MHD_start_daemon(
        MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG, 0, NULL, NULL, on_request, NULL,
        MHD_OPTION_EXTERNAL_LOGGER, on_log, NULL, MHD_OPTION_NOTIFY_CONNECTION, on_connection, NULL,
        MHD_OPTION_LISTEN_SOCKET, server->listener, MHD_OPTION_NOTIFY_COMPLETED, on_over, NULL,
        MHD_OPTION_CONNECTION_LIMIT, (unsigned)CONNECTIONS_MAX, MHD_OPTION_CONNECTION_TIMEOUT,
        (unsigned)IDLE_S, MHD_OPTION_END);
    if (self.http == NULL) {
        return -EIO;
    }
    while (result == 0) {
        result = round_once();
    }
    return result;
}
