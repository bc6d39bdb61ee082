/* fault: does to the appliance what a shell can't. Put into the machine by the tests that need it.
 *
 *     fault hci ADAPTER HEX        a second Bluetooth user: sends one HCI command (opcode as on the
 *                                  wire, length, parameters) through a raw socket
 *     fault is-set-up ADAPTER      exit code 0 when the kernel's own set-up of it is over
 *     fault spin PID               the process goes round in one instruction from now on
 *     fault hog MEGABYTES SECONDS  four processes that spin, and one that takes memory, and again
 *                                  when the kernel has killed it
 *     fault flood SOCKET UID GID PROCESSES SECONDS  so many processes of that user connect to a
 *                                  UNIX socket, again and again; prints how often they could
 *     fault say UID GID ADDRESS PORT HEX COUNT  that user sends so many datagrams there, 10 ms
 *                                  apart; prints how many the kernel took
 *     fault notice UID GID STATUS  that user says something as SWUpdate's notifier does
 *     fault radio-remove ID        takes a mac80211_hwsim radio away
 *     fault radio-create MAC       adds one with this address */

#include <arpa/inet.h>
#include <errno.h>
#include <grp.h>
#include <linux/genetlink.h>
#include <linux/netlink.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static void die(const char *what)
{
    perror(what);
    exit(1);
}

/* --- Bluetooth (BlueZ's headers are not at hand for this compiler) ------------ */

#define BTPROTO_HCI 1
#define HCI_COMMAND 0x01
#define HCI_NO_DEVICE 0xffff

struct sockaddr_hci {
    sa_family_t family;
    uint16_t device;
    uint16_t channel;
};
enum { CHANNEL_RAW = 0, CHANNEL_CONTROL = 3 };

static size_t from_hex(const char *text, unsigned char *out, size_t size)
{
    size_t length = 0;
    unsigned value;
    for (; text[0] && text[1] && length < size; text += 2) {
        if (sscanf(text, "%2x", &value) != 1)
            break;
        out[length++] = (unsigned char)value;
    }
    if (*text) {
        fprintf(stderr, "%s: hexadecimal octets expected\n", text);
        exit(2);
    }
    return length;
}

static int hci_socket(uint16_t device, uint16_t channel)
{
    struct sockaddr_hci address = {AF_BLUETOOTH, device, channel};
    int one = socket(AF_BLUETOOTH, SOCK_RAW, BTPROTO_HCI);
    if (one < 0 || bind(one, (struct sockaddr *)&address, sizeof(address)) < 0)
        die("hci");
    return one;
}

static void hci(int adapter, const char *hex)
{
    unsigned char packet[260] = {HCI_COMMAND};
    size_t length = 1 + from_hex(hex, packet + 1, sizeof(packet) - 1);
    int raw = hci_socket((uint16_t)adapter, CHANNEL_RAW);
    if (write(raw, packet, length) != (ssize_t)length)
        die("hci: write");
}

/* The management interface lists a controller from then on. */
static int is_set_up(int adapter)
{
    enum { READ_INDEX_LIST = 3, COMMAND_COMPLETE = 1 };
    const uint16_t question[3] = {READ_INDEX_LIST, HCI_NO_DEVICE, 0};
    struct __attribute__((packed)) {
        uint16_t event, device, length, command;
        uint8_t status;
        uint16_t count, adapters[64];
    } answer = {0};
    int control = hci_socket(HCI_NO_DEVICE, CHANNEL_CONTROL);
    if (write(control, question, sizeof(question)) != sizeof(question))
        die("hci: management");
    do { /* other people's events come there as well */
        if (read(control, &answer, sizeof(answer)) < 0)
            die("hci: management");
    } while (answer.event != COMMAND_COMPLETE || answer.command != READ_INDEX_LIST);
    for (int i = 0; i < answer.count && i < 64; i++)
        if (answer.adapters[i] == adapter)
            return 1;
    return 0;
}

/* --- processes -------------------------------------------------------------- */

static void spin(pid_t pid)
{
    const long branch_to_itself = 0x1400000014000000; /* twice: a word is two instructions */
    struct {
        uint64_t x[31], sp, pc, pstate;
    } registers;
    struct iovec area = {&registers, sizeof(registers)};
    if (ptrace(PTRACE_ATTACH, pid, 0, 0) < 0 || waitpid(pid, NULL, 0) < 0 ||
        ptrace(PTRACE_GETREGSET, pid, 1 /* NT_PRSTATUS */, &area) < 0 ||
        ptrace(PTRACE_POKETEXT, pid, registers.pc & ~7UL, branch_to_itself) < 0 ||
        ptrace(PTRACE_DETACH, pid, 0, 0) < 0)
        die("spin");
}

static void take_memory(size_t megabytes)
{
    FILE *score = fopen("/proc/self/oom_score_adj", "w");
    if (!score || fputs("0", score) < 0 || fclose(score) != 0)
        die("oom_score_adj");
    if (nice(-10) == -1) /* else the spinners keep it from memory's end */
        die("nice");
    for (size_t i = 0; i < megabytes; i++) {
        char *memory = malloc(1 << 20);
        if (!memory)
            break;
        memset(memory, (int)i + 1, 1 << 20);
    }
    for (;;)
        pause();
}

static time_t monotonic_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec;
}

static void hog(size_t megabytes, unsigned seconds)
{
    pid_t spinners[4], eater = 0;
    for (int i = 0; i < 4; i++)
        if ((spinners[i] = fork()) == 0)
            for (;;)
                ;
    for (time_t end = monotonic_s() + seconds; monotonic_s() < end; usleep(100000)) {
        if (eater > 0 && waitpid(eater, NULL, WNOHANG) == eater)
            eater = 0;
        if (eater == 0 && (eater = fork()) == 0)
            take_memory(megabytes);
    }
    for (int i = 0; i < 4; i++)
        kill(spinners[i], SIGKILL);
    if (eater > 0)
        kill(eater, SIGKILL);
    while (wait(NULL) > 0)
        ;
}

/* --- a flood of connections ------------------------------------------------------ */

static void become(uid_t uid, gid_t gid)
{
    if (setgroups(0, NULL) < 0 || setgid(gid) < 0 || setuid(uid) < 0)
        die("another user");
}

static void connect_again_and_again(const char *path, uid_t uid, gid_t gid, unsigned seconds,
                                    unsigned *connected)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strncpy(address.sun_path, path, sizeof(address.sun_path) - 1);
    become(uid, gid);
    for (time_t end = monotonic_s() + seconds; monotonic_s() < end;) {
        int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
        if (fd >= 0 && connect(fd, (struct sockaddr *)&address, sizeof(address)) == 0)
            __atomic_fetch_add(connected, 1, __ATOMIC_RELAXED);
        close(fd);
    }
    exit(0);
}

static void flood(const char *path, uid_t uid, gid_t gid, unsigned processes, unsigned seconds)
{
    unsigned *connected =
        mmap(NULL, sizeof(*connected), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    for (unsigned i = 0; i < processes; i++)
        if (fork() == 0)
            connect_again_and_again(path, uid, gid, seconds, connected);
    while (wait(NULL) > 0)
        ;
    printf("%u\n", *connected);
}

/* --- datagrams of a local process ------------------------------------------------- */

static void say(uid_t uid, gid_t gid, const char *address, uint16_t port, const char *hex,
                unsigned count)
{
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = inet_addr(address)};
    unsigned char octets[1024];
    size_t length = 0;
    unsigned taken = 0;
    int fd;

    become(uid, gid);
    fd = socket(AF_INET, SOCK_DGRAM, 0); /* whose a socket is, it keeps from its making */
    while (length < sizeof(octets) && sscanf(hex + 2 * length, "%2hhx", &octets[length]) == 1)
        length++;
    for (unsigned i = 0; i < count; i++) {
        taken +=
            sendto(fd, octets, length, 0, (struct sockaddr *)&to, sizeof(to)) == (ssize_t)length;
        usleep(10000);
    }
    printf("%u\n", taken);
}

/* --- SWUpdate's notifier (its struct is in no header) ------------------------------ */

static void notice(uid_t uid, gid_t gid, int status)
{
    struct {
        int status, error, level;
        char text[2048];
    } message = {.status = status};
    static const char name[] = "NotifyServer"; /* behind a zero: a name without a file */
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_DGRAM, 0);

    become(uid, gid);
    memcpy(to.sun_path + 1, name, sizeof(name) - 1);
    /* All of the address is its name. */
    if (sendto(fd, &message, sizeof(message), 0, (struct sockaddr *)&to, sizeof(to)) < 0)
        die(name);
}

/* --- mac80211_hwsim's netlink interface (its header isn't exported) ------------ */

enum { NEW_RADIO = 4, DELETE_RADIO = 5 };
enum { ATTRIBUTE_RADIO_ID = 10, ATTRIBUTE_PERMANENT_ADDRESS = 22 };

struct message {
    struct nlmsghdr header;
    struct genlmsghdr generic;
    char attributes[128];
};

static void add(struct message *message, uint16_t type, const void *value, size_t length)
{
    struct nlattr *attribute = (void *)((char *)message + NLMSG_ALIGN(message->header.nlmsg_len));
    attribute->nla_type = type;
    attribute->nla_len = (uint16_t)(NLA_HDRLEN + length);
    memcpy((char *)attribute + NLA_HDRLEN, value, length);
    message->header.nlmsg_len =
        NLMSG_ALIGN(message->header.nlmsg_len) + NLA_ALIGN(attribute->nla_len);
}

/* Asks, and returns the answer's length; a refusal ends the program (a radio's number is none). */
static ssize_t ask(int netlink, struct message *message, char *answer, size_t size)
{
    if (send(netlink, message, message->header.nlmsg_len, 0) < 0)
        die("netlink");
    ssize_t length = recv(netlink, answer, size, 0);
    if (length < (ssize_t)sizeof(struct nlmsghdr))
        die("netlink: answer");
    struct nlmsghdr *header = (void *)answer;
    if (header->nlmsg_type == NLMSG_ERROR) {
        int error = -((struct nlmsgerr *)NLMSG_DATA(header))->error;
        if (error > 0) {
            errno = error;
            die("hwsim");
        }
    }
    return length;
}

static uint16_t family_of(int netlink, const char *name)
{
    struct message message = {.header = {.nlmsg_len = NLMSG_LENGTH(GENL_HDRLEN),
                                         .nlmsg_type = GENL_ID_CTRL,
                                         .nlmsg_flags = NLM_F_REQUEST},
                              .generic = {.cmd = CTRL_CMD_GETFAMILY, .version = 1}};
    char answer[4096];
    add(&message, CTRL_ATTR_FAMILY_NAME, name, strlen(name) + 1);
    ssize_t length = ask(netlink, &message, answer, sizeof(answer));
    for (size_t at = NLMSG_HDRLEN + GENL_HDRLEN; at + NLA_HDRLEN <= (size_t)length;) {
        struct nlattr *attribute = (void *)(answer + at);
        if (attribute->nla_type == CTRL_ATTR_FAMILY_ID)
            return *(uint16_t *)((char *)attribute + NLA_HDRLEN);
        at += NLA_ALIGN(attribute->nla_len);
    }
    fprintf(stderr, "%s: no such netlink family\n", name);
    exit(1);
}

static void radio(uint8_t command, uint16_t attribute, const void *value, size_t length)
{
    char answer[4096];
    int netlink = socket(AF_NETLINK, SOCK_RAW, NETLINK_GENERIC);
    if (netlink < 0)
        die("netlink");
    struct message message = {.header = {.nlmsg_len = NLMSG_LENGTH(GENL_HDRLEN),
                                         .nlmsg_type = family_of(netlink, "MAC80211_HWSIM"),
                                         .nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK},
                              .generic = {.cmd = command, .version = 1}};
    add(&message, attribute, value, length);
    ask(netlink, &message, answer, sizeof(answer));
}

int main(int argc, char **argv)
{
    const char *what = argc > 2 ? argv[1] : "";
    if (strcmp(what, "hci") == 0 && argc == 4) {
        hci(atoi(argv[2]), argv[3]);
    } else if (strcmp(what, "is-set-up") == 0) {
        return is_set_up(atoi(argv[2])) ? 0 : 1;
    } else if (strcmp(what, "spin") == 0) {
        spin(atoi(argv[2]));
    } else if (strcmp(what, "hog") == 0 && argc == 4) {
        hog((size_t)atoi(argv[2]), (unsigned)atoi(argv[3]));
    } else if (strcmp(what, "flood") == 0 && argc == 7) {
        flood(argv[2], (uid_t)atoi(argv[3]), (gid_t)atoi(argv[4]), (unsigned)atoi(argv[5]),
              (unsigned)atoi(argv[6]));
    } else if (strcmp(what, "say") == 0 && argc == 8) {
        say((uid_t)atoi(argv[2]), (gid_t)atoi(argv[3]), argv[4], (uint16_t)atoi(argv[5]), argv[6],
            (unsigned)atoi(argv[7]));
    } else if (strcmp(what, "notice") == 0 && argc == 5) {
        notice((uid_t)atoi(argv[2]), (gid_t)atoi(argv[3]), atoi(argv[4]));
    } else if (strcmp(what, "radio-remove") == 0) {
        uint32_t id = (uint32_t)atoi(argv[2]);
        radio(DELETE_RADIO, ATTRIBUTE_RADIO_ID, &id, sizeof(id));
    } else if (strcmp(what, "radio-create") == 0) {
        unsigned char mac[6];
        if (sscanf(argv[2], "%2hhx:%2hhx:%2hhx:%2hhx:%2hhx:%2hhx", &mac[0], &mac[1], &mac[2],
                   &mac[3], &mac[4], &mac[5]) != 6) {
            fprintf(stderr, "%s: expected an address as 02:00:00:00:00:00\n", argv[2]);
            return 2;
        }
        radio(NEW_RADIO, ATTRIBUTE_PERMANENT_ADDRESS, mac, sizeof(mac));
    } else {
        fprintf(stderr, "usage: at the top of fault.c\n");
        return 2;
    }
    return 0;
}
