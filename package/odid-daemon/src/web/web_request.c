#include "web/web_request.h"

#include <arpa/inet.h>
#include <json-c/json_tokener.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "flights/recorder_store.h"

/* ---- what is asked for ---- */

/* Nothing else of the folder can be had: no path is ever made of what was asked. */
static const struct web_file files[] = {
    {"/", "index.html", "text/html; charset=utf-8"},
    {"/style.css", "style.css", "text/css; charset=utf-8"},
    {"/page.js", "page.js", "text/javascript; charset=utf-8"},
    {"/icon.svg", "icon.svg", "image/svg+xml"},
};

static const struct {
    const char *method, *path;
    enum web_route route;
} calls[] = {
    {"POST", "/api/session", WEB_LOGIN},  {"DELETE", "/api/session", WEB_LOGOUT},
    {"GET", "/api/status", WEB_STATUS},   {"POST", "/api/settings", WEB_SET},
    {"POST", "/api/update", WEB_UPLOAD},  {"DELETE", "/api/update", WEB_CANCEL},
    {"GET", "/api/flights", WEB_FLIGHTS},
};

#define FLIGHT_PATH "/api/flights/"

struct web_target web_target(const char *method, const char *path)
{
    struct web_target target = {.route = WEB_NOWHERE};
    bool get = strcmp(method, "GET") == 0;

    for (size_t i = 0; i < sizeof(files) / sizeof(files[0]); i++) {
        if (strcmp(path, files[i].path) == 0) {
            target.route = get ? WEB_FILE : WEB_WRONG_METHOD;
            target.file = &files[i];
            return target;
        }
    }
    for (size_t i = 0; i < sizeof(calls) / sizeof(calls[0]); i++) {
        if (strcmp(path, calls[i].path) == 0) {
            if (strcmp(method, calls[i].method) == 0) {
                target.route = calls[i].route;
                return target;
            }
            target.route = WEB_WRONG_METHOD;
        }
    }
    if (strncmp(path, FLIGHT_PATH, strlen(FLIGHT_PATH)) == 0) {
        target.number = recorder_store_number(path + strlen(FLIGHT_PATH));
        target.route = target.number == 0 ? WEB_NOWHERE : get ? WEB_FLIGHT : WEB_WRONG_METHOD;
    }
    return target;
}

/* ---- who asks ---- */

#define NAME_CHARACTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-"

/* ":80", or nothing */
static bool is_port(const char *text)
{
    return text[0] == '\0' || (text[0] == ':' && text[1 + strspn(text + 1, "0123456789")] == '\0');
}

/* An address, or a name that no public name server can give; with a port or without. */
static bool host_is_near(const char *host)
{
    bool six = host[0] == '[';
    size_t length = strcspn(host + six, six ? "]" : ":");
    const char *end = host + six + length;
    char name[64];
    uint8_t address[sizeof(struct in6_addr)];

    if (length == 0 || length >= sizeof(name) || (six && *end != ']') || !is_port(end + six)) {
        return false;
    }
    snprintf(name, sizeof(name), "%.*s", (int)length, host + six);
    if (six) {
        return inet_pton(AF_INET6, name, address) == 1;
    }
    return inet_pton(AF_INET, name, address) == 1 || name[strspn(name, NAME_CHARACTERS)] == '\0';
}

static bool changes_something(enum web_route route)
{
    return route == WEB_LOGIN || route == WEB_LOGOUT || route == WEB_SET || route == WEB_UPLOAD ||
           route == WEB_CANCEL;
}

const char *web_refusal(const struct web_head *head, enum web_route route)
{
    static const char scheme[] = "http://";

    if (head->host == NULL || !host_is_near(head->host)) {
        return "This page answers only to the appliance's own address. In maintenance mode, open "
               "http://192.168.41.1/ on its Wi-Fi.";
    }
    if (!changes_something(route)) {
        return NULL;
    }
    if (head->page == NULL ||
        (head->origin != NULL && (strncasecmp(head->origin, scheme, strlen(scheme)) != 0 ||
                                  strcasecmp(head->origin + strlen(scheme), head->host) != 0))) {
        return "This was asked by another page than the appliance's own, and was not done.";
    }
    return NULL;
}

bool web_cookie(const char *cookie, char token[WEB_TOKEN_SIZE])
{
    static const char name[] = WEB_COOKIE "=";

    while (cookie != NULL && cookie[0] != '\0') {
        size_t length;

        cookie += strspn(cookie, " ;");
        length = strcspn(cookie, ";");
        if (strncmp(cookie, name, strlen(name)) == 0 &&
            length == strlen(name) + WEB_TOKEN_SIZE - 1 &&
            strspn(cookie + strlen(name), "0123456789abcdef") >= WEB_TOKEN_SIZE - 1) {
            snprintf(token, WEB_TOKEN_SIZE, "%s", cookie + strlen(name));
            return true;
        }
        cookie += length;
    }
    return false;
}

/* ---- bodies ---- */

/* The whole body as one flat object; NULL when it is something else. */
static struct json_object *read_object(const char *body, size_t length)
{
    struct json_tokener *tokener = length > WEB_BODY_MAX ? NULL : json_tokener_new_ex(2);
    struct json_object *object;

    if (tokener == NULL) {
        return NULL;
    }
    json_tokener_set_flags(tokener, JSON_TOKENER_STRICT);
    object = json_tokener_parse_ex(tokener, body, (int)length);
    if (json_tokener_get_error(tokener) != json_tokener_success ||
        json_tokener_get_parse_end(tokener) != length ||
        !json_object_is_type(object, json_type_object)) {
        json_object_put(object);
        object = NULL;
    }
    json_tokener_free(tokener);
    return object;
}

/*
 * Takes a text that fits, without control characters or zeros within, and
 * clears the library's copy: it may be a secret.
 */
static bool read_string(struct json_object *field, char *out, size_t size)
{
    bool is_text = json_object_is_type(field, json_type_string), good;
    char *text = is_text ? (char *)json_object_get_string(field) : NULL;

    good =
        is_text && strlen(text) == (size_t)json_object_get_string_len(field) && strlen(text) < size;
    for (const char *c = text; good && *c != '\0'; c++) {
        good = (unsigned char)*c >= ' ' && *c != 0x7F;
    }
    snprintf(out, size, "%s", good ? text : "");
    if (is_text) {
        explicit_bzero(text, (size_t)json_object_get_string_len(field));
    }
    return good;
}

bool web_read_password(const char *body, size_t length, char password[CONFIG_PASSWORD_MAX + 1])
{
    struct json_object *object = read_object(body, length);
    bool good =
        read_string(json_object_object_get(object, "password"), password, CONFIG_PASSWORD_MAX + 1);

    json_object_put(object);
    return good;
}

bool web_read_settings(const char *body, size_t length, struct web_settings *settings)
{
    struct json_object *object = read_object(body, length), *field;
    bool good = object != NULL;

    memset(settings, 0, sizeof(*settings));
    settings->operator_given = json_object_object_get_ex(object, "operator", &field);
    if (settings->operator_given) {
        good = good &&
               read_string(field, settings->operator_number, sizeof(settings->operator_number));
    }
    settings->serial_given = json_object_object_get_ex(object, "serial", &field);
    if (settings->serial_given) {
        good = good && read_string(field, settings->serial, sizeof(settings->serial));
    }
    json_object_put(object);
    return good && (settings->operator_given || settings->serial_given);
}
