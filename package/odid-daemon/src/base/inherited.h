/*
 * File descriptors that odid-keeper hands down to the daemon, by their numbers
 * in the environment.
 */
#ifndef ODID_INHERITED_H
#define ODID_INHERITED_H

/*
 * In the child, before exec: that descriptor stays open, and variable says which
 * it is. Returns 0, or -errno.
 */
int inherited_give(const char *variable, int fd);

/*
 * The descriptor that variable names; it is closed on exec from now on, and the
 * variable is gone. Before privileges are dropped. Returns -ENOENT when nothing
 * was handed down, or another -errno when the number is wrong, which is reported.
 */
int inherited_take(const char *variable);

#endif
