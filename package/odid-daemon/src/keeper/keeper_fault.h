/*
 * The appliance's list of faults: one file for each, with one plain sentence
 * for whoever asks odidctl. Ours is "odid-daemon". That directory is made for
 * the first one; without the one that it is in there is no such list, and
 * nothing to do.
 */
#ifndef ODID_KEEPER_FAULT_H
#define ODID_KEEPER_FAULT_H

#define KEEPER_FAULT_NAME "odid-daemon"

/* Replaces the sentence as a whole. Returns 0, or -errno. */
int keeper_fault_say(const char *directory, const char *sentence);
/* Returns 0, also when there was none, or -errno. */
int keeper_fault_over(const char *directory);

#endif
