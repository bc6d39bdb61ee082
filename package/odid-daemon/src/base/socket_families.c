#include "base/socket_families.h"

#include <stdbool.h>
#include <sys/socket.h>

#define FAMILIES_MAX 64 /* more than Linux has */

static bool is_among(int family, const int *allowed, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (allowed[i] == family) {
            return true;
        }
    }
    return false;
}

int socket_families_refuse(scmp_filter_ctx filter, uint32_t refuse, const int *allowed,
                           size_t count)
{
    /* The kernel looks at 32 of these 64 bits only. */
    int result = seccomp_rule_add(filter, refuse, SCMP_SYS(socket), 1,
                                  SCMP_A0(SCMP_CMP_GE, (scmp_datum_t)FAMILIES_MAX));

    for (int family = 0; result == 0 && family < FAMILIES_MAX; family++) {
        if (!is_among(family, allowed, count)) {
            result = seccomp_rule_add(filter, refuse, SCMP_SYS(socket), 1,
                                      SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)family));
        }
    }
    return result;
}

int socket_families_datagrams_only(scmp_filter_ctx filter, uint32_t refuse)
{
    int result = 0;

    for (unsigned type = 0; result == 0 && type <= SOCKET_TYPE_MASK; type++) {
        if (type != SOCK_DGRAM) {
            result =
                seccomp_rule_add(filter, refuse, SCMP_SYS(socket), 2, SCMP_A0(SCMP_CMP_EQ, AF_INET),
                                 SCMP_A1(SCMP_CMP_MASKED_EQ, SOCKET_TYPE_MASK, type));
        }
    }
    return result;
}
