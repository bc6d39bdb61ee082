/* Which of several serial ports has the autopilot; on ptys. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <termios.h>
#include <unistd.h>

#include "base/loop.h"
#include "loop_until.h"
#include "mavlink_frames.h"
#include "odidctl/autopilot_find.h"
#include "pty.h"

#define PORTS 3
#define NOBODY (-1)

static struct {
    char path[PORTS][64];
    char *paths[PORTS];
    int master[PORTS];
    pthread_t player;
    bool plays;
} bench;

/* What a port hears in a test; its frame comes every `every_ms`, first after that time. */
static struct script {
    struct frame frame;
    unsigned every_ms; /* 0: silent */
} scripts[PORTS];
static volatile bool over;

/* The kernel waits for a device that doesn't answer: here until the test is over. */
#define ANSWER_MS 20000
static const char *stuck;  /* the path of one that doesn't when it is opened; NULL: none */
static bool slow_to_close; /* none does when it is closed */
static int answer[2];
static volatile bool *waited; /* as long as that; all processes' */

static void wait_for_the_device(void)
{
    struct pollfd waiting = {.fd = answer[0], .events = POLLIN};

    if (poll(&waiting, 1, ANSWER_MS) == 0) {
        *waited = true;
    }
}

/* The C library's. */
int open(const char *path, int flags, ...)
{
    if (stuck != NULL && strcmp(path, stuck) == 0) {
        wait_for_the_device();
    }
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0600);
}

int tcflush(int fd, int queue)
{
    if (slow_to_close) {
        wait_for_the_device();
    }
    return ioctl(fd, TCFLSH, queue);
}

static struct frame heartbeat(uint8_t system, uint8_t component)
{
    mavlink_heartbeat_t content = {.type = MAV_TYPE_FIXED_WING,
                                   .autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA};

    return frame_heartbeat(system, component, &content);
}

static void *play(void *unused)
{
    (void)unused;
    for (unsigned ms = 10; !over; ms += 10) {
        usleep(10000);
        for (unsigned i = 0; i < PORTS; i++) {
            if (scripts[i].every_ms != 0 && ms % scripts[i].every_ms == 0 &&
                write(bench.master[i], scripts[i].frame.bytes, scripts[i].frame.length) < 0) {
                abort();
            }
        }
    }
    return NULL;
}

static int set_up(void **state)
{
    (void)state;
    over = false;
    stuck = NULL;
    slow_to_close = false;
    memset(scripts, 0, sizeof(scripts));
    for (unsigned i = 0; i < PORTS; i++) {
        pty_make_path(bench.path[i], "port");
        bench.paths[i] = bench.path[i];
        bench.master[i] = pty_open(bench.path[i]);
        assert_true(bench.master[i] >= 0);
    }
    return 0;
}

static void begin(void)
{
    assert_int_equal(pthread_create(&bench.player, NULL, play, NULL), 0);
    bench.plays = true;
}

static int tear_down(void **state)
{
    (void)state;
    over = true;
    if (bench.plays) {
        pthread_join(bench.player, NULL);
        bench.plays = false;
    }
    for (unsigned i = 0; i < PORTS; i++) {
        close(bench.master[i]);
        pty_remove_path(bench.path[i]);
    }
    return 0;
}

static int find(unsigned seconds)
{
    return autopilot_find(bench.paths, PORTS, 115200, seconds, NOBODY);
}

static void test_the_one_that_speaks(void **state)
{
    int64_t begun_us = loop_now_us();

    (void)state;
    scripts[2] = (struct script){heartbeat(1, MAV_COMP_ID_AUTOPILOT1), 200};
    begin();
    assert_int_equal(find(5), 2);
    assert_true(in_time(loop_now_us() - begun_us, 1000000, 2000000));
}

static void test_the_first_one_is_waited_for_a_heartbeat_long(void **state)
{
    (void)state;
    /* On a busy machine the player is late as well: there the other one only speaks first. */
    scripts[0] = (struct script){heartbeat(1, MAV_COMP_ID_AUTOPILOT1), time_is_judged() ? 700 : 20};
    scripts[1] = (struct script){heartbeat(7, MAV_COMP_ID_AUTOPILOT1), time_is_judged() ? 100 : 10};
    begin();
    assert_int_equal(find(5), 0);
}

static void test_the_first_one_is_taken_at_once(void **state)
{
    int64_t begun_us = loop_now_us();

    (void)state;
    scripts[0] = (struct script){heartbeat(1, MAV_COMP_ID_AUTOPILOT1), 100};
    begin();
    assert_int_equal(find(5), 0);
    assert_true(in_time(loop_now_us() - begun_us, 0, 600000));
}

static void test_no_autopilot_is_none(void **state)
{
    (void)state;
    scripts[0] = (struct script){heartbeat(255, MAV_COMP_ID_MISSIONPLANNER), 100};
    scripts[1] = (struct script){heartbeat(1, MAV_COMP_ID_AUTOPILOT1), 100};
    scripts[1].frame.bytes[scripts[1].frame.length - 1] ^= 1;
    scripts[2] = (struct script){.frame = {"$GPGGA,,,*00\r\n", 14}, .every_ms = 10};
    begin();
    assert_int_equal(find(2), -ENODEV);
}

static void test_all_are_spoken_to(void **state)
{
    uint8_t octets[64];

    (void)state;
    assert_int_equal(find(1), -ENODEV);
    for (unsigned i = 0; i < PORTS; i++) {
        assert_true(read(bench.master[i], octets, sizeof(octets)) > 12);
        assert_int_equal(octets[0], MAVLINK_STX);
    }
}

/* A device that takes no output would hold close() up for 30 s. A pty can't do that, but says that
 * its output was thrown away: in packet mode, in front of what it still has to be read. */
static void test_what_nobody_takes_is_thrown_away(void **state)
{
    uint8_t said;
    int on = 1;

    (void)state;
    for (unsigned i = 0; i < PORTS; i++) {
        assert_int_equal(ioctl(bench.master[i], TIOCPKT, &on), 0);
    }
    assert_int_equal(find(1), -ENODEV);
    for (unsigned i = 0; i < PORTS; i++) {
        assert_int_equal(read(bench.master[i], &said, 1), 1);
        assert_true((said & TIOCPKT_FLUSHWRITE) != 0);
    }
}

static void test_unplugged_ports_end_it(void **state)
{
    int64_t begun_us = loop_now_us();

    (void)state;
    for (unsigned i = 0; i < PORTS; i++) {
        unlink(bench.path[i]);
    }
    assert_int_equal(find(5), -ENODEV);
    assert_true(in_time(loop_now_us() - begun_us, 0, 1000000));
}

/* One such adapter kept the autopilot from being found for as long as it was plugged in. */
static void test_a_device_that_does_not_answer_holds_nobody_up(void **state)
{
    (void)state;
    assert_int_equal(pipe(answer), 0);
    waited = mmap(NULL, sizeof(*waited), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_ptr_not_equal(waited, MAP_FAILED);
    stuck = bench.path[0];
    slow_to_close = true;
    scripts[2] = (struct script){heartbeat(1, MAV_COMP_ID_AUTOPILOT1), 200};
    begin();
    assert_int_equal(find(10), 2);
    assert_false(*waited);
    assert_int_equal(write(answer[1], "", 1), 1);
    close(answer[0]);
    close(answer[1]);
}

static void test_it_ends_when_nobody_wants_to_know_any_more(void **state)
{
    int64_t begun_us = loop_now_us();
    int ends[2];

    (void)state;
    assert_int_equal(pipe(ends), 0);
    close(ends[0]);
    assert_int_equal(autopilot_find(bench.paths, PORTS, 115200, 0, ends[1]), -EPIPE);
    assert_true(in_time(loop_now_us() - begun_us, 0, 1000000));
    close(ends[1]);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(test_the_one_that_speaks),
        TEST(test_the_first_one_is_waited_for_a_heartbeat_long),
        TEST(test_the_first_one_is_taken_at_once),
        TEST(test_no_autopilot_is_none),
        TEST(test_all_are_spoken_to),
        TEST(test_what_nobody_takes_is_thrown_away),
        TEST(test_unplugged_ports_end_it),
        TEST(test_a_device_that_does_not_answer_holds_nobody_up),
        TEST(test_it_ends_when_nobody_wants_to_know_any_more),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
