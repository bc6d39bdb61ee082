/*
 * The page's HTTP server, on libmicrohttpd: one thread, one loop. It runs
 * without rights; what needs root is asked of web_helper.
 */
#ifndef ODID_WEB_SERVER_H
#define ODID_WEB_SERVER_H

#include "appliance/places.h"

struct web_server {
    int listener; /* a listening, non-blocking TCP socket */
    int helper;   /* the socket to web_helper_serve */
    const struct places *places;
};

/* Serves for ever. Returns only when it can't: -errno. */
int web_server_run(const struct web_server *server);

#endif
