/*
 * A controller's bytes -> H4 -> events -> the adapters' state machine -> commands.
 *
 * The serial port is a socket pair, so that what is written is there at once.
 * An input is records of an operation (low three bits) and what it needs:
 *
 *   0, 1  raw bytes: count, bytes
 *   2     the awaited command is done: status
 *   3     the same with features: status, 8 bytes
 *   4     a command that nobody awaited is done: which, status
 *   5     a legacy payload: filling
 *   6     an extended payload: length, filling
 *   7     the line is cut
 */
#include <signal.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/loop.h"
#include "base/serial.h"
#include "daemon/bluetooth.h"
#include "input.h"
#include "on_air.h"
#include "quiet_log.h"
#include "radio/bluetooth_commands.h"
#include "rounds.h"

#define STEPS_MAX 100 /* of an input: the rest would only be more of the same */

static struct config config;
static struct radio bt4, bt5;
static int line = -1; /* the controller's end */
static uint16_t last; /* command */

/* Instead of serial.c. */
bool serial_baud_valid(unsigned baud)
{
    return baud == 115200;
}

int serial_open(const char *path, unsigned baud, bool flow_control)
{
    int ends[2];

    (void)path;
    MUST(baud == 115200 && !flow_control);
    MUST(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) == 0);
    line = ends[1];
    return ends[0];
}

void serial_close(int fd)
{
    close(fd);
}

/* How long its parameters must be; for extended data, at least. */
static size_t length_of(uint16_t opcode)
{
    switch (opcode) {
    case BLUETOOTH_RESET:
    case BLUETOOTH_READ_FEATURES:
    case BLUETOOTH_READ_MAXIMUM_DATA:
    case BLUETOOTH_READ_DATA_LENGTH:
    case BLUETOOTH_CLEAR_SETS:
        return 0;
    case BLUETOOTH_WRITE_DATA_LENGTH:
        return 4;
    case BLUETOOTH_SET_ADDRESS:
        return 6;
    case BLUETOOTH_SET_PARAMETERS:
        return 15;
    case BLUETOOTH_SET_DATA:
        return 32;
    case BLUETOOTH_SET_ENABLE:
        return 1;
    case BLUETOOTH_SET_EXTENDED_ADDRESS:
        return 7;
    case BLUETOOTH_SET_EXTENDED_PARAMETERS:
        return 25;
    case BLUETOOTH_SET_EXTENDED_PARAMETERS_V2:
        return 27;
    case BLUETOOTH_SET_EXTENDED_DATA:
        return 4;
    case BLUETOOTH_SET_EXTENDED_ENABLE:
        return 2;
    default:
        MUST(false); /* no command of ours */
        return 0;
    }
}

static void judge_command(uint16_t opcode, const uint8_t *parameters, size_t length)
{
    size_t expected = length_of(opcode);

    if (opcode == BLUETOOTH_SET_EXTENDED_DATA) {
        expected += parameters[3];
        MUST(parameters[0] < BLUETOOTH_SETS);
    } else if (opcode == BLUETOOTH_SET_EXTENDED_ENABLE) {
        expected += 4U * parameters[1];
        MUST(parameters[1] <= BLUETOOTH_SETS);
    }
    MUST(length == expected);
    if (opcode == BLUETOOTH_SET_ADDRESS) {
        MUST((parameters[5] & 0xC0) == 0xC0);
    }
}

/* What the daemon sent: whole commands. */
static void take_commands(void)
{
    uint8_t sent[16384];
    ssize_t length = line < 0 ? 0 : recv(line, sent, sizeof(sent), MSG_DONTWAIT);

    for (ssize_t at = 0; at < length; at += 4 + sent[at + 3]) {
        MUST(length - at >= 4 && sent[at] == 0x01 && length - at >= 4 + sent[at + 3]);
        last = (uint16_t)(sent[at + 1] | sent[at + 2] << 8);
        judge_command(last, sent + at + 4, sent[at + 3]);
    }
}

static void say(const uint8_t *bytes, size_t length)
{
    if (line >= 0) {
        (void)!send(line, bytes, length, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    run();
    take_commands();
}

static void complete(uint16_t opcode, uint8_t status, unsigned more)
{
    uint8_t event[7 + 8] = {
        0x04, 0x0E, (uint8_t)(4 + more), 1, (uint8_t)opcode, (uint8_t)(opcode >> 8), status};

    for (unsigned i = 0; i < more; i++) {
        event[7 + i] = byte();
    }
    say(event, 7 + more);
}

static void foreign(void)
{
    static const uint16_t opcodes[] = {0x0C03, 0x2005, 0x2006, 0x2008, 0x200A, 0x2036,
                                       0x2037, 0x2039, 0x203D, 0x0000, 0x2003};
    uint8_t which = byte();

    complete(opcodes[which % (sizeof(opcodes) / sizeof(opcodes[0]))], byte(), 0);
}

static void raw(void)
{
    size_t count = byte();

    count = count < input.left ? count : input.left;
    say(input.at, count);
    input.at += count;
    input.left -= count;
}

static void payload(bool extended)
{
    uint8_t data[MESSAGES_EXTENDED_SIZE];
    size_t length = extended ? byte() % (sizeof(data) + 1) : MESSAGES_LEGACY_SIZE;

    memset(data, byte(), sizeof(data));
    if (extended) {
        bluetooth_set_extended(data, length, loop_now_us());
    } else {
        bluetooth_set_legacy(data, loop_now_us());
    }
    take_commands();
}

static void cut(void)
{
    if (line >= 0) {
        close(line);
        line = -1;
    }
    run();
}

static void judge_radio(const struct radio *radio)
{
    MUST(radio_state_name(radio->state) != NULL);
    MUST(memchr(radio->detail, '\0', sizeof(radio->detail)) != NULL);
    MUST(radio->state != RADIO_ON_AIR || radio->starts > 0);
    MUST(radio->payloads == 0 || radio->accepted_us > 0);
}

static void step(void)
{
    switch (byte() & 7) {
    case 0:
    case 1:
        raw();
        break;
    case 2:
        complete(last, byte(), 0);
        break;
    case 3:
        complete(last, byte(), 8);
        break;
    case 4:
        foreign();
        break;
    case 5:
        payload(false);
        break;
    case 6:
        payload(true);
        break;
    default:
        cut();
        break;
    }
    judge_radio(&bt4);
    judge_radio(&bt5);
}

int LLVMFuzzerInitialize(int *count, char ***arguments)
{
    (void)count;
    (void)arguments;
    MUST(signal(SIGPIPE, SIG_IGN) != SIG_ERR); /* a cut line would be none on a serial port */
    MUST(loop_init() == 0);
    rounds_init();
    config.bt4_enabled = config.bt5_enabled = true;
    strcpy(config.bt_adapter, "h4:/dev/line");
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input.at = data;
    input.left = size;
    bluetooth_start(&config, &bt4, &bt5, loop_now_us());
    take_commands();
    MUST(last == BLUETOOTH_RESET);
    for (unsigned steps = 0; input.left > 0 && steps < STEPS_MAX; steps++) {
        step();
    }
    bluetooth_stop();
    cut();
    return 0;
}
