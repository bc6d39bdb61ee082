#include "base/fingerprint.h"

uint64_t fingerprint(uint64_t before, const void *octets, size_t length)
{
    const uint8_t *octet = octets;

    for (size_t i = 0; i < length; i++) {
        before = (before ^ octet[i]) * UINT64_C(0x100000001b3);
    }
    return before;
}
