/*
 * A request of whoever reaches the page's socket -> where it leads, whether it
 * is refused, and what is read out of its cookie and body.
 *
 * An input is lines: method, path, Host, Origin, Cookie, X-Odid-Page; the rest
 * is the body. A line "-" is a field that isn't there.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "on_air.h"
#include "web/web_request.h"

static char text[8192], *rest;

static const char *line(void)
{
    const char *one = strsep(&rest, "\n");

    return one == NULL ? "" : one;
}

static const char *field(void)
{
    const char *one = line();

    return strcmp(one, "-") == 0 ? NULL : one;
}

static void judge_text(const char *given, size_t size)
{
    MUST(strnlen(given, size) < size);
    for (; *given != '\0'; given++) {
        MUST((unsigned char)*given >= ' ' && *given != 0x7F);
    }
}

static void judge_target(const struct web_target *target, const char *path)
{
    MUST((target->route == WEB_FILE) <= (target->file != NULL));
    MUST((target->route == WEB_FLIGHT) <= (target->number != 0));
    MUST(target->route != WEB_FLIGHT || strspn(path + strlen("/api/flights/"), "0123456789") >= 5);
    MUST(target->route == WEB_NOWHERE || strstr(path, "..") == NULL);
}

/* What changes something is done only for our own page. */
static void judge_refusal(const struct web_head *head)
{
    for (enum web_route route = WEB_FILE; route <= WEB_NOWHERE; route++) {
        const char *why = web_refusal(head, route);
        bool changes = route == WEB_LOGIN || route == WEB_LOGOUT || route == WEB_SET ||
                       route == WEB_UPLOAD || route == WEB_CANCEL;

        MUST(why != NULL || head->host != NULL);
        MUST(why != NULL || !changes || head->page != NULL);
        MUST(why != NULL || strspn(head->host, "0123456789.:") == strlen(head->host) ||
             head->host[0] == '[' || strchr(head->host, '.') == NULL);
        MUST(why != NULL || !changes || head->origin == NULL ||
             strlen(head->origin) == strlen("http://") + strlen(head->host));
    }
}

static void judge_body(const char *body, size_t length)
{
    char password[CONFIG_PASSWORD_MAX + 1];
    struct web_settings settings;

    if (web_read_password(body, length, password)) {
        judge_text(password, sizeof(password));
    }
    if (web_read_settings(body, length, &settings)) {
        MUST(settings.operator_given || settings.serial_given);
        judge_text(settings.operator_number, sizeof(settings.operator_number));
        judge_text(settings.serial, sizeof(settings.serial));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char token[WEB_TOKEN_SIZE];
    const char *method, *path;
    struct web_target target;
    struct web_head head;

    size = size < sizeof(text) - 1 ? size : sizeof(text) - 1;
    memcpy(text, data, size);
    text[size] = '\0';
    rest = text;
    method = line();
    path = line();
    head.host = field();
    head.origin = field();
    head.cookie = field();
    head.page = field();
    target = web_target(method, path);
    judge_target(&target, path);
    judge_refusal(&head);
    if (web_cookie(head.cookie, token)) {
        MUST(strspn(token, "0123456789abcdef") == WEB_TOKEN_SIZE - 1);
        MUST(strlen(token) == WEB_TOKEN_SIZE - 1 && strstr(head.cookie, token) != NULL);
    }
    if (rest != NULL) {
        judge_body(rest, (size_t)(text + size - rest));
    }
    return 0;
}
