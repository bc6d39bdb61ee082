/*
 * Octets -> frames, as one datagram and as a stream in portions: what it costs,
 * and that a datagram's frames lie one behind the other.
 *
 * An input is the octets themselves.
 */
#include "mavlink/framing.h"

#include "input.h"
#include "on_air.h"

/* What may be spent on credit, and one frame more. */
#define CREDIT_LOOKS (4096 / 2 + 2 * MAVLINK_MAX_PACKET_LEN)

static size_t in_frames;

static void on_frame(void *context, const mavlink_message_t *message)
{
    const size_t *length = context;
    bool second = message->magic == MAVLINK_STX;

    MUST(message->incompat_flags <= MAVLINK_IFLAG_SIGNED);
    in_frames += (second ? 12 : 8) + (size_t)message->len +
                 (message->incompat_flags ? MAVLINK_SIGNATURE_BLOCK_LEN : 0);
    MUST(in_frames <= *length);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct framing_counters datagram = {0}, stream = {0};
    struct framing framing = {0};

    in_frames = 0;
    framing_datagram(&datagram, data, size, on_frame, &size);
    MUST(datagram.looks <= datagram.octets + 1);

    in_frames = 0;
    for (size_t at = 0, portion = 1; at < size; at += portion, portion = portion % 97 + 3) {
        portion = portion < size - at ? portion : size - at;
        framing_stream(&framing, &stream, data + at, portion, on_frame, &size);
    }
    MUST(stream.looks <= FRAMING_LOOKS_MAX * stream.octets + CREDIT_LOOKS);
    return 0;
}
