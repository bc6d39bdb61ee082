/*
 * A folder of its own, in which a test program works: what it writes by a relative name is there,
 * and gone with it.
 */
#ifndef ODID_TEST_OWN_FOLDER_H
#define ODID_TEST_OWN_FOLDER_H

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static char own_folder[] = "/tmp/odid-test-XXXXXX";

/* For a group's set-up: 0, or -1 where there is none. */
static int enter_own_folder(void)
{
    return mkdtemp(own_folder) == NULL || chdir(own_folder) < 0 ? -1 : 0;
}

/* A group's tear-down. */
static int leave_own_folder(void **state)
{
    char command[sizeof(own_folder) + 16];

    (void)state;
    snprintf(command, sizeof(command), "rm -rf %s", own_folder);
    return chdir("/") < 0 || system(command) != 0 ? -1 : 0;
}

#endif
