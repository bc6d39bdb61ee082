/*
 * Which kinds of sockets a process may make: a part of its system-call filter.
 */
#ifndef ODID_SOCKET_FAMILIES_H
#define ODID_SOCKET_FAMILIES_H

#include <seccomp.h>
#include <stddef.h>
#include <stdint.h>

/* Adds refuse for each family (AF_...) but the count allowed ones. Returns 0, or -errno. */
int socket_families_refuse(scmp_filter_ctx filter, uint32_t refuse, const int *allowed,
                           size_t count);

/* What the kernel looks at of socket's type: two flags are in it besides. */
#define SOCKET_TYPE_MASK 0xF

/* Adds refuse for the internet's sockets (AF_INET) but datagrams: a raw one sends under any name
 * and port, and one of a connection, passed on, can hold up whoever closes it. */
int socket_families_datagrams_only(scmp_filter_ctx filter, uint32_t refuse);

#endif
