#include "daemon/frame_numbers.h"

#include <math.h>

#define USED 64.0
#define WINDOW_MIN_US 100000.0
#define WINDOW_MAX_US 5000000.0
#define LOST_MAX 8 /* between two frames, or used for others */
#define PACE_S 10.0

static int64_t window_us(const struct frame_numbers *numbers)
{
    double us = numbers->per_s > 0 ? USED / numbers->per_s * 1e6 : WINDOW_MIN_US;

    return (int64_t)fmin(fmax(us, WINDOW_MIN_US), WINDOW_MAX_US);
}

static void learn_pace(struct frame_numbers *numbers, uint8_t sequence, int64_t now_us)
{
    double step = (uint8_t)(sequence - numbers->last);
    double seconds = fmax((double)(now_us - numbers->last_us), 1) * 1e-6;

    numbers->per_s += (step / seconds - numbers->per_s) * fmin(seconds / PACE_S, 1);
}

/* One that was skipped, and comes behind the next: the way has changed their order. */
static bool is_late(struct frame_numbers *numbers, uint8_t sequence)
{
    uint8_t behind = (uint8_t)(numbers->next_to - sequence);
    bool late = behind >= 1 && behind <= LOST_MAX && (numbers->skipped >> (behind - 1) & 1) != 0;

    if (late) {
        numbers->skipped &= (uint8_t) ~(1U << (behind - 1));
    }
    return late;
}

static void go_on_from(struct frame_numbers *numbers, uint8_t sequence, uint8_t skipped,
                       int64_t now_us)
{
    numbers->next_to = sequence;
    numbers->next_to_us = now_us;
    numbers->skipped = skipped;
    numbers->other = numbers->back = false;
}

bool frame_numbers_follow(struct frame_numbers *numbers, uint8_t sequence, bool again,
                          int64_t now_us)
{
    uint8_t step = (uint8_t)(sequence - numbers->next_to);
    bool next = step > 0 && step <= LOST_MAX, turns;

    if (!numbers->known) {
        numbers->known = true;
        numbers->last = sequence;
        numbers->last_us = now_us;
        go_on_from(numbers, sequence, 0, now_us);
        return false;
    }
    if (now_us - numbers->next_to_us >= window_us(numbers)) { /* they may have come round */
        go_on_from(numbers, sequence, 0, now_us);
        return false;
    }
    if (is_late(numbers, sequence)) {
        return false;
    }
    /* A lap of one source goes forward all the way; where two take turns, one step goes back. */
    numbers->back = numbers->back || (uint8_t)(sequence - numbers->last) > INT8_MAX;
    turns = step == 0 ? !again && (!numbers->other || numbers->back)
                      : next && numbers->other && numbers->back;
    if (next) {
        go_on_from(numbers, sequence,
                   (uint8_t)(numbers->skipped << step | ((1U << (step - 1)) - 1)), now_us);
    } else {
        numbers->other = numbers->other || step != 0;
    }
    return turns;
}

void frame_numbers_pass(struct frame_numbers *numbers, uint8_t sequence, bool paced, int64_t now_us)
{
    if (paced) {
        learn_pace(numbers, sequence, now_us);
    }
    numbers->last = sequence;
    numbers->last_us = now_us;
}
