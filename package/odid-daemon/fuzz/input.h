/* The fuzzer's input, taken byte by byte. */
#ifndef ODID_FUZZ_INPUT_H
#define ODID_FUZZ_INPUT_H

#include <stddef.h>
#include <stdint.h>

static struct {
    const uint8_t *at;
    size_t left;
} input;

/* The next byte; 0 when there is none. */
static inline uint8_t byte(void)
{
    if (input.left == 0) {
        return 0;
    }
    input.left--;
    return *input.at++;
}

#endif
