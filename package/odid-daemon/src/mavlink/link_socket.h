/*
 * The UDP socket to which the autopilot's datagrams come. odid-keeper opens one
 * for each daemon, hands it down (ODID_LINK_FD), and keeps it open until the next
 * one is started: between two of them the port stays taken.
 */
#ifndef ODID_LINK_SOCKET_H
#define ODID_LINK_SOCKET_H

#include <stdbool.h>

#include "config/config.h"

#define LINK_SOCKET_VARIABLE "ODID_LINK_FD"

/* Opens and binds it where config says, non-blocking. Returns the descriptor, or -errno. */
int link_socket_open(const struct config *config);

/* Is that a UDP socket, and bound where config says? */
bool link_socket_fits(int fd, const struct config *config);

#endif
