/*
 * odid-web's other half. Whoever speaks to the network has no rights, and may
 * have been taken over by what came from there; what needs root is done by this
 * small process, that never sees a request of the network. It keeps who is
 * logged in and how often a password may be tried, and takes these orders over
 * a socket that only its child has:
 *
 *   - log in.  The password is compared with what the access point's key is
 *     made of it (maintenance_key.h): no other secret is kept.
 *   - is this a session?  End it.
 *   - for a session: set the operator number, or the aircraft's serial number:
 *     what odidctl set does, with its checks, and not while armed.
 *   - for a session: call off what is being installed.
 *   - for a session: ask SWUpdate to install a bundle, and hand over the
 *     connection when it will. SWUpdate's sockets take other orders as well
 *     (versions, hawkBit, a dry run), and are nobody else's.
 *
 * A half that was taken over gets at what those may do who log in meanwhile,
 * for as long as they are; and nothing before.
 */
#ifndef ODID_WEB_HELPER_H
#define ODID_WEB_HELPER_H

#include <stdbool.h>
#include <stddef.h>

#include "appliance/exits.h"
#include "appliance/places.h"
#include "web/web_request.h"
#include "web/web_session.h"

enum web_setting { WEB_OPERATOR, WEB_SERIAL };

#define WEB_SAID_SIZE 4096

/* ---- in the unprivileged half ---- */

/* Zero, which an answer begins with, lets nobody in. */
enum web_password {
    WEB_NO_HELPER,
    WEB_PASSWORD_WRONG,
    WEB_PASSWORD_NONE, /* none was ever set */
    WEB_PASSWORD_WAIT, /* too many were tried: it wasn't looked at */
    WEB_PASSWORD_RIGHT,
};

struct web_login {
    enum web_password verdict;
    unsigned wait_s;            /* WAIT: for so long */
    char token[WEB_TOKEN_SIZE]; /* RIGHT: the new session's */
};

/* A password is one that is right or not; what is no password is a wrong one, and counts as
 * tried. Takes some milliseconds. */
void web_helper_login(int helper, enum web_network network, const char *password,
                      struct web_login *login);

/* Is it a session? It is used now, if so. */
bool web_helper_known(int helper, const char token[WEB_TOKEN_SIZE]);

void web_helper_leave(int helper, const char token[WEB_TOKEN_SIZE]);

/*
 * Returns whether the value counts now or will (ODIDCTL_GOOD, ODIDCTL_HALF_DONE)
 * or not; said: what is to be told, sentences by lines. Takes seconds when
 * services are restarted.
 */
bool web_helper_set(int helper, const char token[WEB_TOKEN_SIZE], enum web_setting setting,
                    const char *value, char said[WEB_SAID_SIZE]);

/* web_upload_open's descriptor; -1 with the sentence for the technician. */
int web_helper_update(int helper, const char token[WEB_TOKEN_SIZE], char *sentence, size_t size);

/* Returns whether it is called off; if not, the sentence says why not. */
bool web_helper_cancel(int helper, const char token[WEB_TOKEN_SIZE], char *sentence, size_t size);

/* ---- in root's half ---- */

/* Serves orders from the socket until its other end is closed. */
void web_helper_serve(int orders, const struct places *places);

#endif
