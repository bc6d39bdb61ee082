/*
 * Which radios the daemon uses, from its own command line, configuration file
 * and environment. Pure but for reading the file.
 */
#ifndef ODID_KEEPER_CONFIG_H
#define ODID_KEEPER_CONFIG_H

#include "config/config.h"

/*
 * command: the daemon's, ending with NULL; of its flags -config, -no-bt and
 * -no-wifi count. Nothing is reported: the daemon reads the same, and does.
 */
void keeper_config_read(struct config *config, char *const command[]);

#endif
