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

#endif
