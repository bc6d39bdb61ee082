/*
 * A Bluetooth controller's command channel: HCI packets out, HCI events in.
 * Two transports: the kernel's raw HCI socket ("hci0"), and H4 on a serial
 * device or pty ("h4:/dev/ttyX[@baud]", Bluetooth Core Vol 4 Part A). With a
 * baud rate the port is a UART with RTS/CTS flow control, as that part asks
 * for; without one it is a pty or a USB serial port, which has none.
 *
 * Raw socket, not the exclusive user channel: that one refuses a controller
 * that is up. It hears every event, those of foreign commands included.
 */
#ifndef ODID_HCI_H
#define ODID_HCI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/loop.h"

#define HCI_PARAMETERS_MAX 255

/* One event packet: code, and its parameters. */
typedef void hci_event_fn(void *context, uint8_t code, const uint8_t *parameters, size_t length,
                          int64_t now_us);
/* The transport broke (device gone, hang-up, write error): it is closed already. error: -errno. */
typedef void hci_lost_fn(void *context, int error, int64_t now_us);

struct hci {
    struct loop_watch watch;
    struct loop_pause pause;
    bool h4;         /* else kernel */
    int dev_id;      /* kernel: N of hciN */
    bool down_first; /* kernel: hci_open has it put down, then up; cleared when it was seen down */
    hci_event_fn *on_event;
    hci_lost_fn *on_lost;
    void *context;
    size_t filled;           /* H4: bytes of the event being received */
    uint8_t packet[3 + 255]; /* H4: type, event code, length, parameters */
    size_t skip;             /* H4: bytes of a packet that is no event, still to be skipped */
};

/*
 * Opens "hciN" or "h4:...". Returns 0, or -errno: ENODEV, ENOENT not there
 * (yet); ERFKILL blocked; EAGAIN it was down and is asked to power up (or the
 * other way about: down_first): try again soon; EINPROGRESS its driver hasn't set it
 * up; EINVAL the name makes no sense.
 */
int hci_open(struct hci *hci, const char *adapter, hci_event_fn *on_event, hci_lost_fn *on_lost,
             void *context);
/* What an H4 device hasn't taken yet is thrown away; hci_finish waits for that, 50 ms at most. */
void hci_close(struct hci *hci);
void hci_finish(struct hci *hci);
bool hci_is_open(const struct hci *hci);

/* Writes one command packet; never blocks. Returns 0, or -errno. */
int hci_command(struct hci *hci, uint16_t opcode, const uint8_t *parameters, uint8_t length);

/* Checks an adapter's name without opening it: for the configuration. */
bool hci_name_valid(const char *adapter);

#endif
