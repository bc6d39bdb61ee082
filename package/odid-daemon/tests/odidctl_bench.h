/* The program odidctl, from beside the test, on an appliance in a folder of the test's own. */
#ifndef ODID_ODIDCTL_BENCH_H
#define ODID_ODIDCTL_BENCH_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static char odidctl[PATH_MAX], folder[] = "/tmp/odidctl-XXXXXX";
static char said[32768]; /* standard output and error of the last call */

static inline void shell(const char *command)
{
    assert_int_equal(system(command), 0);
}

static inline int bench_make(void **state)
{
    char program[PATH_MAX] = "";

    (void)state;
    if (readlink("/proc/self/exe", program, sizeof(program) - 1) < 0 || mkdtemp(folder) == NULL ||
        chdir(folder) < 0) {
        return -1;
    }
    snprintf(odidctl, sizeof(odidctl), "%.4000s/odidctl", dirname(program));
    return 0;
}

static pid_t answering; /* answer_with's, of a test that failed as well; 0: none */

static inline void end_answering(void)
{
    if (answering > 0) {
        kill(answering, SIGKILL);
        waitpid(answering, NULL, 0);
        answering = 0;
    }
}

static inline int bench_remove(void **state)
{
    char command[64];

    (void)state;
    end_answering();
    snprintf(command, sizeof(command), "rm -rf %s", folder);
    return chdir("/") < 0 || system(command) != 0;
}

/* Before each test: empty folders. */
static inline int bench_clear(void **state)
{
    (void)state;
    end_answering();
    return system("rm -rf data run volume && mkdir -p data/odid data/secrets lib/odid run/faults "
                  "run/odid run/odid-appliance volume");
}

static inline void put_bytes(const char *path, const char *text, size_t length)
{
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);

    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, length), (ssize_t)length);
    close(fd);
}

static inline void put(const char *path, const char *text)
{
    put_bytes(path, text, strlen(text));
}

/* What the daemon keeps: armed is "yes", "no" or "unheard". */
static inline void keep_armed(const char *armed)
{
    char text[80];

    snprintf(text, sizeof(text), "vehicle 7\narmed %s\narmed-once %s\n", armed,
             armed[0] == 'y' ? "yes" : "no");
    put("run/odid/kept", text);
}

/* NULL: there is no such file. The next call overwrites it. */
static inline const char *got(const char *path)
{
    static char text[70000];
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t length;

    if (fd < 0) {
        return NULL;
    }
    length = read(fd, text, sizeof(text) - 1);
    close(fd);
    assert_true(length >= 0);
    text[length] = '\0';
    return text;
}

static inline void expect_file(const char *path, const char *text)
{
    const char *found = got(path);

    assert_non_null(found);
    assert_string_equal(found, text);
}

static inline void expect_none(const char *path)
{
    assert_int_equal(access(path, F_OK), -1);
}

static inline void read_said(int fd)
{
    size_t filled = 0;
    ssize_t length;

    while ((length = read(fd, said + filled, sizeof(said) - 1 - filled)) > 0) {
        filled += (size_t)length;
    }
    said[filled] = '\0';
    close(fd);
}

/* Returns the exit code. Words are ended by NULL. */
static inline int call(const char *const words[])
{
    const char *arguments[32] = {odidctl, "-root", "."};
    size_t count = 3;
    int ends[2], status;
    pid_t child;

    while (*words != NULL) {
        arguments[count++] = *words++;
    }
    assert_int_equal(pipe(ends), 0);
    child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        dup2(ends[1], STDOUT_FILENO);
        dup2(ends[1], STDERR_FILENO);
        close(ends[0]);
        close(ends[1]);
        execv(odidctl, (char **)arguments);
        _exit(99);
    }
    close(ends[1]);
    read_said(ends[0]);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

#define CALL(...) call((const char *const[]){__VA_ARGS__, NULL})

/* A daemon that answers the first question with a status, and each one after it with another, until
 * it is ended. */
static inline pid_t answer_with_then(const char *status, const char *then)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX, .sun_path = "run/odid/status.sock"};
    int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    pid_t child;

    unlink(address.sun_path);
    assert_int_equal(bind(listener, (struct sockaddr *)&address, sizeof(address)), 0);
    assert_int_equal(listen(listener, 4), 0);
    child = fork();
    assert_true(child >= 0);
    while (child == 0) {
        int fd = accept(listener, NULL, NULL);

        if (fd < 0 || write(fd, status, strlen(status)) < 0 || close(fd) < 0) {
            _exit(1);
        }
        status = then;
    }
    close(listener);
    answering = child;
    return child;
}

/* To each question the same one. */
static inline pid_t answer_with(const char *status)
{
    return answer_with_then(status, status);
}

static inline void end(pid_t child)
{
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, NULL, 0), child);
    answering = 0;
    unlink("run/odid/status.sock");
}

#endif
