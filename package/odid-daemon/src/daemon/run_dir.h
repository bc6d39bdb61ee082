/*
 * The daemon's run directory: its sockets, and what it keeps for a restart
 * (kept.h). It belongs to the daemon's own user, so whatever a daemon that was
 * taken over has left there is what the next one finds.
 */
#ifndef ODID_RUN_DIR_H
#define ODID_RUN_DIR_H

#include <stdbool.h>

/*
 * As root, before its rights are given away: makes it where it isn't there, for
 * that user. clean: it is nobody else's, so it gets its mode back, and nothing
 * stays in it but what is kept. Errors aren't any of the broadcast's: what then
 * can't be opened says so.
 */
void run_dir_prepare(const char *path, const char *user, bool clean);

#endif
