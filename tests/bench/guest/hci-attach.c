/* hci-attach TTY: makes a Bluetooth controller (hciN) of a serial line that speaks H4, for as long
 * as it runs. On the board the device tree does this.
 *
 * And does it again when the driver has stopped to send. Linux 6.1.176 to 6.1.187, Debian's, cancel
 * at switching off (hci_uart_close) the work that sends, and leave the mark that it is under way
 * (HCI_UART_SENDING): from then on nothing is sent, and no command of the kernel's is ever
 * answered. An answer that comes right then is enough: 1 of 71 starts with Bluetooth blocked showed
 * it. Neither Linux 6.12.107 does that nor hci_serdev, which the board has. */

#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

/* Of the kernel's drivers/bluetooth/hci_uart.h, which it doesn't export. */
#define HCIUARTSETPROTO _IOW('U', 200, int)
#define HCIUARTGETDEVICE _IOR('U', 202, int)
#define HCIUARTSETFLAGS _IOW('U', 203, int)
#define HCI_UART_H4 0
/* A reset when it is switched on, not when it is switched off: no answer right then. btattach asks
 * for the same. */
#define RESET_ON_INIT (1 << 1)
#define LINE_DISCIPLINE_TTY 0
#define LINE_DISCIPLINE_HCI 15

/* Of include/net/bluetooth/hci{,_sock}.h, as in BlueZ's hci.h. */
#define BTPROTO_HCI 1
#define HCIGETDEVINFO _IOR('H', 211, int)
#define BEING_SET_UP (1U << 1)
struct device_info {
    uint16_t device;
    char name[8];
    uint8_t address[6];
    uint32_t flags;
    uint8_t type, features[8];
    uint32_t packet_type, link_policy, link_mode;
    uint16_t acl_mtu, acl_packets, sco_mtu, sco_packets;
    uint32_t errors_rx, errors_tx, commands, events, acl_tx, acl_rx, sco_tx, sco_rx, octets_rx,
        octets_tx;
};

#define LOOK_US 100000
#define SILENT_LOOKS 6 /* the kernel sends the next command of a set-up within milliseconds */

static bool attach(int line)
{
    int discipline = LINE_DISCIPLINE_HCI;
    return ioctl(line, TIOCSETD, &discipline) == 0 &&
           ioctl(line, HCIUARTSETFLAGS, RESET_ON_INIT) == 0 &&
           ioctl(line, HCIUARTSETPROTO, HCI_UART_H4) == 0;
}

/* In the middle of a set-up, and how much was sent of it. */
static bool is_being_set_up(int line, int hci, uint32_t *octets_tx)
{
    struct device_info info = {.device = (uint16_t)ioctl(line, HCIUARTGETDEVICE, 0)};
    if (ioctl(hci, HCIGETDEVINFO, &info) < 0)
        return false;
    *octets_tx = info.octets_tx;
    return info.flags & BEING_SET_UP;
}

static void until_it_stops_to_send(int line, int hci)
{
    uint32_t before = 0, octets = 0;
    for (int silent = 0; silent < SILENT_LOOKS; before = octets) {
        usleep(LOOK_US);
        silent = is_being_set_up(line, hci, &octets) && octets == before ? silent + 1 : 0;
    }
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: hci-attach TTY\n");
        return 2;
    }
    int line = open(argv[1], O_RDWR | O_NOCTTY | O_CLOEXEC);
    struct termios settings;
    if (line < 0 || tcgetattr(line, &settings) < 0) {
        perror(argv[1]);
        return 1;
    }
    cfmakeraw(&settings);
    if (tcsetattr(line, TCSANOW, &settings) < 0 || !attach(line)) {
        perror(argv[1]);
        return 1;
    }
    int hci = socket(AF_BLUETOOTH, SOCK_RAW | SOCK_CLOEXEC, BTPROTO_HCI);
    for (;;) {
        until_it_stops_to_send(line, hci);
        fprintf(stderr, "%s: the driver has stopped to send: attached again\n", argv[1]);
        int discipline = LINE_DISCIPLINE_TTY;
        if (ioctl(line, TIOCSETD, &discipline) < 0 || !attach(line)) {
            perror(argv[1]);
            return 1;
        }
    }
}
