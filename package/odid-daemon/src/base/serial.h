/*
 * Serial ports in raw mode: the autopilot's, and Bluetooth modules on a UART.
 */
#ifndef ODID_SERIAL_H
#define ODID_SERIAL_H

#include <stdbool.h>

/* Is this one of the speeds that Linux names (1200 to 4000000 baud)? */
bool serial_baud_valid(unsigned baud);

/*
 * Opens a terminal device non-blocking, raw, 8N1, with or without hardware
 * flow control. Returns the descriptor, or -errno (ENOTTY: no serial port;
 * EINVAL: no such speed).
 */
int serial_open(const char *path, unsigned baud, bool flow_control);

/* Closes it at once: close() waits 30 s for output that nobody takes, which is thrown away first.
 */
void serial_close(int fd);

#endif
