/*
 * speak: sends a few octets to the daemon's port of this machine, where nobody but mavlink-router
 * may speak.
 *
 *   speak from USER:GROUP PORT   from that port, at another one of lo's addresses, as that user
 * (numbers) speak packet PORT            by a packet socket at lo, behind what filters what
 * programs send
 *
 * Its exit status is 0 where the kernel took them.
 */
#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define SAID "from a stranger"
#define HERE 0x7F000001U

static int from(const char *who, unsigned short port)
{
    struct sockaddr_in mine = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(HERE + 1)};
    struct sockaddr_in daemon = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(HERE)};
    unsigned user, group;
    int fd;

    if (sscanf(who, "%u:%u", &user, &group) != 2 || setgid(group) < 0 || setuid(user) < 0) {
        perror("speak: user");
        return 2;
    }
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(fd, (struct sockaddr *)&mine, sizeof(mine)) < 0) {
        perror("speak: bind");
        return 2;
    }
    return sendto(fd, SAID, sizeof(SAID), 0, (struct sockaddr *)&daemon, sizeof(daemon)) < 0;
}

static unsigned short checksum(const void *header, size_t length)
{
    const unsigned short *word = header;
    unsigned sum = 0;

    for (size_t i = 0; i < length / 2; i++) {
        sum += word[i];
    }
    sum = (sum >> 16) + (sum & 0xFFFF);
    return (unsigned short)~(sum + (sum >> 16));
}

static int packet(unsigned short port)
{
    struct {
        struct iphdr ip;
        struct udphdr udp;
        char said[sizeof(SAID)];
    } frame = {.ip = {.version = 4,
                      .ihl = 5,
                      .tot_len = htons(sizeof(frame)),
                      .ttl = 64,
                      .protocol = IPPROTO_UDP,
                      .saddr = htonl(HERE),
                      .daddr = htonl(HERE)},
               .udp = {.source = htons(40000),
                       .dest = htons(port),
                       .len = htons(sizeof(frame) - sizeof(frame.ip))},
               .said = SAID};
    struct sockaddr_ll lo = {.sll_family = AF_PACKET,
                             .sll_protocol = htons(ETH_P_IP),
                             .sll_halen = ETH_ALEN,
                             .sll_ifindex = (int)if_nametoindex("lo")};
    int fd = socket(AF_PACKET, SOCK_DGRAM, 0);

    frame.ip.check = checksum(&frame.ip, sizeof(frame.ip));
    return sendto(fd, &frame, sizeof(frame), 0, (struct sockaddr *)&lo, sizeof(lo)) < 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "from") == 0) {
        return from(argv[2], (unsigned short)atoi(argv[3]));
    }
    if (argc == 3 && strcmp(argv[1], "packet") == 0) {
        return packet((unsigned short)atoi(argv[2]));
    }
    fprintf(stderr, "usage: speak from USER:GROUP PORT | packet PORT\n");
    return 2;
}
