/* odid-web's two halves: the filter of the one that speaks HTTP. (What runs:
 * tests/web/test_api.py.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <sys/syscall.h>

int odid_web_main(int argc, char *argv[]);

#define main odid_web_main
#include "web/odid_web_main.c"
#undef main

static bool is_refused(long number, unsigned long first, unsigned long second)
{
    return syscall(number, first, second, 0UL, 0UL, 0UL) == -1 && errno == EPERM;
}

/* In the filter, and for good: a process of its own. Returns what it got, or 0. */
static int get_out(void)
{
    const unsigned long above = 1UL << 32; /* of what is given the kernel takes 32 bits */
    int signal = 0;

    if (prctl(PR_SET_PDEATHSIG, SIGKILL) < 0 || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) < 0 ||
        enter_http_filter() < 0) {
        return 1;
    }
    for (unsigned long bits = 0; bits <= above; bits += above) {
        if (!is_refused(SYS_prctl, bits + PR_SET_PDEATHSIG, 0)) {
            return 2;
        }
        if (!is_refused(SYS_socket, bits + AF_INET, SOCK_STREAM) ||
            !is_refused(SYS_socket, bits + AF_NETLINK, SOCK_RAW)) {
            return 3;
        }
    }
    if (prctl(PR_GET_PDEATHSIG, &signal) < 0 || signal != SIGKILL) {
        return 4;
    }
    return socket(AF_UNIX, SOCK_STREAM, 0) < 0 ? 5 : 0;
}

static void who_speaks_http_ends_with_root_s_half_and_reaches_no_network(void **state)
{
    int status;
    pid_t child = fork();

    (void)state;
    assert_true(child >= 0);
    if (child == 0) {
        _exit(get_out());
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(who_speaks_http_ends_with_root_s_half_and_reaches_no_network),
    };

    return cmocka_run_group_tests_name("odid-web", tests, NULL, NULL);
}
