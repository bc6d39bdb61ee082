#include "odidctl/authorized_keys.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define LINE_MAX_BYTES 4000 /* dropbear's own limit is 4200 */

static const char *const types[] = {
    "ssh-ed25519",
    "ssh-rsa",
    "ecdsa-sha2-nistp256",
    "ecdsa-sha2-nistp384",
    "ecdsa-sha2-nistp521",
    "sk-ssh-ed25519@openssh.com",
    "sk-ecdsa-sha2-nistp256@openssh.com",
};

static bool is_type(const char *word, size_t length)
{
    for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
        if (strlen(types[i]) == length && memcmp(types[i], word, length) == 0) {
            return true;
        }
    }
    return false;
}

/* A base64 digit's value; -1: it is none. */
static int digit(char c)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = c == '\0' ? NULL : strchr(digits, c);

    return at == NULL ? -1 : (int)(at - digits);
}

/* Decodes base64 with its padding. Returns the number of bytes; 0: it is none. */
static size_t decode(const char *text, size_t length, uint8_t *out)
{
    size_t filled = 0, padding = 0;
    uint32_t bits = 0;

    while (padding < 2 && padding < length && text[length - 1 - padding] == '=') {
        padding++;
    }
    if (length % 4 != 0) {
        return 0;
    }
    for (size_t i = 0; i < length; i++) {
        int value = i < length - padding ? digit(text[i]) : 0;

        if (value < 0) {
            return 0;
        }
        bits = bits << 6 | (uint32_t)value;
        if (i % 4 == 3) {
            out[filled++] = (uint8_t)(bits >> 16);
            out[filled++] = (uint8_t)(bits >> 8);
            out[filled++] = (uint8_t)bits;
        }
    }
    return filled - padding;
}

static uint32_t number_at(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

/* A key is a row of fields, each behind its length; the first one is the type again. */
static bool is_blob(const uint8_t *blob, size_t size, const char *type, size_t type_length)
{
    size_t at = 0, fields = 0;

    while (size - at >= 4 && number_at(blob + at) <= size - at - 4) {
        uint32_t length = number_at(blob + at);

        if (fields++ == 0 && (length != type_length || memcmp(blob + 4, type, length) != 0)) {
            return false;
        }
        at += 4 + length;
    }
    return at == size && fields >= 2;
}

/* NULL: nothing is wrong with it. */
static const char *judge_key(const char *line, size_t length)
{
    uint8_t blob[LINE_MAX_BYTES];
    size_t type = strcspn(line, " \t"), blanks, base64, size;

    if (length > LINE_MAX_BYTES) {
        return "is longer than a key can be";
    }
    if (strstr(line, "PRIVATE KEY") != NULL || strstr(line, "PuTTY-User-Key-File") != NULL) {
        return "is a private key: delete it from here, it belongs to nobody but its owner; "
               "expected "
               "the public one (the .pub file)";
    }
    if (strncmp(line, "----", 4) == 0) {
        return "is a key in another form (RFC 4716 or PEM); expected a line such as \"ssh-ed25519 "
               "AAAA... name\"";
    }
    if (!is_type(line, type)) {
        return "expected the type of a key first, such as ssh-ed25519 or ssh-rsa (options before "
               "it "
               "are not taken)";
    }
    blanks = strspn(line + type, " \t");
    base64 = strcspn(line + type + blanks, " \t");
    size = decode(line + type + blanks, base64, blob);
    if (size == 0) {
        return "the key itself is no base64: was it cut or broken into lines?";
    }
    if (!is_blob(blob, size, line, type)) {
        return "the key itself is damaged or cut, or is of another type than it says";
    }
    return NULL;
}

static size_t line_length(const char *text, const char *end)
{
    size_t length = 0;

    while (text + length < end && text[length] != '\n' && text[length] != '\r') {
        length++;
    }
    return length;
}

struct authorized_keys authorized_keys_read(char *text, size_t *length,
                                            authorized_keys_report_fn *report, void *context)
{
    struct authorized_keys found = {0};
    char *out = text;
    const char *end = text + *length, *next = text;

    if (*length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        next += 3;
    }
    for (unsigned number = 1; next < end; number++) {
        size_t size = line_length(next, end);
        const char *at = next, *problem = NULL;

        next += size;
        if (next < end) {
            next += next[0] == '\r' && next + 1 < end && next[1] == '\n' ? 2 : 1;
        }
        while (size > 0 && (*at == ' ' || *at == '\t')) {
            at++;
            size--;
        }
        /* What is kept moves to the front: never over what is still to be read, for each line end
         * is one byte at least, but for the last line's, where the text has its NUL byte. */
        memmove(out, at, size);
        out[size] = '\0';
        if (memchr(out, '\0', size) != NULL) {
            problem = "holds NUL bytes, as a damaged file does";
        } else if (size > 0 && out[0] == '#') {
            found.comments++;
        } else if (size > 0) {
            problem = judge_key(out, size);
            found.keys += problem == NULL;
        }
        if (problem != NULL) {
            found.errors++;
            report(context, number, problem);
        }
        out[size] = '\n';
        out += size + 1;
    }
    *length = (size_t)(out - text);
    return found;
}
