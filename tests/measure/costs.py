"""What a process costs, what loads the machine, and what a host's own log would say."""

import json
import shutil
import statistics
import subprocess
import time
from pathlib import Path

HELLO = """#include <stdio.h>
#include <unistd.h>
int main(void)
{
    puts("hello");
    return pause();
}
"""
# Wakes up, and writes twenty lines, as often as a daemon does in some seconds.
WAKES = """#include <fcntl.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>
int main(void)
{
    struct timespec pause = {.tv_nsec = 10000000};
    int null = open("/dev/null", O_WRONLY);
    unsigned long long spent_ns = 0;
    char line[128];
    FILE *schedule;

    for (int i = 0; i < 200; i++) {
        nanosleep(&pause, NULL);
        for (int j = 0; j < 20; j++) {
            if (write(null, line, (size_t)snprintf(line, sizeof(line), "%d %f", i, i * 1.5)) < 0) {
                return 1;
            }
        }
    }
    schedule = fopen("/proc/self/schedstat", "r");
    return schedule == NULL || fscanf(schedule, "%llu", &spent_ns) != 1 || printf("%llu", spent_ns / 200) < 0;
}
"""
# Sleeps to the next of its deadlines at the daemon's priority, and does nothing else: says how late 99 of 100 were.
SLEEPS = """#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>
#define EACH_NS 40000000L
#define SECOND_NS 1000000000L
static int by_size(const void *a, const void *b)
{
    return (*(const long *)a > *(const long *)b) - (*(const long *)a < *(const long *)b);
}
int main(int count, char **words)
{
    struct sched_param priority = {.sched_priority = 20};
    struct itimerspec timer = {0};
    struct timespec now;
    int fd = timerfd_create(CLOCK_MONOTONIC, 0);
    int wakes = count == 2 ? (int)(atof(words[1]) * SECOND_NS / EACH_NS) : 0;
    long *late_ns = calloc((size_t)wakes, sizeof(long));
    uint64_t expired;

    if (wakes < 1 || late_ns == NULL) {
        return 1;
    }
    if (sched_setscheduler(0, SCHED_FIFO, &priority) < 0) {
        return printf("refused") < 0;
    }
    clock_gettime(CLOCK_MONOTONIC, &timer.it_value);
    for (int i = 0; i < wakes; i++) {
        timer.it_value.tv_nsec += EACH_NS;
        timer.it_value.tv_sec += timer.it_value.tv_nsec / SECOND_NS;
        timer.it_value.tv_nsec %= SECOND_NS;
        if (timerfd_settime(fd, TFD_TIMER_ABSTIME, &timer, NULL) < 0 || read(fd, &expired, 8) != 8) {
            return 1;
        }
        clock_gettime(CLOCK_MONOTONIC, &now);
        late_ns[i] = (now.tv_sec - timer.it_value.tv_sec) * SECOND_NS + now.tv_nsec - timer.it_value.tv_nsec;
    }
    qsort(late_ns, (size_t)wakes, sizeof(long), by_size);
    return printf("%ld", late_ns[wakes - 1 - wakes / 100]) < 0;
}
"""
LOCATION = 1  # message type, the high nibble of the message's first octet
MESSAGE_AT = 6  # in legacy advertising data: length, type, UUID, application code, counter


def memory_kib(pid):
    """VmRSS and RssAnon."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return {line.split(":")[0]: int(line.split()[1]) for line in lines
            if line.startswith(("VmRSS", "RssAnon"))}


def cpu_ms(pid):
    """CPU time of a single-threaded process so far; the scheduler counts it in nanoseconds."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e6


def compiled(folder, name, text):
    source, program = folder / f"{name}.c", folder / name
    source.write_text(text)
    subprocess.run(["cc", "-O2", "-o", program, source], check=True)
    return program


def wake_up_us(folder):
    """What a wake-up with a little work costs a processor of this machine: the median of several times two seconds."""
    program = compiled(folder, "wakes", WAKES)
    return statistics.median(int(subprocess.run([program], capture_output=True, check=True).stdout) / 1000 for _ in range(5))


class BareTimer:
    """How late a program is that does nothing but wake up beside a run: what no deadline on this machine escapes."""

    def __init__(self, folder):
        self.program, self.process = compiled(folder, "sleeps", SLEEPS), None

    def start(self, seconds):
        self.process = subprocess.Popen([self.program, str(seconds)], stdout=subprocess.PIPE)

    def late_p99_ms(self):
        """None where real-time priority is refused."""
        written = self.process.stdout.read()
        if self.process.wait(timeout=10) != 0:
            raise RuntimeError("the bare timer failed")
        return None if written == b"refused" else int(written) / 1e6

    def stop(self):
        if self.process:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()


def hello_world_kib(folder):
    """The same figures of a C program that does nothing, on this machine."""
    program = compiled(folder, "hello", HELLO)
    with subprocess.Popen([program], stdout=subprocess.PIPE) as process:
        time.sleep(0.3)
        figures = memory_kib(process.pid)
        process.kill()
    return figures


class Load:
    """stress-ng beside the run; without options none."""

    def __init__(self, options, seconds):
        self.process = None
        if options:
            if not shutil.which("stress-ng"):
                raise FileNotFoundError("stress-ng isn't installed: make setup")
            self.process = subprocess.Popen(
                ["stress-ng", *options.split(), "--timeout", str(int(seconds)), "--quiet"],
                stdin=subprocess.DEVNULL)
            time.sleep(1)

    def is_running(self):
        return self.process is None or self.process.poll() is None

    def stop(self):
        if self.process:
            self.process.terminate()
            self.process.wait()


def interval_figures(times_s):
    """As the field study gives them for its own log."""
    gaps_s = [later - earlier for earlier, later in zip(times_s, times_s[1:])]
    if not gaps_s:
        return {}
    return {"host_location_mean_s": statistics.fmean(gaps_s),
            "host_location_sigma_ms": statistics.pstdev(gaps_s) * 1000,
            "host_location_max_s": max(gaps_s)}


def host_locations_s(set_log):
    """When a Location was given to the controller for Bluetooth 4."""
    rows = map(json.loads, Path(set_log).read_text().splitlines())
    return [row["mono"] for row in rows if row["channel"] == "bt4"
            and bytes.fromhex(row["data"])[MESSAGE_AT] >> 4 == LOCATION]
