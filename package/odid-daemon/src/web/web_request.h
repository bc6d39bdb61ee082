/*
 * What a browser asks for, and whether it may: paths, the headers that tell our
 * own page from a foreign one, and the bodies of requests.
 *
 * Pure. Everything here comes from whoever reached the socket.
 */
#ifndef ODID_WEB_REQUEST_H
#define ODID_WEB_REQUEST_H

#include <stdbool.h>
#include <stddef.h>

#include "config/config.h"
#include "web/web_session.h"

/* ---- what is asked for ---- */

enum web_route {
    WEB_FILE,    /* a part of the page itself; the only one without a password */
    WEB_LOGIN,   /* POST /api/session */
    WEB_LOGOUT,  /* DELETE /api/session */
    WEB_STATUS,  /* GET /api/status */
    WEB_SET,     /* POST /api/settings */
    WEB_UPLOAD,  /* POST /api/update */
    WEB_CANCEL,  /* DELETE /api/update */
    WEB_FLIGHTS, /* GET /api/flights */
    WEB_FLIGHT,  /* GET /api/flights/00042.jsonl */
    WEB_WRONG_METHOD,
    WEB_NOWHERE,
};

/* A file of the page. */
struct web_file {
    const char *path; /* as it is asked for: "/page.js" */
    const char *name; /* in the page's folder */
    const char *type;
};

/* file is set for WEB_FILE, number for WEB_FLIGHT. */
struct web_target {
    enum web_route route;
    const struct web_file *file;
    unsigned number;
};
struct web_target web_target(const char *method, const char *path);

/* ---- who asks ---- */

/* Header fields of a request; NULL for one that isn't there. */
struct web_head {
    const char *host, *origin, *cookie;
    const char *page; /* WEB_PAGE_HEADER, which a foreign page can't send without being asked */
};
#define WEB_PAGE_HEADER "X-Odid-Page"

/*
 * The sentence that says why a request isn't answered; NULL: it may be.
 *
 * Host has to be an address or a name without dots: a foreign page whose own
 * name was made to lead here (DNS rebinding) has one with dots. Whatever
 * changes something has to come from our page: the page header, and no Origin
 * but ours.
 */
const char *web_refusal(const struct web_head *head, enum web_route route);

#define WEB_COOKIE "odid"

/* The session's token in a Cookie header; false when there is none that looks like one. */
bool web_cookie(const char *cookie, char token[WEB_TOKEN_SIZE]);

/* ---- bodies ---- */

#define WEB_BODY_MAX 2048
#define WEB_VALUE_SIZE 128 /* of one setting, longer than any that is right */

struct web_settings {
    bool operator_given, serial_given;
    char operator_number[WEB_VALUE_SIZE]; /* may have its secret part: clear it after use */
    char serial[WEB_VALUE_SIZE];
};

/* {"password": "..."}. False when it is something else. */
bool web_read_password(const char *body, size_t length, char password[CONFIG_PASSWORD_MAX + 1]);

/* {"operator": "...", "serial": "..."}, each may be missing, not both. False otherwise. */
bool web_read_settings(const char *body, size_t length, struct web_settings *settings);

#endif
