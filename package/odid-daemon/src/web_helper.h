/*
 * odid-web's other half. Whoever speaks to the network has no rights; what
 * needs root is done by this small process, that never sees a request of the
 * network: it takes two orders over a socket that only its child has.
 *
 *   - is this the technician's password?  It is compared with what the access
 *     point's key is made of it (maintenance_key.h): no other secret is kept.
 *   - set the operator number, or the aircraft's serial number: what odidctl
 *     set does, with its checks, and not while the aircraft is armed.
 */
#ifndef ODID_WEB_HELPER_H
#define ODID_WEB_HELPER_H

#include <stdbool.h>
#include <stddef.h>

#include "odidctl.h"
#include "web_request.h"

enum web_setting { WEB_OPERATOR, WEB_SERIAL };

#define WEB_SAID_SIZE 4096

/* ---- in the unprivileged half ---- */

/* Zero, which an answer begins with, lets nobody in. */
enum web_password { WEB_NO_HELPER, WEB_PASSWORD_WRONG, WEB_PASSWORD_NONE, WEB_PASSWORD_RIGHT };

/* NONE: no password was ever set. Takes some milliseconds. */
enum web_password web_helper_password(int helper, const char *password);

/*
 * Returns whether the value counts now or will (ODIDCTL_GOOD, ODIDCTL_HALF_DONE)
 * or not; said: what is to be told, sentences by lines. Takes seconds when
 * services are restarted.
 */
bool web_helper_set(int helper, enum web_setting setting, const char *value,
                    char said[WEB_SAID_SIZE]);

/* ---- in root's half ---- */

/* Serves orders from the socket until its other end is closed. */
void web_helper_serve(int orders, const struct odidctl_places *places);

#endif
