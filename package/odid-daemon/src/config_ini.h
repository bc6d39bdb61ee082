/* An INI text -> keys and values: the inside of config_parse. */
#ifndef ODID_CONFIG_INI_H
#define ODID_CONFIG_INI_H

#include "config_keys.h"

void config_ini_read(struct config *config, struct config_source *source, const char *text,
                     size_t length);

#endif
