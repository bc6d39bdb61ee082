/*
 * A scenario in a process of its own: modules with static state start afresh,
 * and nothing of it is left for the next one. must() is its assertion.
 */
#ifndef ODID_TESTS_OWN_PROCESS_H
#define ODID_TESTS_OWN_PROCESS_H

#include <stdbool.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

#include "loop.h"

#define must(rule)                                                                                 \
    do {                                                                                           \
        if (!(rule)) {                                                                             \
            fprintf(stderr, "%s:%d: broken: %s\n", __FILE__, __LINE__, #rule);                     \
            _exit(1);                                                                              \
        }                                                                                          \
    } while (0)

/* Did the scenario get through? */
static inline bool in_own_process(void (*scenario)(void))
{
    int status;
    pid_t child;

    fflush(NULL);
    child = fork();
    if (child == 0) {
        must(loop_init() == 0);
        scenario();
        _exit(0);
    }
    return child > 0 && waitpid(child, &status, 0) == child && status == 0;
}

#endif
