/*
 * odidctl: asks the daemon how it is, and checks configuration files.
 */
#include <errno.h>
#include <getopt.h>
#include <json-c/json_object.h>
#include <json-c/json_tokener.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "config.h"
#include "odidctl_table.h"
#include "status.h"

#define DEFAULT_RUN_DIR "/run/odid"
#define ANSWER_MAX 65536
#define PATIENCE_S 3

enum exit_code {
    EXIT_GOOD = 0,
    EXIT_NOT_GOOD = 1,
    EXIT_USAGE = 2,
    EXIT_NO_ANSWER = 3,
};

static const char usage[] =
    "odidctl asks the Remote ID daemon how it is, and checks its configuration.\n"
    "\n"
    "  odidctl [-run-dir DIR] status [--json]   everything at one glance; exit 0 only when all\n"
    "                                           that is required is on the air\n"
    "  odidctl [-run-dir DIR] watch             the same, again every second\n"
    "  odidctl check FILE                       what is wrong in a configuration file\n"
    "  odidctl --version | --help\n"
    "\n"
    "See odidctl(1) and odid.conf(5).\n";

/* ---- asking the daemon ---- */

static int say_no_answer(const char *path, int error)
{
    switch (error) {
    case ENOENT:
    case ECONNREFUSED:
        fprintf(stderr,
                "odidctl: the daemon is not running (%s: %s).\n"
                "Start it, and read its log if it ends again. If it was started with another\n"
                "[daemon] run_dir, name that: odidctl -run-dir DIR ...\n",
                path, strerror(error));
        break;
    case EAGAIN:
        fprintf(stderr,
                "odidctl: the daemon does not answer (%s).\n"
                "It hangs; its supervisor restarts it within seconds. If not, restart it.\n",
                path);
        break;
    case EBADMSG:
        fprintf(stderr,
                "odidctl: the daemon's answer can't be understood (%s).\n"
                "Are odidctl and odid-daemon of the same version?\n",
                path);
        break;
    default:
        fprintf(stderr, "odidctl: can't ask the daemon (%s: %s).\n", path, strerror(error));
        break;
    }
    return EXIT_NO_ANSWER;
}

/* Returns a connected socket, or -errno. */
static int connect_to(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    struct timeval patience = {.tv_sec = PATIENCE_S};
    int fd, error;

    if (strlen(path) >= sizeof(address.sun_path)) {
        return -ENAMETOOLONG;
    }
    memcpy(address.sun_path, path, strlen(path));
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience)); /* connect's, too */
    if (connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        error = errno;
        close(fd);
        return -error;
    }
    return fd;
}

/* Reads the whole answer. Returns its length, or -errno. */
static ssize_t ask(const char *path, char answer[ANSWER_MAX])
{
    int fd = connect_to(path), error = 0;
    size_t filled = 0;
    ssize_t got = fd < 0 ? fd : 1;

    while (fd >= 0 && got > 0 && filled < ANSWER_MAX) {
        got = recv(fd, answer + filled, ANSWER_MAX - filled, 0);
        if (got < 0) {
            error = errno;
        } else {
            filled += (size_t)got;
        }
    }
    if (fd < 0) {
        return got;
    }
    close(fd);
    return error != 0 ? -error : (ssize_t)filled;
}

/* Returns the status, or NULL with *error set. The caller puts it back. */
static struct json_object *fetch(const char *path, int *error)
{
    static char answer[ANSWER_MAX];
    ssize_t length = ask(path, answer);
    struct json_tokener *tokener;
    struct json_object *status = NULL;

    if (length < 0) {
        *error = (int)-length;
        return NULL;
    }
    tokener = json_tokener_new();
    if (tokener != NULL) {
        status = json_tokener_parse_ex(tokener, answer, (int)length);
        json_tokener_free(tokener);
    }
    if (!json_object_is_type(status, json_type_object)) {
        json_object_put(status);
        *error = EBADMSG;
        return NULL;
    }
    return status;
}

/* ---- commands ---- */

static int show_status(const char *path, bool json)
{
    int error = 0;
    struct json_object *status = fetch(path, &error);
    bool on_air;

    if (status == NULL) {
        return say_no_answer(path, error);
    }
    if (json) {
        puts(json_object_to_json_string_ext(status,
                                            JSON_C_TO_STRING_PRETTY | JSON_C_TO_STRING_SPACED));
    } else {
        odidctl_table(stdout, status, isatty(STDOUT_FILENO));
    }
    on_air = json_object_get_boolean(json_object_object_get(status, "on_air"));
    json_object_put(status);
    return on_air ? EXIT_GOOD : EXIT_NOT_GOOD;
}

/* Ends by Ctrl-C, or when nobody reads any more. */
static int watch(const char *path)
{
    const struct timespec second = {.tv_sec = 1};
    bool terminal = isatty(STDOUT_FILENO);
    static char page[16384];

    setvbuf(stdout, page, _IOFBF, sizeof(page)); /* a page appears at once, without flicker */
    while (!ferror(stdout)) {
        if (terminal) {
            fputs("\033[H\033[2J", stdout);
            fflush(stdout);
        }
        show_status(path, false);
        fputs(terminal ? "\nCtrl-C ends this.\n" : "\n", stdout);
        fflush(stdout);
        nanosleep(&second, NULL);
    }
    return EXIT_NOT_GOOD;
}

static void print_sentence(void *context, enum config_severity severity, const char *sentence)
{
    static const char *const names[] = {
        [CONFIG_ERROR] = "error", [CONFIG_WARNING] = "warning", [CONFIG_NOTE] = "note"};
    unsigned *wrong = context;

    *wrong += severity != CONFIG_NOTE;
    printf("%s: %s\n", names[severity], sentence);
}

static int check(const char *file)
{
    struct config config;
    unsigned wrong = 0;

    config_defaults(&config);
    config_read_file(&config, file, print_sentence, &wrong);
    config_judge(&config, print_sentence, &wrong);
    printf("%s: %s\n", file, wrong == 0 ? "nothing is wrong" : "see above");
    return wrong == 0 ? EXIT_GOOD : EXIT_NOT_GOOD;
}

/* ---- command line ---- */

static int wrong_usage(const char *what)
{
    fprintf(stderr, "odidctl: %s\n\n%s", what, usage);
    return EXIT_USAGE;
}

static int run(const char *path, bool json, int count, char *const words[])
{
    if (count == 0) {
        return wrong_usage("say what to do");
    }
    if (strcmp(words[0], "check") == 0) {
        return count == 2 ? check(words[1]) : wrong_usage("check needs one FILE");
    }
    if (count > 1) {
        return wrong_usage("too many words");
    }
    if (strcmp(words[0], "status") == 0) {
        return show_status(path, json);
    }
    if (strcmp(words[0], "watch") == 0) {
        return watch(path);
    }
    return wrong_usage("no such command");
}

int main(int argc, char *argv[])
{
    enum { FLAG_RUN_DIR = 1, FLAG_JSON, FLAG_HELP, FLAG_VERSION };
    static const struct option flags[] = {
        {"run-dir", required_argument, NULL, FLAG_RUN_DIR},
        {"json", no_argument, NULL, FLAG_JSON},
        {"help", no_argument, NULL, FLAG_HELP},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    const char *run_dir = DEFAULT_RUN_DIR;
    char path[256];
    bool json = false;
    int flag;

    while ((flag = getopt_long_only(argc, argv, "", flags, NULL)) != -1) {
        switch (flag) {
        case FLAG_RUN_DIR:
            run_dir = optarg;
            break;
        case FLAG_JSON:
            json = true;
            break;
        case FLAG_HELP:
            fputs(usage, stdout);
            return EXIT_GOOD;
        case FLAG_VERSION:
            puts("odidctl " ODID_VERSION);
            return EXIT_GOOD;
        default:
            return EXIT_USAGE; /* getopt said what is wrong */
        }
    }
    snprintf(path, sizeof(path), "%s/%s", run_dir, STATUS_SOCKET);
    return run(path, json, argc - optind, argv + optind);
}
