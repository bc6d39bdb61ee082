#include "mavlink/link_socket.h"

#include <arpa/inet.h>
#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static bool address_of(const struct config *config, struct sockaddr_in *address)
{
    memset(address, 0, sizeof(*address));
    address->sin_family = AF_INET;
    address->sin_port = htons(config->udp_port);
    return inet_pton(AF_INET, config->udp_address, &address->sin_addr) == 1;
}

int link_socket_open(const struct config *config)
{
    struct sockaddr_in address;
    int fd, error;

    if (!address_of(config, &address)) {
        return -EADDRNOTAVAIL;
    }
    fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    if (bind(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        error = errno;
        close(fd);
        return -error;
    }
    return fd;
}

bool link_socket_fits(int fd, const struct config *config)
{
    struct sockaddr_in bound = {0}, wanted;
    socklen_t size = sizeof(bound), type_size = sizeof(int);
    int type = 0;

    return getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &type_size) == 0 && type == SOCK_DGRAM &&
           getsockname(fd, (struct sockaddr *)&bound, &size) == 0 && address_of(config, &wanted) &&
           bound.sin_family == AF_INET && bound.sin_port == wanted.sin_port &&
           bound.sin_addr.s_addr == wanted.sin_addr.s_addr;
}
