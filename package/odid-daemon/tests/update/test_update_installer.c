/* What SWUpdate tells a listener, now and of earlier: which of it is news? */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <network_ipc.h>
#include <progress_ipc.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "loop_until.h"
#include "update/update_installer.h"

static char folder[] = "/tmp/odid-installer-XXXXXX";
static pid_t child; /* 0: none */

/* ---- a SWUpdate ---- */

struct swupdate {
    pid_t pid;
    int orders; /* an octet: it goes on; its end: SWUpdate ends. From it: an octet for each word */
};

static int listen_at(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    snprintf(address.sun_path, sizeof(address.sun_path), "%s", path);
    unlink(path);
    if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof(address)) < 0 || listen(fd, 5) < 0) {
        _exit(1);
    }
    return fd;
}

static void say(int fd, char letter)
{
    ipc_message message = {.magic = IPC_MAGIC, .type = NOTIFY_STREAM};

    message.data.notify.status = letter == 'S'   ? START
                                 : letter == 'I' ? IDLE
                                 : letter == 'G' ? SUCCESS
                                                 : FAILURE;
    message.data.notify.error = letter == 'J' ? 3 : 0;
    strcpy(message.data.notify.msg,
           letter == 'E' ? "ERROR : Error write on socket ctrl"
           : letter == 'C'
               ? "ERROR : Channel get operation failed (7): 'Could not connect to server'"
           : letter == 'J' ? "ERROR : Got malformed JSON: Could not find field 'id'."
           : letter == 'U' ? "ERROR : Cannot read stored update state."
                           : "HASH mismatch");
    if (write(fd, &message, sizeof(message)) != sizeof(message)) {
        _exit(1);
    }
}

/* By the other socket: server or local; a local one's beginning, unattended, attended after such a
 * one, whose word stands on where nothing counts; what anybody can have it say there. */
static void say_progress(int fd, char letter)
{
    struct progress_msg message = {.status = FAILURE,
                                   .source = letter == 's' ? SOURCE_SURICATTA : SOURCE_LOCAL};

    if (letter == 'u' || letter == 'a') {
        message.status = START;
    } else if (letter == 'p') {
        message.status = PROGRESS;
    }
    strcpy(message.info, "unattended");
    message.infolen = letter == 'a' ? 0 : strlen(message.info);

    if (write(fd, &message, sizeof(message)) != sizeof(message)) {
        _exit(1);
    }
}

static void await_order(int orders)
{
    char order;

    if (read(orders, &order, 1) != 1) {
        _exit(0);
    }
}

static void tell_that_all_is_said(int orders)
{
    if (write(orders, "x", 1) != 1) {
        _exit(1);
    }
}

/* history: a letter for each message: Start, Failure, Good, Idle, Error of the socket's,
 * the client's Channel and JSON, Update state that it asked for, (server's, local one's; see
 * say_progress) progress; a word for each time that somebody begins to listen, who is sent away at
 * its end, and dots in it where an order is awaited. */
static void serve(const char *history, int orders, int control, int progress)
{
    ipc_message message;

    for (;;) {
        int fd = accept(control, NULL, NULL), listener = accept(progress, NULL, NULL);

        if (read(fd, &message, sizeof(message)) != sizeof(message)) {
            _exit(1);
        }
        message.type = ACK;
        if (write(fd, &message, sizeof(message)) != sizeof(message)) {
            _exit(1);
        }
        for (; *history != '\0' && *history != ' '; history++) {
            if (*history == '.') {
                await_order(orders);
            } else if (strchr("sluap", *history) != NULL) {
                say_progress(listener, *history);
            } else {
                say(fd, *history);
            }
        }
        history += *history == ' ';
        tell_that_all_is_said(orders);
        await_order(orders);
        close(fd);
        close(listener);
    }
}

static struct swupdate start(const char *history)
{
    struct swupdate one;
    int ends[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    one.orders = ends[1];
    one.pid = child = fork();
    if (one.pid == 0) {
        int control = listen_at(get_ctrl_socket()); /* it is asked for after the other one */

        close(ends[1]);
        serve(history, ends[0], control, listen_at(get_prog_socket()));
    }
    close(ends[0]);
    return one;
}

static void end(struct swupdate one)
{
    int status;

    close(one.orders);
    assert_int_equal(waitpid(one.pid, &status, 0), one.pid);
    child = 0;
    assert_int_equal(status, 0);
}

/* ---- what is told of it ---- */

static struct {
    unsigned begun, ended;
    char why[200];
    enum update_source source;
} told, expected;
static unsigned lost, lost_installing; /* SWUpdate ended: how often in all; in an install */

static void on_begins(int64_t now_us)
{
    (void)now_us;
    told.begun++;
    told.source = UPDATE_SOURCE_UNKNOWN;
}

static void on_source(enum update_source source)
{
    told.source = source;
}

static void on_progress(int percent, int64_t now_us)
{
    (void)percent;
    (void)now_us;
}

static void on_ends(const char *why, int64_t now_us)
{
    (void)now_us;
    told.ended++;
    snprintf(told.why, sizeof(told.why), "%s", why);
}

static void on_lost(bool installing, int64_t now_us)
{
    (void)now_us;
    lost++;
    lost_installing += installing ? 1 : 0;
}

static bool it_was_told(void)
{
    return told.begun == expected.begun && told.ended == expected.ended &&
           strcmp(told.why, expected.why) == 0 && told.source == expected.source;
}

/* This, and no more. */
static void expect_told(unsigned begun, unsigned ended, const char *why)
{
    expected.begun = begun;
    expected.ended = ended;
    snprintf(expected.why, sizeof(expected.why), "%s", why);
    assert_true(loop_until(it_was_told, 1000));
    run_ms(700); /* it connects every 100 ms, and takes what comes within 300 ms for history */
    assert_true(it_was_told());
}

static const struct update_installer_calls calls = {.begins = on_begins,
                                                    .source = on_source,
                                                    .progress = on_progress,
                                                    .ends = on_ends,
                                                    .lost = on_lost};

static void history_is_news_unless_it_was_heard(void **state)
{
    struct swupdate one = start("SFI SFIS");

    (void)state;
    assert_int_equal(loop_init(), 0);
    update_installer_watch(&calls, false);
    expect_told(0, 0, ""); /* whoever watched before us was told */
    assert_int_equal(write(one.orders, "x", 1), 1);
    expect_told(1, 0, ""); /* the same SWUpdate; but an install goes on */
    lost = lost_installing = 0;
    end(one);
    expect_told(1, 1, "SWUpdate ended");
    assert_int_equal(lost, 1);
    assert_int_equal(lost_installing, 1);

    one = start("SEFI SFI");
    expect_told(2, 2, "HASH mismatch"); /* a new one, which refused before we were there */
    assert_int_equal(write(one.orders, "x", 1), 1);
    expect_told(2, 2, "HASH mismatch");
    end(one);

    one = start("SEGI");
    expect_told(3, 3, ""); /* installed, whatever became of an answer to somebody else */
    end(one);
}

/* Also of one that came to nothing at once. */
static void whose_it_was_is_told_before_its_end(void **state)
{
    struct swupdate one;

    (void)state;
    memset(&told, 0, sizeof(told));
    assert_int_equal(loop_init(), 0);
    update_installer_watch(&calls, true);
    one = start("SsFI");
    expected.source = UPDATE_SOURCE_SERVER;
    expect_told(1, 1, "HASH mismatch");
    end(one);
    one = start("SlFI");
    expected.source = UPDATE_SOURCE_OTHER;
    expect_told(2, 2, "HASH mismatch");
    end(one);
    one = start("SFI");
    expected.source = UPDATE_SOURCE_UNKNOWN;
    expect_told(3, 3, "HASH mismatch");
    lost = lost_installing = 0;
    end(one);
    expect_told(3, 3, "HASH mismatch");
    assert_int_equal(lost, 1);
    assert_int_equal(lost_installing, 0);
}

/* A technician was told that the server doesn't answer, for what is wrong with the bundle. */
static void a_complaint_of_the_client_s_is_of_its_server_s_updates(void **state)
{
    struct swupdate one;

    (void)state;
    memset(&told, 0, sizeof(told));
    assert_int_equal(loop_init(), 0);
    update_installer_watch(&calls, true);
    one = start("SlCJUFI");
    expected.source = UPDATE_SOURCE_OTHER;
    expect_told(1, 1, "HASH mismatch");
    end(one);
    one = start("SlGCJUI");
    expect_told(2, 2, "");
    end(one);
    one = start("SsCFI");
    expected.source = UPDATE_SOURCE_SERVER;
    expect_told(3, 3, "ERROR : Channel get operation failed (7): 'Could not connect to server'");
    end(one);
    one = start("SsJFI");
    expect_told(4, 4, "ERROR : Got malformed JSON: Could not find field 'id'.");
    end(one);
}

/* Both sockets have something, the notices first; an end reads the other one too, which has nothing
 * left when its own turn comes. */
static void an_end_that_is_read_before_the_progress_said_after_it(void **state)
{
    struct swupdate one;
    char said;

    (void)state;
    memset(&told, 0, sizeof(told));
    assert_int_equal(loop_init(), 0);
    update_installer_watch(&calls, true);
    one = start("SG.Is");
    expected.source = UPDATE_SOURCE_UNKNOWN;
    expect_told(1, 0, "");
    assert_int_equal(write(one.orders, "x", 1), 1);
    assert_int_equal(read(one.orders, &said, 1), 1);
    expected.source = UPDATE_SOURCE_SERVER;
    expect_told(1, 1, "");
    end(one);
}

static bool it_has_begun(void)
{
    return told.begun > 0;
}

static bool it_was_lost(void)
{
    return lost > 0;
}

/* An IDLE that anybody can have SWUpdate say made a technician's of a stick's older bundle. */
static void nobody_asked_until_the_request_says_otherwise(void **state)
{
    static const struct {
        const char *said;
        bool unattended;
    } cases[] = {{"S", true},   {"Sl", true},  {"Su", true},   {"Sa", false},     {"Sap", false},
                 {"Sup", true}, {"SuI", true}, {"SuIS", true}, {"SuFISa", false}, {"SaFISu", true}};

    (void)state;
    memset(&told, 0, sizeof(told));
    assert_int_equal(loop_init(), 0);
    update_installer_watch(&calls, true);
    for (unsigned i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct swupdate one = start(cases[i].said);
        char said;

        told.begun = lost = 0;
        assert_true(loop_until(it_has_begun, 1000));
        assert_int_equal(read(one.orders, &said, 1), 1); /* whatever of it is read yet */
        assert_int_equal(update_installer_is_unattended(loop_now_us()), cases[i].unattended);
        end(one);
        assert_true(loop_until(it_was_lost, 1000));
        assert_true(update_installer_is_unattended(loop_now_us()));
    }
}

/* ---- ending it ---- */

/* As take_over writes it (overlay/lib/odid/functions), with field 22 of a process' stat. */
static void note(const char *path, pid_t pid, unsigned long long later)
{
    unsigned long long started;
    char stat[64], line[1024], *at;
    FILE *file;

    snprintf(stat, sizeof(stat), "/proc/%d/stat", (int)pid);
    file = fopen(stat, "r");
    assert_non_null(file);
    assert_non_null(fgets(line, sizeof(line), file));
    fclose(file);
    at = strrchr(line, ')');
    assert_int_equal(sscanf(at,
                            ") %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s "
                            "%*s %*s %llu",
                            &started),
                     1);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "%d %llu\n", (int)pid, started + later);
    fclose(file);
}

/* An orphan that a supervisor's new script stands in for: its own process is what counts. */
static void it_is_ended_by_its_number_and_its_start(void **state)
{
    char path[64];
    int status;

    (void)state;
    child = fork();
    if (child == 0) {
        pause();
        _exit(0);
    }
    snprintf(path, sizeof(path), "%s/pid", folder);
    assert_int_equal(update_installer_end(path), -ENOENT);
    note(path, child, 1); /* an earlier one's, whose number this one has by chance */
    assert_int_equal(update_installer_end(path), -ESRCH);
    assert_int_equal(waitpid(child, &status, WNOHANG), 0);
    note(path, child, 0);
    assert_int_equal(update_installer_end(path), 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    child = 0;
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    assert_int_equal(update_installer_end(path), -ESRCH);
    unlink(path);
}

/* ---- all ---- */

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL ? -1 : setenv("TMPDIR", folder, 1);
}

/* After a test that failed: the next one would wait for an answer of what it left. */
static int end_what_is_left(void **state)
{
    (void)state;
    if (child > 0) {
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        child = 0;
    }
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    unlink(get_ctrl_socket());
    unlink(get_prog_socket());
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(history_is_news_unless_it_was_heard, end_what_is_left),
        cmocka_unit_test_teardown(whose_it_was_is_told_before_its_end, end_what_is_left),
        cmocka_unit_test_teardown(a_complaint_of_the_client_s_is_of_its_server_s_updates,
                                  end_what_is_left),
        cmocka_unit_test_teardown(an_end_that_is_read_before_the_progress_said_after_it,
                                  end_what_is_left),
        cmocka_unit_test_teardown(nobody_asked_until_the_request_says_otherwise, end_what_is_left),
        cmocka_unit_test_teardown(it_is_ended_by_its_number_and_its_start, end_what_is_left),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
