/*
 * odidctl set and import, ended before each of their system calls, and so after each as well:
 * there is the old file or the new one, never half of one, and what was begun
 * can be done again. And the order of the calls, for what a power cut takes
 * with it is what has not reached the disk.
 */
#include "odidctl_bench.h"

#include <sys/ptrace.h>
#include <sys/syscall.h>

#define CONF "data/odid/odid.conf"

/* ---- a program, call by call ---- */

struct stop {
    bool entry;
    uint64_t number, arguments[3];
    int64_t result;
};

/* Returns false when the program has ended. */
static bool next_stop(pid_t child, struct stop *stop)
{
    struct __ptrace_syscall_info info;
    int status;

    do {
        assert_int_equal(ptrace(PTRACE_SYSCALL, child, 0, 0), 0);
        assert_int_equal(waitpid(child, &status, 0), child);
        if (WIFEXITED(status) || WIFSIGNALED(status)) {
            return false;
        }
    } while (WSTOPSIG(status) != (SIGTRAP | 0x80));
    assert_true(ptrace(PTRACE_GET_SYSCALL_INFO, child, (void *)sizeof(info), &info) > 0);
    stop->entry = info.op == PTRACE_SYSCALL_INFO_ENTRY;
    if (stop->entry) {
        stop->number = info.entry.nr;
        for (int i = 0; i < 3; i++) {
            stop->arguments[i] = info.entry.args[i];
        }
    } else {
        stop->result = info.exit.rval;
    }
    return true;
}

static pid_t start(const char *const words[])
{
    pid_t child = fork();
    int status;

    assert_true(child >= 0);
    if (child == 0) {
        int nowhere = open("/dev/null", O_WRONLY);

        setenv("ASAN_OPTIONS", "detect_leaks=0", 1); /* it can't be traced itself */
        dup2(nowhere, STDOUT_FILENO);
        dup2(nowhere, STDERR_FILENO);
        if (ptrace(PTRACE_TRACEME, 0, 0, 0) == 0) {
            execv(odidctl, (char *const *)words);
        }
        _exit(99);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    if (WIFEXITED(status)) {
        print_message("skipped: tracing is not allowed here\n");
        skip();
    }
    assert_int_equal(ptrace(PTRACE_SETOPTIONS, child, 0, PTRACE_O_TRACESYSGOOD | PTRACE_O_EXITKILL),
                     0);
    return child;
}

static void kill_it(pid_t child)
{
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
}

/* Calls that change something on a disk, or make sure that it is there. */
static bool is_change(const struct stop *stop)
{
    static const uint64_t calls[] = {
#ifdef SYS_unlink
        SYS_unlink,   SYS_rename,   SYS_mkdir,
#endif
        SYS_unlinkat, SYS_renameat, SYS_renameat2, SYS_mkdirat, SYS_fchmod, SYS_fsync, SYS_pwrite64,
    };

    for (size_t i = 0; i < COUNT(calls); i++) {
        if (stop->number == calls[i]) {
            return true;
        }
    }
    return false;
}

/*
 * Lets it go on to its system call number `last`, counted from the first one
 * that changes something, and ends it before that. Returns false when it ended
 * by itself.
 */
static bool run_to(const char *const words[], unsigned last)
{
    pid_t child = start(words);
    struct stop stop;
    unsigned count = 0;

    while (next_stop(child, &stop)) {
        count += stop.entry && (count > 0 || is_change(&stop));
        if (count > 0 && count - 1 == last) {
            kill_it(child);
            return true;
        }
    }
    return false;
}

/* ---- set ---- */

#define OLD "; kept\n[wifi]\nchannel = 1\n[self_id]\ndescription = old\n"
#define NEW "; kept\n[wifi]\nchannel = 11\n[self_id]\ndescription = old\n"

static const char *const *set_words(void)
{
    static const char *words[] = {NULL, "-root", ".", "set", "wifi.channel", "11", NULL};

    words[0] = odidctl;
    return words;
}

static void set_ended_anywhere(void **state)
{
    unsigned last = 0, old = 0, new = 0;
    bool ended = true;

    (void)state;
    for (; ended; last++) {
        const char *found;

        bench_clear(NULL);
        put(CONF, OLD);
        ended = run_to(set_words(), last);
        found = got(CONF);
        assert_non_null(found);
        old += strcmp(found, OLD) == 0;
        new += strcmp(found, NEW) == 0;
        assert_int_equal(old + new, last + 1);
        assert_true(strcmp(found, OLD) == 0 || old > 0); /* once new, it stays so */
        /* What was left over is in nobody's way. */
        assert_int_equal(CALL("set", "wifi.channel", "11"), 0);
        expect_file(CONF, NEW);
    }
    print_message("ended %u times before the change, %u times after it\n", old, new - 1);
    assert_true(old >= 5 && new >= 4);
}

/* The file that a descriptor is open for. */
static bool is_open_for(pid_t child, uint64_t fd, const char *end)
{
    char link[64], path[PATH_MAX] = "";
    ssize_t length;

    snprintf(link, sizeof(link), "/proc/%d/fd/%d", (int)child, (int)fd);
    length = readlink(link, path, sizeof(path) - 1);
    return length >= (ssize_t)strlen(end) && strcmp(path + length - strlen(end), end) == 0;
}

/* w: the new file is written; f: it is put on the disk; r: it gets its name; d: so does that. */
static void the_order_of_the_calls(void **state)
{
    char order[32] = "";
    struct stop stop;
    pid_t child;

    (void)state;
    put(CONF, OLD);
    child = start(set_words());
    while (next_stop(child, &stop)) {
        uint64_t fd = stop.arguments[0];
        const char *event = "";

        if (!stop.entry) {
            continue;
        }
        if (stop.number == SYS_write && is_open_for(child, fd, "/.odid.conf.new")) {
            event = "w";
        } else if (stop.number == SYS_fsync && is_open_for(child, fd, "/.odid.conf.new")) {
            event = "f";
        } else if (stop.number == SYS_fsync && is_open_for(child, fd, "/data/odid")) {
            event = "d";
#ifdef SYS_rename
        } else if (stop.number == SYS_rename) {
            event = "r";
#endif
        } else if (stop.number == SYS_renameat || stop.number == SYS_renameat2) {
            event = "r";
        } else if (stop.number == SYS_write || stop.number == SYS_pwrite64) {
            assert_false(is_open_for(child, fd, "/odid.conf")); /* never the file itself */
        }
        strncat(order, event, sizeof(order) - strlen(order) - 1);
    }
    assert_string_equal(order, "wfrd");
    expect_file(CONF, NEW);
}

/* ---- import ---- */

#define VOLUME "[wifi]\r\nchannel = 11\r\n[maintenance]\r\npassword = \"correct horse\"\r\n"
#define TAKEN "[wifi]\r\nchannel = 11\r\n[maintenance]\r\n; password: taken over    \r\n"

static const char *const *import_words(void)
{
    static const char *words[] = {NULL, "-root", ".", "import", "volume", NULL};

    words[0] = odidctl;
    return words;
}

static void import_ended_anywhere(void **state)
{
    char key[100], made[32], made_key[100];
    unsigned last = 0;
    bool ended = true;

    (void)state;
    assert_int_equal(CALL("import", "volume"), 0);
    snprintf(made, sizeof(made), "%.31s", got("data/secrets/maintenance.made"));
    snprintf(made_key, sizeof(made_key), "%.99s", got("data/secrets/maintenance.psk"));
    put("volume/odid.conf", VOLUME);
    assert_int_equal(CALL("import", "volume"), 0);
    snprintf(key, sizeof(key), "%.99s", got("data/secrets/maintenance.psk"));
    for (; ended; last++) {
        const char *found;

        bench_clear(NULL);
        put(CONF, OLD);
        put("data/secrets/maintenance.made", made);
        put("data/secrets/maintenance.psk", made_key);
        put("volume/odid.conf", VOLUME);
        ended = run_to(import_words(), last);
        found = got(CONF);
        assert_true(strcmp(found, OLD) == 0 || strcmp(found, TAKEN) == 0);
        /* The password is where it was until its key is kept, and no half of it is ever one. */
        found = got("volume/odid.conf");
        if (strcmp(found, VOLUME) != 0) {
            assert_int_equal(strncmp(found, TAKEN,
                                     strlen("[wifi]\r\nchannel = 11\r\n"
                                            "[maintenance]\r\n;")),
                             0);
            expect_file("data/secrets/maintenance.psk", key);
        }
        found = got("data/secrets/maintenance.psk");
        assert_non_null(found);
        if (strcmp(found, key) != 0) { /* the board's own is in force: then it can be read */
            assert_string_equal(found, made_key);
            expect_file("data/secrets/maintenance.made", made);
        }
        /* The next power-on. */
        assert_int_equal(CALL("import", "volume"), 0);
        expect_file("volume/odid.conf", TAKEN);
        expect_file(CONF, TAKEN);
        expect_file("data/secrets/maintenance.psk", key);
        expect_none("data/secrets/maintenance.made");
        expect_none("volume/maintenance-password.txt");
    }
    print_message("ended %u times\n", last - 1);
    assert_true(last > 20);
}

#define TEST(function) cmocka_unit_test_setup(function, bench_clear)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(set_ended_anywhere),
        TEST(the_order_of_the_calls),
        TEST(import_ended_anywhere),
    };

    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
