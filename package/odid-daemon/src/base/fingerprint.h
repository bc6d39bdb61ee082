/* FNV-1a, 64 bits: tells what has changed from what was there before; nobody has to be kept from
 * forging it. */
#ifndef ODID_FINGERPRINT_H
#define ODID_FINGERPRINT_H

#include <stddef.h>
#include <stdint.h>

#define FINGERPRINT_OF_NOTHING UINT64_C(0xcbf29ce484222325)

/* Of what gave before, with these octets behind it. */
uint64_t fingerprint(uint64_t before, const void *octets, size_t length);

#endif
