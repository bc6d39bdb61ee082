/* hci-attach TTY: makes a Bluetooth controller (hciN) of a serial line that speaks H4, for as long
 * as it runs. On the board the device tree does this. */

#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

/* Of the kernel's drivers/bluetooth/hci_uart.h, which it doesn't export. */
#define HCIUARTSETPROTO _IOW('U', 200, int)
#define HCI_UART_H4 0
#define LINE_DISCIPLINE_HCI 15

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
    int discipline = LINE_DISCIPLINE_HCI;
    if (tcsetattr(line, TCSANOW, &settings) < 0 || ioctl(line, TIOCSETD, &discipline) < 0 ||
        ioctl(line, HCIUARTSETPROTO, HCI_UART_H4) < 0) {
        perror(argv[1]);
        return 1;
    }
    for (;;)
        pause();
}
