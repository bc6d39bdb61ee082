/*
 * The HCI commands of advertising: opcodes and parameters (Bluetooth Core Vol
 * 4 Part E 7.8). Pure. Each builder returns the number of parameter bytes.
 */
#ifndef ODID_BLUETOOTH_COMMANDS_H
#define ODID_BLUETOOTH_COMMANDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum bluetooth_opcode {
    BLUETOOTH_RESET = 0x0C03,
    BLUETOOTH_READ_FEATURES = 0x2003,
    BLUETOOTH_SET_ADDRESS = 0x2005,
    BLUETOOTH_SET_PARAMETERS = 0x2006,
    BLUETOOTH_SET_DATA = 0x2008,
    BLUETOOTH_SET_ENABLE = 0x200A,
    BLUETOOTH_READ_DATA_LENGTH = 0x2023,
    BLUETOOTH_WRITE_DATA_LENGTH = 0x2024,
    BLUETOOTH_SET_EXTENDED_ADDRESS = 0x2035,
    BLUETOOTH_SET_EXTENDED_PARAMETERS = 0x2036,
    BLUETOOTH_SET_EXTENDED_DATA = 0x2037,
    BLUETOOTH_SET_EXTENDED_ENABLE = 0x2039,
    BLUETOOTH_READ_MAXIMUM_DATA = 0x203A,
    BLUETOOTH_CLEAR_SETS = 0x203D,
    BLUETOOTH_SET_EXTENDED_PARAMETERS_V2 = 0x207F,
};

/* Legacy and long range as advertising sets of one controller. */
enum bluetooth_set { BLUETOOTH_LEGACY, BLUETOOTH_LONG_RANGE, BLUETOOTH_SETS };

/* Advertising intervals, in units of 0.625 ms. */
#define BLUETOOTH_INTERVAL_20_MS 0x0020
#define BLUETOOTH_INTERVAL_100_MS 0x00A0
#define BLUETOOTH_INTERVAL_200_MS 0x0140

/* Error codes, Vol 1 Part F. */
#define BLUETOOTH_SUCCESS 0x00
#define BLUETOOTH_UNKNOWN_COMMAND 0x01
#define BLUETOOTH_MEMORY_EXCEEDED 0x07
#define BLUETOOTH_DISALLOWED 0x0C
#define BLUETOOTH_UNSUPPORTED 0x11
#define BLUETOOTH_INVALID_PARAMETERS 0x12
#define BLUETOOTH_PACKET_TOO_LONG 0x45

/* The two top bits of a random static address, Vol 6 Part B 1.3.2.1. */
#define BLUETOOTH_STATIC 0xC0

/* Is this a command that changes what is advertised, or resets the controller? */
bool bluetooth_changes_advertising(uint16_t opcode);

size_t bluetooth_parameters(uint16_t interval, uint8_t *out);
size_t bluetooth_extended_parameters(enum bluetooth_set set, uint16_t interval, uint8_t *out);
/* The same with a choice of the coding: S=8 is required for long range. */
size_t bluetooth_extended_parameters_v2(enum bluetooth_set set, uint16_t interval, uint8_t *out);
size_t bluetooth_extended_address(enum bluetooth_set set, const uint8_t address[6], uint8_t *out);
/* data: at most 31 bytes. */
size_t bluetooth_data(const uint8_t *data, size_t length, uint8_t *out);
/* data: at most 251 bytes, set in one piece. */
size_t bluetooth_extended_data(enum bluetooth_set set, const uint8_t *data, size_t length,
                               uint8_t *out);
/* used[set]: which of the sets are switched on. None used: switches all sets off. */
size_t bluetooth_extended_enable(const bool used[BLUETOOTH_SETS], uint8_t *out);

/*
 * The mark of a controller that wasn't reset since: what a connection would begin
 * with (LE Write Suggested Default Data Length), of which we have none. A reset
 * puts back the controller's own, and nobody else would ask for this one.
 */
#define BLUETOOTH_MARK_SIZE 4
size_t bluetooth_mark(uint8_t *out);

/*
 * A random static address, little-endian: the same from power-on to power-off,
 * also over a restart of the daemon. boot_id: the kernel's
 * /proc/sys/kernel/random/boot_id, a UUID whose last 48 bits are random.
 * Returns false when it is none.
 */
bool bluetooth_static_address(const char *boot_id, uint8_t address[6]);

#endif
