#include "base/serial.h"

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <termios.h>
#include <unistd.h>

static const struct {
    unsigned baud;
    speed_t speed;
} speeds[] = {
    {1200, B1200},       {2400, B2400},       {4800, B4800},       {9600, B9600},
    {19200, B19200},     {38400, B38400},     {57600, B57600},     {115200, B115200},
    {230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},
    {921600, B921600},   {1000000, B1000000}, {1152000, B1152000}, {1500000, B1500000},
    {2000000, B2000000}, {2500000, B2500000}, {3000000, B3000000}, {3500000, B3500000},
    {4000000, B4000000},
};

static speed_t find_speed(unsigned baud)
{
    for (size_t i = 0; i < sizeof(speeds) / sizeof(speeds[0]); i++) {
        if (speeds[i].baud == baud) {
            return speeds[i].speed;
        }
    }
    return B0;
}

bool serial_baud_valid(unsigned baud)
{
    return find_speed(baud) != B0;
}

static int make_raw(int fd, speed_t speed, bool flow_control)
{
    struct termios termios;

    if (tcgetattr(fd, &termios) < 0) {
        return -errno;
    }
    cfmakeraw(&termios);
    termios.c_cflag |= CLOCAL | CREAD;
    termios.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
    if (flow_control) {
        termios.c_cflag |= CRTSCTS;
    }
    termios.c_cc[VMIN] = 1; /* so that 0 bytes mean a hang-up, and only that */
    termios.c_cc[VTIME] = 0;
    if (cfsetspeed(&termios, speed) < 0 || tcsetattr(fd, TCSANOW, &termios) < 0) {
        return -errno;
    }
    return 0;
}

int serial_open(const char *path, unsigned baud, bool flow_control)
{
    speed_t speed = find_speed(baud);
    int fd, result;

    if (speed == B0) {
        return -EINVAL;
    }
    fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return -errno;
    }
    result = make_raw(fd, speed, flow_control);
    if (result < 0) {
        close(fd);
        return result;
    }
    return fd;
}

void serial_close(int fd)
{
    tcflush(fd, TCOFLUSH);
    close(fd);
}
