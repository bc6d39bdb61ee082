#include "base/utf8.h"

#include <stdint.h>
#include <string.h>

static bool is_continuation(char c)
{
    return ((unsigned char)c & 0xC0) == 0x80;
}

/* RFC 3629: no overlong forms, no surrogates, nothing above U+10FFFF. */
static bool second_byte_fits(unsigned char first, unsigned char second)
{
    switch (first) {
    case 0xE0:
        return second >= 0xA0;
    case 0xED:
        return second <= 0x9F;
    case 0xF0:
        return second >= 0x90;
    case 0xF4:
        return second <= 0x8F;
    default:
        return true;
    }
}

static size_t announced_length(unsigned char first)
{
    static const struct {
        unsigned char first, last;
        size_t length;
    } leads[] = {{0x01, 0x7F, 1}, {0xC2, 0xDF, 2}, {0xE0, 0xEF, 3}, {0xF0, 0xF4, 4}};

    for (size_t i = 0; i < sizeof(leads) / sizeof(leads[0]); i++) {
        if (first >= leads[i].first && first <= leads[i].last) {
            return leads[i].length;
        }
    }
    return 0;
}

size_t utf8_character(const char *text)
{
    unsigned char first = (unsigned char)text[0];
    size_t length = announced_length(first);

    for (size_t i = 1; i < length; i++) {
        if (!is_continuation(text[i])) { /* the terminator is none either */
            return 0;
        }
    }
    if (length > 1 && !second_byte_fits(first, (unsigned char)text[1])) {
        return 0;
    }
    return length;
}

/* A byte that begins no character stands for itself. */
static size_t step(const char *text)
{
    size_t length = utf8_character(text);

    return length == 0 ? 1 : length;
}

size_t utf8_count(const char *text)
{
    size_t count = 0;

    for (; *text != '\0'; text += step(text)) {
        count++;
    }
    return count;
}

size_t utf8_cut(const char *text, size_t max)
{
    size_t length = 0;

    while (text[length] != '\0' && length + step(text + length) <= max) {
        length += step(text + length);
    }
    return length;
}

/* C0, DEL and C1 controls. */
static bool is_control(const char *text)
{
    unsigned char first = (unsigned char)text[0];

    return first < ' ' || first == 0x7F || (first == 0xC2 && (unsigned char)text[1] < 0xA0);
}

size_t utf8_clean(char *out, size_t size, const char *text)
{
    size_t filled = 0, replaced = 0;

    while (*text != '\0') {
        size_t length = utf8_character(text);
        bool bad = length == 0 || is_control(text);

        if (filled + (bad ? 1 : length) >= size) {
            break;
        }
        if (bad) {
            out[filled++] = '?';
            replaced++;
        } else {
            memcpy(out + filled, text, length);
            filled += length;
        }
        text += step(text);
    }
    out[filled] = '\0';
    return replaced;
}
