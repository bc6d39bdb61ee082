/*
 * Changes in a configuration's text that leave everything else as it is:
 * comments, order, line ends.
 *
 * Pure. Texts are as config_parse takes them, without NUL bytes for
 * config_edit_without_secrets.
 */
#ifndef ODID_CONFIG_EDIT_H
#define ODID_CONFIG_EDIT_H

#include "config/config_keys.h"

/*
 * The text with the key set to value: in the line that counts, or in a new one
 * at the end of its section. Returns it allocated, *new_length set; NULL when
 * no line of a configuration can hold that value (control characters, both
 * kinds of quotes, too long), or without memory (errno ENOMEM).
 */
char *config_edit_set(const char *text, size_t length, const struct config_key *key,
                      const char *value, size_t *new_length);

/*
 * Makes a comment of each line that sets [maintenance] password, in place and
 * of the same length: "password" becomes "; passwo", and so on. password
 * receives the one that counts; empty: none that is valid was set. Returns the
 * number of lines. A line that begins with ";assword" is one whose change was
 * interrupted: it counts, its password doesn't.
 */
unsigned config_edit_take_password(char *text, size_t length,
                                   char password[CONFIG_PASSWORD_MAX + 1]);

/*
 * The text without the secret parts of operator numbers. Returns it allocated,
 * *new_length set; NULL without memory.
 */
char *config_edit_without_secrets(const char *text, size_t length, size_t *new_length);

#endif
