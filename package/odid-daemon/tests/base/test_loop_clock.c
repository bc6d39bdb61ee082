/* The event loop by the machine's own clock: its timers are the kernel's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/loop.h"
#include "loop_until.h"

static struct loop_timer timer;
static int64_t fired_us;

static void on_punctual(void *context, int64_t now_us)
{
    (void)context;
    fired_us = now_us;
}

static bool has_fired(void)
{
    return fired_us != 0;
}

static void a_timer_never_fires_early(void **state)
{
    (void)state;
    loop_timer_init(&timer, on_punctual, NULL);
    for (int i = 0; i < 20; i++) {
        int64_t deadline_us = loop_now_us() + 1000 + i * 37;

        fired_us = 0;
        loop_arm(&timer, deadline_us);
        assert_true(loop_until(has_fired, 1000));
        assert_true(fired_us >= deadline_us);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_timer_never_fires_early),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
