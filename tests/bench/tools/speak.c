/*
 * speak: sends a few octets to the daemon's port of this machine, where nobody but mavlink-router
 * may speak. Its exit status is 0 where the kernel took them.
 *
 * "speak from USER:GROUP PORT": from that port, at another one of lo's addresses, as that user.
 *
 * "speak packet PORT": by a packet socket at lo, behind what filters what programs send.
 *
 * "speak looped PORT INTERFACE": as the answer to what it sends first, by a broadcast route out of
 * that interface, of which the kernel loops a copy back. Needs a route to 10.9.9.0/24.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <linux/rtnetlink.h>
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

/* For what is sent with that type of service. */
#define TOS 0x10
#define THERE 0x0A090902U /* 10.9.9.2 */

static int add_broadcast_route(int interface)
{
    struct {
        struct nlmsghdr head;
        struct rtmsg route;
        struct {
            struct rtattr head;
            unsigned value;
        } to, out;
    } request = {.head = {.nlmsg_len = sizeof(request),
                          .nlmsg_type = RTM_NEWROUTE,
                          .nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK | NLM_F_CREATE},
                 .route = {.rtm_family = AF_INET,
                           .rtm_dst_len = 32,
                           .rtm_tos = TOS,
                           .rtm_table = RT_TABLE_LOCAL,
                           .rtm_protocol = RTPROT_BOOT,
                           .rtm_scope = RT_SCOPE_LINK,
                           .rtm_type = RTN_BROADCAST},
                 .to = {{8, RTA_DST}, htonl(HERE)},
                 .out = {{8, RTA_OIF}, (unsigned)interface}};
    struct {
        struct nlmsghdr head;
        struct nlmsgerr error;
        char rest[256];
    } answer;
    int fd = socket(AF_NETLINK, SOCK_RAW, NETLINK_ROUTE);

    return send(fd, &request, sizeof(request), 0) < 0 || recv(fd, &answer, sizeof(answer), 0) < 0 ||
           (answer.error.error != 0 && answer.error.error != -EEXIST);
}

/* A socket of an address that isn't ours. */
static int stranger(unsigned address, unsigned short port, int tos)
{
    struct sockaddr_in mine = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(address)};
    int fd = socket(AF_INET, SOCK_DGRAM, 0), on = 1;

    if (setsockopt(fd, SOL_IP, IP_TRANSPARENT, &on, sizeof(on)) < 0 ||
        setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &on, sizeof(on)) < 0 ||
        setsockopt(fd, SOL_IP, IP_TOS, &tos, sizeof(tos)) < 0 ||
        bind(fd, (struct sockaddr *)&mine, sizeof(mine)) < 0) {
        return -1;
    }
    return fd;
}

static int looped(unsigned short port, const char *interface)
{
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(40000), .sin_addr.s_addr = htonl(THERE)};
    char control[CMSG_SPACE(sizeof(struct in_pktinfo))] = {0}, octet = 0;
    struct iovec data = {&octet, 1};
    struct msghdr first = {.msg_name = &to,
                           .msg_namelen = sizeof(to),
                           .msg_iov = &data,
                           .msg_iovlen = 1,
                           .msg_control = control,
                           .msg_controllen = sizeof(control)};
    struct cmsghdr *head = CMSG_FIRSTHDR(&first);
    struct in_pktinfo *info = (struct in_pktinfo *)CMSG_DATA(head);
    int asks = stranger(THERE + 1, port, 0), answers = stranger(THERE, 40000, TOS);

    /* From the daemon's address and port: what comes back is an answer. */
    head->cmsg_level = SOL_IP;
    head->cmsg_type = IP_PKTINFO;
    head->cmsg_len = CMSG_LEN(sizeof(*info));
    info->ipi_spec_dst.s_addr = htonl(HERE);
    if (add_broadcast_route((int)if_nametoindex(interface)) != 0 || asks < 0 || answers < 0 ||
        sendmsg(asks, &first, 0) < 0) {
        perror("speak: looped");
        return 2;
    }
    to.sin_addr.s_addr = htonl(HERE);
    to.sin_port = htons(port);
    return sendto(answers, SAID, sizeof(SAID), 0, (struct sockaddr *)&to, sizeof(to)) < 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "looped") == 0) {
        return looped((unsigned short)atoi(argv[2]), argv[3]);
    }
    if (argc == 4 && strcmp(argv[1], "from") == 0) {
        return from(argv[2], (unsigned short)atoi(argv[3]));
    }
    if (argc == 3 && strcmp(argv[1], "packet") == 0) {
        return packet((unsigned short)atoi(argv[2]));
    }
    fprintf(stderr, "usage: speak from USER:GROUP PORT | packet PORT | looped PORT INTERFACE\n");
    return 2;
}
