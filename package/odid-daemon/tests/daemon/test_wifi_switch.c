/* Wi-Fi's radio is switched off, and hostapd knows nothing of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "simulated_time.h"

#include <linux/rfkill.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/whole_file.h"
#include "daemon/wifi_beacon.h"
#include "fake_hostapd.h"
#include "loop_until.h"
#include "own_mounts.h"
#include "radio/rfkill.h"

#define NET "/sys/class/net"

static int kernel = -1; /* its end of /dev/rfkill */
static struct fake_hostapd fake;
static struct config config;
static struct radio radio;
static struct loop_timer slot;

int open(const char *path, int flags, ...)
{
    int ends[2];
    va_list rest;
    mode_t mode;

    if (strcmp(path, "/dev/rfkill") == 0) {
        if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends) < 0) {
            return -1;
        }
        kernel = ends[0];
        return ends[1];
    }
    va_start(rest, flags);
    mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

static void the_kernel_has_it(const char *state, bool blocked)
{
    const struct rfkill_event event = {
        .idx = 0, .type = RFKILL_TYPE_WLAN, .op = RFKILL_OP_ADD, .hard = blocked};

    assert_int_equal(whole_file_replace(NET "/wlan0/operstate", state, strlen(state), 0644), 0);
    assert_int_equal(write(kernel, &event, sizeof(event)), sizeof(event));
}

static void on_slot(void *context, int64_t now_us)
{
    static uint8_t counter;
    const uint8_t element[] = {0xDD, 1, ++counter};

    (void)context;
    wifi_beacon_set(element, sizeof(element), now_us);
    loop_arm(&slot, now_us + 125000);
}

/* It was "on air" with each of hostapd's OKs. */
static void what_is_switched_off_is_blocked_whatever_hostapd_says(void **state)
{
    (void)state;
    if (!own_mounts() || !mount_small_disk(NET, "64k")) {
        skip();
    }
    assert_int_equal(mkdir(NET "/wlan0", 0755), 0);
    the_kernel_has_it("up\n", false);
    wifi_beacon_start(&config, &radio, loop_now_us());
    loop_timer_init(&slot, on_slot, NULL);
    loop_arm(&slot, loop_now_us());
    run_ms(3000);
    assert_int_equal(radio.state, RADIO_ON_AIR);
    the_kernel_has_it("down\n", true);
    run_ms(3000);
    for (unsigned i = 0; i < 100; i++) {
        run_ms(125);
        assert_int_equal(radio.state, RADIO_BLOCKED);
    }
    the_kernel_has_it("up\n", false);
    run_ms(3000);
    assert_int_equal(radio.state, RADIO_ON_AIR);
    loop_arm(&slot, LOOP_NEVER);
    wifi_beacon_stop();
    assert_true(fake_hostapd_end(&fake));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_switched_off_is_blocked_whatever_hostapd_says),
    };

    if (loop_init() < 0) {
        return 1;
    }
    fake_hostapd_start(&fake);
    config.wifi_beacon_enabled = true;
    snprintf(config.wifi_iface, sizeof(config.wifi_iface), "wlan0");
    snprintf(config.hostapd_dir, sizeof(config.hostapd_dir), "%s", fake.directory);
    snprintf(config.run_dir, sizeof(config.run_dir), "%s", fake.directory);
    rfkill_start(loop_now_us());
    return cmocka_run_group_tests(tests, NULL, NULL);
}
