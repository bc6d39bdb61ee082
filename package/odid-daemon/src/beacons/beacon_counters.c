#include "beacons/beacon_counters.h"

/* u16 version, u16 length; then counters of 32 bits each, or the parts: u16 tag, u16 length, and
 * content, filled up to four octets. */
#define HEAD 4
#define IN_STRUCTURE 216 /* wl_cnt_t: txbcnfrm, from the structure's start */
#define IN_PART 20       /* the macro-code's counters: txbcnfrm is the sixth */

static const uint16_t parts[] = {0x200, 0x300, 0x400}; /* by the generation of the radio's core */

static uint16_t u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | at[1] << 8);
}

static uint32_t u32(const uint8_t *at)
{
    return u16(at) | (uint32_t)u16(at + 2) << 16;
}

static bool is_macro_codes(uint16_t tag)
{
    for (size_t i = 0; i < sizeof(parts) / sizeof(parts[0]); i++) {
        if (tag == parts[i]) {
            return true;
        }
    }
    return false;
}

static bool read_part(const uint8_t *at, size_t left, uint32_t *beacons)
{
    while (left >= HEAD) {
        size_t length = u16(at + 2), whole = HEAD + ((length + 3) & ~(size_t)3);

        if (length > left - HEAD) {
            return false;
        }
        if (is_macro_codes(u16(at)) && length >= IN_PART + sizeof(*beacons)) {
            *beacons = u32(at + HEAD + IN_PART);
            return true;
        }
        if (whole > left) {
            return false;
        }
        at += whole;
        left -= whole;
    }
    return false;
}

bool beacon_counters_read(const uint8_t *answer, size_t length, uint32_t *beacons)
{
    if (length < HEAD) {
        return false;
    }
    switch (u16(answer)) {
    case 10:
    case 11: /* its length is that of all of it */
        if (u16(answer + 2) > length || u16(answer + 2) < IN_STRUCTURE + sizeof(*beacons)) {
            return false;
        }
        *beacons = u32(answer + IN_STRUCTURE);
        return true;
    case 30: /* its length is that of the parts */
        return u16(answer + 2) <= length - HEAD &&
               read_part(answer + HEAD, u16(answer + 2), beacons);
    default:
        return false;
    }
}
