/* relay: stands in for mavlink-router in the bench, under its name and with its configuration file.
 *
 *     mavlink-routerd [-c FILE] [DEVICE[:BAUD]]
 *
 * One serial endpoint, up to eight UDP endpoints. What comes in by one goes out by all others, one
 * MAVLink frame a datagram. It ends, with 1, when the serial port hangs up or vanishes. Sections
 * and keys it knows: [General] (TcpServerPort has to be 0 or absent, the rest is passed over),
 * [UartEndpoint x] Device, Baud, BlockSrcCompIn; [UdpEndpoint x] Mode, Address, Port,
 * AllowSrcCompIn, BlockSrcCompIn, BlockSrcSysIn, BlockMsgIdIn (32 at most); other keys of
 * endpoints are passed over, other sections are refused.
 *
 * As mavlink-router's version 4 does (src/endpoint.cpp: read_msg, allowed_by_incoming_filters,
 * accept_msg): a frame ends where its length says, also one with flags that nobody knows; it is
 * passed on whole; the filters hold for frames of any message, known or not; an endpoint by which a
 * system's component was heard is sent nothing of that one's any more. By our patches
 * (br2-external/patches/mavlink-router): nothing comes in of a message that isn't known, or with a
 * flag that isn't, nor from anybody but the peer that is configured; of a frame for which the
 * serial port had no room the rest goes out before anything else; where messages are blocked, so
 * are all commands but those that were judged, and a parameter that is a system id. Not as it: what
 * has a target goes out by all endpoints, checksums of known messages aren't looked at, and known
 * are those of the dialect common, there ardupilotmega's. */

#include <arpa/inet.h>
#include <common/mavlink.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#define MAX_UDP 8
#define LISTED 64
#define BUFFER 4096

/* Of what comes in by an endpoint. */
struct filter {
    bool only_listed; /* AllowSrcCompIn is set */
    bool allowed_component[256], blocked_component[256], blocked_system[256];
    int blocked_message[LISTED]; /* 0: none */
    bool lives_here[256][256];   /* systems' components that were heard by it */
};

struct udp {
    char name[64];
    bool server; /* waits for a peer, and answers the last one that spoke */
    char address[64];
    int port;
    int fd;
    struct sockaddr_in peer; /* sin_port 0: none yet */
    struct filter filter;
};

static char device[256];
static int baud = 57600;
static int uart = -1;
static struct filter uart_filter;
static unsigned char rest[MAVLINK_MAX_PACKET_LEN]; /* of a frame: the port had no room */
static size_t rest_length;
static struct udp udps[MAX_UDP];
static int udp_count;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "mavlink-routerd (relay): %s: %s\n", what, why);
    exit(1);
}

/* --- Configuration ---------------------------------------------------------- */

static char *trim(char *text)
{
    text += strspn(text, " \t");
    size_t length = strlen(text);
    while (length > 0 && strchr(" \t\r\n", text[length - 1]))
        text[--length] = '\0';
    return text;
}

static void copy(char *to, size_t size, const char *from)
{
    if ((size_t)snprintf(to, size, "%s", from) >= size)
        die(from, "too long");
}

static int number(const char *text, int min, int max)
{
    char *end;
    long value = strtol(text, &end, 10);
    if (end == text || (*end && *end != ',') || value < min || value > max)
        die(text, "not a number, or out of its range");
    return (int)value;
}

/* A list of numbers, separated by commas. */
static void set_list(bool list[256], const char *text)
{
    while (text != NULL) {
        list[number(text, 0, 255)] = true;
        text = strchr(text, ',');
        text = text != NULL ? text + 1 : NULL;
    }
}

static void set_messages(int list[LISTED], const char *text)
{
    for (int i = 0; text != NULL; i++) {
        if (i == LISTED)
            die(text, "more messages than the relay can block");
        list[i] = number(text, 1, 0xFFFFFF);
        text = strchr(text, ',');
        text = text != NULL ? text + 1 : NULL;
    }
}

enum section { GENERAL, UART, UDP };

static enum section open_section(char *name)
{
    if (strcasecmp(name, "General") == 0)
        return GENERAL;
    if (strncasecmp(name, "UartEndpoint", 12) == 0)
        return UART;
    if (strncasecmp(name, "UdpEndpoint", 11) != 0)
        die(name, "a section that the relay doesn't know");
    if (udp_count == MAX_UDP)
        die(name, "too many UDP endpoints");
    copy(udps[udp_count++].name, sizeof(udps[0].name), trim(name + 11));
    return UDP;
}

static void set_key(enum section section, const char *key, const char *value)
{
    struct udp *udp = udp_count ? &udps[udp_count - 1] : NULL;
    struct filter *filter = section == UART ? &uart_filter : section == UDP ? &udp->filter : NULL;
    if (section == GENERAL && strcasecmp(key, "TcpServerPort") == 0 && number(value, 0, 65535) != 0)
        die("TcpServerPort", "the relay has no TCP server; 0 expected");
    else if (section == UART && strcasecmp(key, "Device") == 0)
        copy(device, sizeof(device), value);
    else if (section == UART && strcasecmp(key, "Baud") == 0)
        baud = number(value, 1, 4000000);
    else if (section == UDP && strcasecmp(key, "AllowSrcCompIn") == 0) {
        filter->only_listed = true;
        set_list(filter->allowed_component, value);
    } else if (filter && strcasecmp(key, "BlockSrcCompIn") == 0)
        set_list(filter->blocked_component, value);
    else if (section == UDP && strcasecmp(key, "BlockSrcSysIn") == 0)
        set_list(filter->blocked_system, value);
    else if (section == UDP && strcasecmp(key, "BlockMsgIdIn") == 0)
        set_messages(filter->blocked_message, value);
    else if (section == UDP && strcasecmp(key, "Mode") == 0) {
        if (strcasecmp(value, "Normal") != 0 && strcasecmp(value, "Server") != 0)
            die(value, "Mode: Normal or Server expected");
        udp->server = strcasecmp(value, "Server") == 0;
    } else if (section == UDP && strcasecmp(key, "Address") == 0)
        copy(udp->address, sizeof(udp->address), value);
    else if (section == UDP && strcasecmp(key, "Port") == 0)
        udp->port = number(value, 1, 65535);
}

static void read_configuration(const char *path)
{
    FILE *file = fopen(path, "re");
    if (!file)
        die(path, strerror(errno));
    enum section section = GENERAL;
    char line[512];
    while (fgets(line, sizeof(line), file)) {
        char *text = trim(line);
        char *equals = strchr(text, '=');
        if (*text == '\0' || *text == '#' || *text == ';')
            continue;
        if (*text == '[' && text[strlen(text) - 1] == ']') {
            text[strlen(text) - 1] = '\0';
            section = open_section(trim(text + 1));
        } else if (equals) {
            *equals = '\0';
            set_key(section, trim(text), trim(equals + 1));
        } else {
            die(text, "neither [section] nor key = value");
        }
    }
    fclose(file);
}

static void set_device(const char *argument)
{
    copy(device, sizeof(device), argument);
    char *colon = strrchr(device, ':'); /* a by-id name may have colons of its own */
    if (colon && colon[1] && strspn(colon + 1, "0123456789") == strlen(colon + 1)) {
        *colon = '\0';
        baud = number(colon + 1, 1, 4000000);
    }
}

/* --- Endpoints -------------------------------------------------------------- */

static speed_t speed_of(int value)
{
    static const struct {
        int baud;
        speed_t speed;
    } speeds[] = {{9600, B9600},       {19200, B19200},     {38400, B38400},
                  {57600, B57600},     {115200, B115200},   {230400, B230400},
                  {460800, B460800},   {500000, B500000},   {921600, B921600},
                  {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000},
                  {3000000, B3000000}, {4000000, B4000000}};
    for (size_t i = 0; i < sizeof(speeds) / sizeof(speeds[0]); i++)
        if (speeds[i].baud == value)
            return speeds[i].speed;
    die(device, "not a baud rate that a serial port has");
    return B0;
}

static void open_uart(void)
{
    struct termios settings;
    uart = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (uart < 0 || tcgetattr(uart, &settings) < 0)
        die(device, strerror(errno));
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&settings, speed_of(baud));
    if (tcsetattr(uart, TCSANOW, &settings) < 0 || tcflush(uart, TCIOFLUSH) < 0)
        die(device, strerror(errno));
}

static void open_udp(struct udp *udp)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)udp->port)};
    if (inet_pton(AF_INET, udp->address, &address.sin_addr) != 1)
        die(udp->name, "Address: an IPv4 address expected");
    if (udp->port == 0)
        die(udp->name, "Port is missing");
    udp->fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (udp->fd < 0)
        die(udp->name, strerror(errno));
    if (!udp->server)
        udp->peer = address;
    else if (bind(udp->fd, (struct sockaddr *)&address, sizeof(address)) < 0)
        die(udp->name, strerror(errno));
}

/* --- Relaying --------------------------------------------------------------- */

static int system_of(const unsigned char *frame)
{
    return frame[0] == 0xFE ? frame[3] : frame[5];
}

static int component_of(const unsigned char *frame)
{
    return frame[0] == 0xFE ? frame[4] : frame[6];
}

static bool is_listed(const int list[LISTED], int message)
{
    for (int i = 0; i < LISTED; i++)
        if (list[i] != 0 && list[i] == message)
            return true;
    return false;
}

static int message_of(const unsigned char *frame)
{
    return frame[0] == 0xFE ? frame[5] : frame[7] | frame[8] << 8 | frame[9] << 16;
}

/* In what isn't, another frame may be found. */
static bool is_understood(const unsigned char *frame)
{
    return mavlink_get_msg_entry((uint32_t)message_of(frame)) != NULL &&
           (frame[0] == 0xFE || (frame[2] & ~MAVLINK_IFLAG_SIGNED) == 0);
}

/* Commands, by their numbers from the first to the second one of each pair. */
static const uint16_t judged_commands[][2] = {
    {16, 25},       {30, 36},       {80, 85},       {92, 95},       {112, 115},     {159, 159},
    {176, 198},     {200, 217},     {220, 224},     {240, 241},     {243, 243},     {246, 246},
    {252, 252},     {260, 260},     {262, 262},     {300, 300},     {310, 311},     {400, 401},
    {405, 406},     {410, 410},     {500, 500},     {510, 512},     {519, 522},     {525, 534},
    {600, 601},     {1000, 1001},   {2000, 2005},   {2010, 2010},   {2500, 2505},   {2510, 2511},
    {2520, 2520},   {2600, 2600},   {2800, 2800},   {3000, 3001},   {4000, 4001},   {4501, 4501},
    {5000, 5004},   {5100, 5100},   {5200, 5200},   {5300, 5300},   {10001, 10001}, {10151, 10151},
    {30001, 30002}, {31000, 31014}, {42000, 42003}, {42424, 42429}, {42501, 42503}, {42505, 42505},
    {42600, 42600}, {42650, 42651}, {42700, 42703}, {43000, 43002}, {43005, 43005}};
static bool is_judged(uint16_t command)
{
    for (size_t i = 0; i < sizeof(judged_commands) / sizeof(judged_commands[0]); i++)
        if (command >= judged_commands[i][0] && command <= judged_commands[i][1])
            return true;
    return false;
}
/* By a command, what the blocked messages are blocked for: to take the GNSS receivers away, to fill
 * our port with what is on a CAN bus, to say where the vehicle is. COMMAND_INT has its command
 * where COMMAND_LONG has it; what was cut off is 0. */
static bool is_shut_command(const unsigned char *frame)
{
    const unsigned char *payload = frame + (frame[0] == 0xFE ? 6 : 10);
    mavlink_command_long_t said = {0};
    int message = message_of(frame);
    if (message != MAVLINK_MSG_ID_COMMAND_LONG && message != MAVLINK_MSG_ID_COMMAND_INT)
        return false;
    memcpy(&said, payload, frame[1] < sizeof(said) ? frame[1] : sizeof(said));
    return !is_judged(said.command);
}

/* ArduPilot takes another one at once, and in the air; PX4 at its next start. By the last three all
 * parameters are as at first then. */
static bool is_shut_parameter(const unsigned char *frame)
{
    const unsigned char *payload = frame + (frame[0] == 0xFE ? 6 : 10);
    mavlink_param_set_t said = {0};
    if (message_of(frame) != MAVLINK_MSG_ID_PARAM_SET)
        return false;
    memcpy(&said, payload, frame[1] < sizeof(said) ? frame[1] : sizeof(said));
    static const char *const names[] = {"SYSID_THISMAV", "MAV_SYSID",      "MAV_SYS_ID",
                                        "MAV_COMP_ID",   "FORMAT_VERSION", "SYSID_SW_MREV",
                                        "SYS_AUTOCONFIG"};
    for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
        if (strncasecmp(said.param_id, names[i], sizeof(said.param_id)) == 0)
            return true;
    return false;
}

static bool may_enter(const struct filter *filter, const unsigned char *frame)
{
    if (!is_understood(frame) || is_listed(filter->blocked_message, message_of(frame)))
        return false;
    if (filter->blocked_message[0] != 0 && (is_shut_command(frame) || is_shut_parameter(frame)))
        return false;
    return !(filter->only_listed && !filter->allowed_component[component_of(frame)]) &&
           !filter->blocked_component[component_of(frame)] &&
           !filter->blocked_system[system_of(frame)];
}

static bool lives_there(const struct filter *filter, const unsigned char *frame)
{
    return filter->lives_here[system_of(frame)][component_of(frame)];
}

/* How much of it the port had room for. */
static size_t put(const unsigned char *octets, size_t length)
{
    ssize_t written = write(uart, octets, length);
    if (written < 0 && errno != EAGAIN && errno != EINTR)
        die(device, strerror(errno));
    return written < 0 ? 0 : (size_t)written;
}

static void put_rest(void)
{
    size_t written = put(rest, rest_length);
    rest_length -= written;
    memmove(rest, rest + written, rest_length);
}

/* Whole, or not at all: what comes behind half a frame would be taken for its other half. */
static void to_uart(const unsigned char *frame, size_t length)
{
    size_t written;
    if (rest_length > 0)
        put_rest();
    if (rest_length > 0 || (written = put(frame, length)) == 0)
        return;
    rest_length = length - written;
    memcpy(rest, frame + written, rest_length);
}

/* A full buffer or a peer that isn't there loses the frame, as a radio link would. */
static void pass_on(const struct filter *from, const unsigned char *frame, size_t length)
{
    if (from != &uart_filter && !lives_there(&uart_filter, frame))
        to_uart(frame, length);
    for (int i = 0; i < udp_count; i++)
        if (&udps[i].filter != from && udps[i].peer.sin_port != 0 &&
            !lives_there(&udps[i].filter, frame))
            (void)sendto(udps[i].fd, frame, length, 0, (struct sockaddr *)&udps[i].peer,
                         sizeof(udps[i].peer));
}

/* Length of the frame that begins here; 0 when there is too little of it to know. */
static size_t frame_length(const unsigned char *data, size_t have)
{
    if (have < 3)
        return 0;
    if (data[0] == 0xFE)
        return (size_t)data[1] + 8;
    return (size_t)data[1] + 12 + (data[2] & 1 ? 13 : 0);
}

/* Passes on the whole frames in it; returns how much of it that was. */
static size_t take(struct filter *from, const unsigned char *data, size_t have)
{
    size_t at = 0, length;

    while (at < have) {
        if (data[at] != 0xFE && data[at] != 0xFD) {
            at++;
            continue;
        }
        length = frame_length(data + at, have - at);
        if (length == 0 || length > have - at)
            break;
        if (may_enter(from, data + at)) {
            from->lives_here[system_of(data + at)][component_of(data + at)] = true;
            pass_on(from, data + at, length);
        }
        at += length;
    }
    return at;
}

static void from_uart(void)
{
    static unsigned char buffer[BUFFER];
    static size_t have;
    size_t taken;
    ssize_t got = read(uart, buffer + have, sizeof(buffer) - have);
    if (got < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (got <= 0)
        die(device, got < 0 ? strerror(errno) : "hung up");
    have += (size_t)got;
    taken = take(&uart_filter, buffer, have);
    have -= taken;
    memmove(buffer, buffer + taken, have);
}

static bool is_peer(const struct udp *udp, const struct sockaddr_in *sender)
{
    return sender->sin_addr.s_addr == udp->peer.sin_addr.s_addr &&
           sender->sin_port == udp->peer.sin_port;
}

static void from_udp(struct udp *udp)
{
    unsigned char data[BUFFER];
    struct sockaddr_in sender;
    socklen_t size = sizeof(sender);
    ssize_t got = recvfrom(udp->fd, data, sizeof(data), 0, (struct sockaddr *)&sender, &size);
    if (got <= 0)
        return; /* ECONNREFUSED of an earlier datagram, or nothing after all */
    if (udp->server)
        udp->peer = sender;
    else if (!is_peer(udp, &sender))
        return;
    take(&udp->filter, data, (size_t)got);
}

static void relay(void)
{
    struct pollfd fds[1 + MAX_UDP];
    fds[0] = (struct pollfd){.fd = uart, .events = POLLIN};
    for (int i = 0; i < udp_count; i++)
        fds[1 + i] = (struct pollfd){.fd = udps[i].fd, .events = POLLIN};
    for (;;) {
        fds[0].events = rest_length > 0 ? POLLIN | POLLOUT : POLLIN;
        if (poll(fds, (nfds_t)(1 + udp_count), -1) < 0) {
            if (errno == EINTR)
                continue;
            die("poll", strerror(errno));
        }
        if (fds[0].revents & (POLLHUP | POLLERR | POLLNVAL))
            die(device, "hung up");
        if (fds[0].revents & POLLIN)
            from_uart();
        if (fds[0].revents & POLLOUT)
            put_rest();
        for (int i = 0; i < udp_count; i++)
            if (fds[1 + i].revents)
                from_udp(&udps[i]);
    }
}

int main(int argc, char **argv)
{
    int option;
    while ((option = getopt(argc, argv, "c:")) != -1) {
        if (option != 'c') {
            fprintf(stderr, "usage: mavlink-routerd [-c FILE] [DEVICE[:BAUD]]\n");
            return 2;
        }
        read_configuration(optarg);
    }
    if (optind < argc)
        set_device(argv[optind]);
    if (!*device)
        die("configuration", "no serial device named");
    open_uart();
    for (int i = 0; i < udp_count; i++)
        open_udp(&udps[i]);
    fprintf(stderr, "mavlink-routerd (relay): %s at %d baud, %d UDP endpoints\n", device, baud,
            udp_count);
    relay();
}
