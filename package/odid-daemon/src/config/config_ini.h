/* An INI text -> keys and values: the inside of config_parse. */
#ifndef ODID_CONFIG_INI_H
#define ODID_CONFIG_INI_H

#include "config/config_keys.h"

void config_ini_read(struct config *config, struct config_source *source, const char *text,
                     size_t length);

/* How long the first line of a text is, and the line end behind it: LF, CR LF, CR, or none. */
size_t config_ini_line(const char *text, size_t length, size_t *ending);

/* Where in a line "key = value ; comment" the value stands, quotes included: [from, to). */
void config_ini_value(const char *text, size_t length, size_t *from, size_t *to);

#endif
