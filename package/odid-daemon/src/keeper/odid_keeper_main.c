/*
 * odid-keeper: starts the daemon, hears whether it lives, and does what keeper
 * decides. It is what the supervisor runs; as long as it lives, so does the
 * daemon, or a new one.
 */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "appliance/places.h"
#include "base/alive.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/sandbox.h"
#include "keeper/keeper.h"
#include "keeper/keeper_air.h"
#include "keeper/keeper_config.h"
#include "keeper/keeper_fault.h"
#include "keeper/keeper_process.h"
#include "mavlink/link_socket.h"

#define SILENT_S 3.0
#define OFF_AIR_S 5.0
#define PATIENCE_MIN_S 0.1
#define PATIENCE_MAX_S 3600.0

static struct {
    double silent_s, off_air_s;
    const char *faults;
    char *const *command;
    struct keeper keeper;
    struct keeper_process process;
    struct keeper_air_plan plan;
    struct loop_watch signals;
    struct loop_timer timer;
    int link_socket; /* handed down to each daemon; < 0: there is none */
    bool fault_told; /* that the list of faults can't be written */
    bool ready;      /* a daemon was alive: we are watched from then on */
} self = {.silent_s = SILENT_S,
          .off_air_s = OFF_AIR_S,
          .faults = PLACES_FAULTS,
          .signals.fd = -1,
          .link_socket = -1};

/* ---- what is said ---- */

static void check_fault(int result)
{
    if (result < 0 && !self.fault_told) {
        log_warning("can't write to %s (%s): odidctl doesn't show the daemon's faults", self.faults,
                    strerror(-result));
    }
    self.fault_told = result < 0;
}

/* In the log, and in the list of faults until the daemon is alive. That it is off the air is worse
 * than what happens to it afterwards, and stays there. */
__attribute__((format(printf, 1, 2))) static void fault(const char *format, ...)
{
    char sentence[480];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(sentence, sizeof(sentence), format, arguments);
    va_end(arguments);
    log_warning("%s", sentence);
    if (!self.keeper.off_air) {
        check_fault(keeper_fault_say(self.faults, sentence));
    }
}

static void fault_is_over(void)
{
    check_fault(keeper_fault_over(self.faults));
}

/* ---- what keeper decides ---- */

static void advance(int64_t now_us);

static void on_off_air(void *context, const char *off, const char *left, int64_t now_us)
{
    double silent_s = (double)(now_us - self.keeper.on_air_us) * 1e-6;

    (void)context;
    if (left[0] == '\0') {
        fault(
            "The Remote ID daemon gave no sign of life for %.1f s; its last payload was taken off "
            "the air: %s.",
            silent_s, off[0] != '\0' ? off : "no radio is switched on");
    } else {
        fault("The Remote ID daemon gave no sign of life for %.1f s; its last payload may still be "
              "on the air: %s. Taken off: %s.",
              silent_s, left, off[0] != '\0' ? off : "none");
    }
    keeper_is_off_air(&self.keeper, left[0] == '\0', now_us);
    advance(now_us);
}

/* Whoever took the port between two daemons would silence the next one. Each has a socket of its
 * own: one that was taken over may have made the last one deaf, for good. */
static void renew_link_socket(const struct config *config)
{
    if (self.link_socket >= 0) {
        close(self.link_socket);
        self.link_socket = -1;
    }
    if (config->source != MAVLINK_SOURCE_UDP) {
        return;
    }
    self.link_socket = link_socket_open(config);
    if (self.link_socket < 0) {
        log_warning("can't open UDP %s:%u for the daemon (%s): it tries itself",
                    config->udp_address, config->udp_port, strerror(-self.link_socket));
    }
}

static void start_daemon(int64_t now_us)
{
    struct config config;
    int result;

    keeper_config_read(&config, self.command); /* as the daemon does now */
    keeper_air_plan(&self.plan, &config);
    renew_link_socket(&config);
    result =
        keeper_process_start(&self.process, self.command, self.keeper.log_mode, self.link_socket);
    if (result < 0) {
        fault("The Remote ID daemon can't be started: %s.", strerror(-result));
        keeper_died(&self.keeper, 0, 0, now_us);
        return;
    }
    log_info("started %s, process %d%s", self.command[0], (int)self.process.pid,
             self.keeper.log_mode ? ", its system-call filter in log mode" : "");
}

static void kill_it(int64_t now_us)
{
    fault("The Remote ID daemon gave no sign of life for %.1f s, and is killed and started again.",
          (double)(now_us - self.keeper.alive_us) * 1e-6);
    keeper_process_signal(&self.process, SIGKILL);
}

static void advance(int64_t now_us)
{
    enum keeper_action action;

    while ((action = keeper_next(&self.keeper, now_us)) != KEEPER_NOTHING) {
        switch (action) {
        case KEEPER_START:
            start_daemon(now_us);
            break;
        case KEEPER_KILL:
            kill_it(now_us);
            break;
        case KEEPER_TERMINATE:
            keeper_process_signal(&self.process, SIGTERM);
            break;
        case KEEPER_TAKE_OFF_AIR:
            keeper_air_start(&self.plan, on_off_air, NULL, now_us);
            break;
        default:
            loop_stop();
            return;
        }
    }
    loop_arm(&self.timer, keeper_due_us(&self.keeper));
}

/* ---- what happens ---- */

static void on_alive(void *context, int64_t now_us)
{
    double silent_s = (double)(now_us - self.keeper.on_air_us) * 1e-6;
    bool first = self.keeper.on_air_us <= self.keeper.started_us;

    (void)context;
    if (keeper_alive(&self.keeper, now_us)) {
        keeper_air_stop();
        log_info("the daemon is alive again, %.1f s after its last sign of life", silent_s);
    }
    if (!self.ready) {
        self.ready = true;
        alive_start(now_us);
    }
    if (first && self.keeper.on_air_us == now_us) {
        fault_is_over(); /* also an earlier keeper's */
    }
    loop_arm(&self.timer, keeper_due_us(&self.keeper));
}

static void on_death(int signal, int code, int64_t now_us)
{
    bool log_mode = self.keeper.log_mode;
    bool expected = self.keeper.ending || self.keeper.state == KEEPER_KILLED;

    keeper_died(&self.keeper, signal, code, now_us);
    if (expected) {
        log_info("the daemon has ended (%s %d)", signal != 0 ? "signal" : "exit code",
                 signal != 0 ? signal : code);
    } else if (signal != 0) {
        fault("The Remote ID daemon was ended by signal %d (%s), and is started again.", signal,
              strsignal(signal));
    } else {
        fault("The Remote ID daemon ended with exit code %d, and is started again.", code);
    }
    if (self.keeper.log_mode && !log_mode) {
        log_warning("two deaths by the system-call filter: from now on it only logs");
    }
}

static void on_signals(void *context, uint32_t events, int64_t now_us)
{
    struct signalfd_siginfo info;
    int signal, code;

    (void)context;
    (void)events;
    while (read(self.signals.fd, &info, sizeof(info)) == sizeof(info)) {
        if (info.ssi_signo != SIGCHLD) {
            log_info("ending on signal %u", info.ssi_signo);
            keeper_end(&self.keeper, now_us);
        }
    }
    /* One SIGCHLD may stand for several. */
    keeper_process_drain(&self.process, now_us);
    if (keeper_process_ended(&self.process, &signal, &code)) {
        on_death(signal, code, now_us);
    }
    advance(now_us);
}

static void on_due(void *context, int64_t now_us)
{
    (void)context;
    /* Were we late, its bytes wait in the pipe, and it isn't silent at all. */
    keeper_process_drain(&self.process, now_us);
    advance(now_us);
}

/* ---- start ---- */

static int64_t microseconds(double seconds)
{
    return (int64_t)(seconds * 1e6);
}

static int run_keeper(void)
{
    int64_t now_us = loop_now_us();
    int result = loop_init();

    if (result == 0) {
        result = loop_watch_signals(&self.signals, SIGCHLD, on_signals, NULL);
    }
    if (result < 0) {
        log_error("can't start the event loop: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    result = sandbox_realtime();
    if (result < 0) {
        log_warning("no real-time priority for the keeper (%s): it may be late under load",
                    strerror(-result));
    }
    /* Who started us as the daemon's user: one that was taken over gets no hold of us. */
    if (prctl(PR_SET_DUMPABLE, 0) < 0) {
        log_warning("others of this user can look into the keeper: %s", strerror(errno));
    }
    alive_open();
    keeper_init(&self.keeper, microseconds(self.silent_s), microseconds(self.off_air_s), now_us);
    keeper_process_init(&self.process, on_alive, NULL);
    loop_timer_init(&self.timer, on_due, NULL);
    advance(now_us);
    result = loop_run();
    if (result < 0) {
        log_error("the event loop failed: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    fault_is_over(); /* nobody is expected to be alive */
    return EXIT_SUCCESS;
}

static bool read_patience(const char *flag, const char *text, double *seconds)
{
    char *end;
    double value = strtod(text, &end);

    if (end == text || *end != '\0' || !(value >= PATIENCE_MIN_S && value <= PATIENCE_MAX_S)) {
        fprintf(stderr, "odid-keeper: %s \"%s\": a number of seconds from %g to %g is expected\n",
                flag, text, PATIENCE_MIN_S, PATIENCE_MAX_S);
        return false;
    }
    *seconds = value;
    return true;
}

int main(int argc, char *argv[])
{
    enum { FLAG_SILENT = 1, FLAG_OFF_AIR, FLAG_FAULTS, FLAG_VERSION };
    static const struct option flags[] = {
        {"silent-s", required_argument, NULL, FLAG_SILENT},
        {"off-air-s", required_argument, NULL, FLAG_OFF_AIR},
        {"faults", required_argument, NULL, FLAG_FAULTS},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    bool good = true;
    int flag;

    /* "+": what comes behind the first other word is the daemon's. */
    while (good && (flag = getopt_long_only(argc, argv, "+", flags, NULL)) != -1) {
        switch (flag) {
        case FLAG_SILENT:
            good = read_patience("-silent-s", optarg, &self.silent_s);
            break;
        case FLAG_OFF_AIR:
            good = read_patience("-off-air-s", optarg, &self.off_air_s);
            break;
        case FLAG_FAULTS:
            self.faults = optarg;
            break;
        case FLAG_VERSION:
            puts("odid-keeper " ODID_VERSION);
            return EXIT_SUCCESS;
        default:
            good = false; /* getopt said what is wrong */
        }
    }
    if (good && optind == argc) {
        fprintf(stderr, "odid-keeper: say what to start: odid-keeper -- odid-daemon ...; see "
                        "odid-keeper(8)\n");
        good = false;
    }
    self.command = argv + optind;
    return good ? run_keeper() : 2;
}
