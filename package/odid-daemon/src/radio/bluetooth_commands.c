#include "radio/bluetooth_commands.h"

#include <stdio.h>
#include <string.h>

#define ADV_NONCONN_IND 0x03
#define RANDOM_ADDRESS 0x01
#define ALL_CHANNELS 0x07
#define LEGACY_NONCONN 0x0010 /* event properties: legacy PDU, nothing else */
#define PHY_1M 0x01
#define PHY_CODED 0x03
#define REQUIRE_S8 0x04 /* primary and secondary PHY options */
#define NO_TX_POWER_PREFERENCE 0x7F
#define DATA_COMPLETE 0x03
/* Within 27 to 251 octets, and 328 to 17040 us (7.8.34). */
#define MARK_OCTETS 0x0051
#define MARK_US 0x05D3
#define DATA_NOT_FRAGMENTED 0x01

bool bluetooth_changes_advertising(uint16_t opcode)
{
    switch (opcode) {
    case BLUETOOTH_RESET:
    case BLUETOOTH_SET_ADDRESS:
    case BLUETOOTH_SET_PARAMETERS:
    case BLUETOOTH_SET_DATA:
    case BLUETOOTH_SET_ENABLE:
    case BLUETOOTH_SET_EXTENDED_PARAMETERS_V2:
        return true;
    default:
        /* 0x203A and 0x203B only read sizes. */
        return opcode >= BLUETOOTH_SET_EXTENDED_ADDRESS && opcode <= BLUETOOTH_CLEAR_SETS &&
               opcode != 0x203A && opcode != 0x203B;
    }
}

static uint8_t *put16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
    return out + 2;
}

static uint8_t *put24(uint8_t *out, uint16_t value)
{
    out = put16(out, value);
    *out = 0;
    return out + 1;
}

/* 7.8.5 LE Set Advertising Parameters */
size_t bluetooth_parameters(uint16_t interval, uint8_t *out)
{
    uint8_t *end = put16(put16(out, interval), interval);

    *end++ = ADV_NONCONN_IND;
    *end++ = RANDOM_ADDRESS;
    memset(end, 0, 7); /* no peer */
    end += 7;
    *end++ = ALL_CHANNELS;
    *end++ = 0; /* no filter */
    return (size_t)(end - out);
}

/* 7.8.53 LE Set Extended Advertising Parameters [v1] */
size_t bluetooth_extended_parameters(enum bluetooth_set set, uint16_t interval, uint8_t *out)
{
    bool legacy = set == BLUETOOTH_LEGACY;
    uint8_t *end = out;

    *end++ = (uint8_t)set; /* the handle */
    end = put16(end, legacy ? LEGACY_NONCONN : 0);
    end = put24(put24(end, interval), interval);
    *end++ = ALL_CHANNELS;
    *end++ = RANDOM_ADDRESS;
    memset(end, 0, 7); /* no peer */
    end += 7;
    *end++ = 0; /* no filter */
    *end++ = NO_TX_POWER_PREFERENCE;
    *end++ = legacy ? PHY_1M : PHY_CODED;
    *end++ = 0; /* no event of the primary channel skipped */
    *end++ = legacy ? PHY_1M : PHY_CODED;
    *end++ = (uint8_t)set; /* the set's SID */
    *end++ = 0;            /* nobody can ask: no scan request notifications */
    return (size_t)(end - out);
}

/* 7.8.53, [v2]: the PHY options at the end */
size_t bluetooth_extended_parameters_v2(enum bluetooth_set set, uint16_t interval, uint8_t *out)
{
    size_t length = bluetooth_extended_parameters(set, interval, out);
    uint8_t options = set == BLUETOOTH_LEGACY ? 0 : REQUIRE_S8;

    out[length++] = options;
    out[length++] = options;
    return length;
}

/* 7.8.52 LE Set Advertising Set Random Address */
size_t bluetooth_extended_address(enum bluetooth_set set, const uint8_t address[6], uint8_t *out)
{
    out[0] = (uint8_t)set;
    memcpy(out + 1, address, 6);
    return 7;
}

/* 7.8.7 LE Set Advertising Data: always 31 bytes behind their number */
size_t bluetooth_data(const uint8_t *data, size_t length, uint8_t *out)
{
    memset(out, 0, 32);
    out[0] = (uint8_t)length;
    memcpy(out + 1, data, length);
    return 32;
}

/* 7.8.54 LE Set Extended Advertising Data */
size_t bluetooth_extended_data(enum bluetooth_set set, const uint8_t *data, size_t length,
                               uint8_t *out)
{
    out[0] = (uint8_t)set;
    out[1] = DATA_COMPLETE; /* fragments are refused while the set is enabled */
    out[2] = DATA_NOT_FRAGMENTED;
    out[3] = (uint8_t)length;
    memcpy(out + 4, data, length);
    return 4 + length;
}

/* 7.8.56 LE Set Extended Advertising Enable */
size_t bluetooth_extended_enable(const bool used[BLUETOOTH_SETS], uint8_t *out)
{
    uint8_t *end = out + 2;

    out[1] = 0; /* how many; with none, "off" means all */
    for (int set = 0; set < BLUETOOTH_SETS; set++) {
        if (used[set]) {
            *end++ = (uint8_t)set;
            end = put16(end, 0); /* no end of time, */
            *end++ = 0;          /* nor of events */
            out[1]++;
        }
    }
    out[0] = out[1] > 0;
    return (size_t)(end - out);
}

/* 7.8.34 LE Write Suggested Default Data Length; 7.8.33 reads it, in the same form */
size_t bluetooth_mark(uint8_t *out)
{
    return (size_t)(put16(put16(out, MARK_OCTETS), MARK_US) - out);
}

bool bluetooth_static_address(const char *boot_id, uint8_t address[6])
{
    const char *node = strrchr(boot_id, '-');
    unsigned long long value;

    if (node == NULL || strspn(node + 1, "0123456789abcdefABCDEF") < 12 ||
        sscanf(node + 1, "%12llx", &value) != 1) {
        return false;
    }
    for (int i = 0; i < 6; i++) {
        address[i] = (uint8_t)(value >> (8 * i));
    }
    address[5] |= BLUETOOTH_STATIC;
    return true;
}
