/* The keeper's word of a daemon that can't be started, in a folder that is the daemon's user's as
 * well on a Debian. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "keeper/keeper_fault.h"
#include "own_folder.h"

#define FAULT "faults/" KEEPER_FAULT_NAME

static void expect(const char *sentence)
{
    char text[64] = "";
    int fd = open(FAULT, O_RDONLY | O_CLOEXEC);

    assert_true(fd >= 0);
    assert_true(read(fd, text, sizeof(text) - 1) > 0);
    close(fd);
    assert_string_equal(text, sentence);
}

static void it_is_said_and_over(void **state)
{
    (void)state;
    assert_int_equal(keeper_fault_say("faults", "It does not start."), 0);
    expect("It does not start.\n");
    assert_int_equal(keeper_fault_over("faults"), 0);
    assert_int_equal(access(FAULT, F_OK), -1);
    assert_int_equal(keeper_fault_over("faults"), 0);
}

/* A socket under the name that is written first kept it from being said until power-off. */
static void what_lies_in_its_place_keeps_nothing_from_being_said(void **state)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX, .sun_path = "faults/." KEEPER_FAULT_NAME};
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    (void)state;
    assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof(address)), 0);
    assert_int_equal(keeper_fault_say("faults", "It does not start."), 0);
    expect("It does not start.\n");
    close(fd);
    assert_int_equal(symlink("../others", "faults/." KEEPER_FAULT_NAME), 0);
    assert_int_equal(keeper_fault_say("faults", "It does not start."), 0);
    assert_int_equal(access("others", F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_said_and_over),
        cmocka_unit_test(what_lies_in_its_place_keeps_nothing_from_being_said),
    };

    return enter_own_folder() < 0 || cmocka_run_group_tests(tests, NULL, leave_own_folder);
}
