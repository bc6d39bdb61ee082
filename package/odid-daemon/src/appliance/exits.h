/* How odidctl ends: its exit codes. */
#ifndef ODID_EXITS_H
#define ODID_EXITS_H

enum odidctl_exit {
    ODIDCTL_GOOD = 0,
    ODIDCTL_NOT_GOOD = 1,
    ODIDCTL_USAGE = 2,
    ODIDCTL_NO_ANSWER = 3,
    ODIDCTL_HALF_DONE = 4, /* it counts, but something about it could not be done; said */
};

#endif
