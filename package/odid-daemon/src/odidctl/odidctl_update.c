/* odidctl update: gives a bundle to SWUpdate and tells what becomes of it; or tells how it stands.
 */
#include <errno.h>
#include <fcntl.h>
#include <json-c/json_tokener.h>
#include <network_ipc.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/update_bundle.h"
#include "appliance/update_gate.h"
#include "appliance/update_names.h"
#include "appliance/update_offer.h"
#include "base/utf8.h"
#include "base/whole_file.h"
#include "odidctl/odidctl.h"

#define FILE_MAX 8192
/* The installer has ended, and its outcome is not said: something is wrong. */
#define PATIENCE_S 20
#define STICK_FAILURES_MAX 2
/* A stick may have several partitions, each with a bundle of its own. */
#define STICK_FILES 8
#define LOOK_MS 200

extern char **environ;

/* ---- what odid-update says ---- */

static struct json_object *read_json(const char *directory, const char *name)
{
    char path[PLACES_PATH_SIZE], *text;
    struct json_object *object;
    size_t length;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    text = whole_file_read(path, FILE_MAX, &length);
    object = text == NULL ? NULL : json_tokener_parse(text);
    free(text);
    return object;
}

void odidctl_add_update(const struct places *places, struct json_object *status)
{
    json_object_object_add(status, "update", read_json(places->state, UPDATE_STATE_FILE));
    json_object_object_add(status, "last_update", read_json(places->data, UPDATE_RESULT_FILE));
}

static const char *text_of(struct json_object *object, const char *name)
{
    const char *text = json_object_get_string(json_object_object_get(object, name));

    return text == NULL ? "" : text;
}

/* Which of the results it is: they are written as new files. */
static ino_t result_number(const struct places *places)
{
    char path[PLACES_PATH_SIZE];
    struct stat file;

    snprintf(path, sizeof(path), "%s/" UPDATE_RESULT_FILE, places->data);
    return stat(path, &file) < 0 ? 0 : file.st_ino;
}

static int print_state(const struct places *places)
{
    struct json_object *state = read_json(places->state, UPDATE_STATE_FILE);
    struct json_object *result = read_json(places->data, UPDATE_RESULT_FILE);
    const char *time = text_of(result, "time");

    puts(state == NULL ? "Nothing looks after updates yet: that begins some seconds after power-on."
                       : text_of(state, "sentence"));
    if (result != NULL) {
        printf("The last one%s%s%s: %s\n", time[0] == '\0' ? "" : " (", time,
               time[0] == '\0' ? "" : ")", text_of(result, "sentence"));
    }
    json_object_put(state);
    json_object_put(result);
    return state == NULL ? ODIDCTL_NO_ANSWER : ODIDCTL_GOOD;
}

/* ---- progress ---- */

static void show_progress(struct json_object *state)
{
    struct json_object *percent = json_object_object_get(state, "percent");
    struct json_object *left = json_object_object_get(state, "seconds_left");
    static int shown = -1;

    if (percent != NULL && json_object_get_int(percent) / 5 != shown) {
        shown = json_object_get_int(percent) / 5;
        printf("%3d %%", json_object_get_int(percent));
        if (left != NULL) {
            printf(", %d s left", json_object_get_int(left));
        }
        puts("");
        fflush(stdout);
    }
}

/* How it was before the bundle was handed over, and what was seen since. */
struct before {
    ino_t result; /* the last one that isn't the bundle's */
    bool waits;   /* for the restart, because of another bundle */
    bool written; /* the gate was passed, and the other slot is written */
};

static bool is(struct json_object *state, const char *name)
{
    return strcmp(text_of(state, "state"), name) == 0;
}

static struct before look_before(const struct places *places)
{
    struct json_object *state = read_json(places->state, UPDATE_STATE_FILE);
    struct before before = {.result = result_number(places),
                            .waits = is(state, "waiting-for-reboot")};

    json_object_put(state);
    return before;
}

/* There is a new result. What was handed over waits for the restart or is refused: any other
 * outcome is of the one that was on trial meanwhile, and so is the restart, where that was rolled
 * back. */
static bool tell_refusal(const struct places *places, bool ended, struct before *before)
{
    ino_t number = result_number(places);
    struct json_object *result = read_json(places->data, UPDATE_RESULT_FILE);
    const char *outcome = text_of(result, "outcome");
    bool refused = strcmp(outcome, "refused") == 0;

    if (!refused) {
        before->result = number;
        before->waits = before->waits || strcmp(outcome, "rolled-back") == 0;
    } else if (ended) {
        printf("%s\n", text_of(result, "sentence"));
    }
    json_object_put(result);
    return refused && ended;
}

/* Returns an exit code when it is over, -1 while it isn't. */
static int look_whether_over(const struct places *places, struct before *before)
{
    struct json_object *state = read_json(places->state, UPDATE_STATE_FILE);
    bool ended = !is(state, "checking") && !is(state, "installing");
    int code = -1;

    show_progress(state);
    before->written = before->written || is(state, "installing");
    if (result_number(places) != before->result && tell_refusal(places, ended, before)) {
        code = ODIDCTL_NOT_GOOD;
    } else if (is(state, "waiting-for-reboot") && !before->waits) {
        printf("%s\n\"odidctl update\" then says whether it was kept.\n",
               text_of(state, "sentence"));
        code = ODIDCTL_GOOD;
    }
    json_object_put(state);
    return code;
}

/* ---- the bundle ---- */

struct source {
    int fd;
    pid_t fetcher; /* 0: none */
};

static bool is_url(const char *name)
{
    return strncmp(name, "http://", 7) == 0 || strncmp(name, "https://", 8) == 0;
}

/* By curl, which checks certificates; no shell is in the way. Returns 0 or an errno. */
static int open_url(const char *url, struct source *source)
{
    char *const words[] = {
        "curl", "-fsSL",        "--proto", "=http,https",   "--max-redirs", "5",  "--max-time",
        "600",  "--speed-time", "30",      "--speed-limit", "1000",         "--", (char *)url,
        NULL};
    posix_spawn_file_actions_t actions;
    int ends[2], result;

    if (pipe2(ends, O_CLOEXEC) < 0) {
        return errno;
    }
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    result = posix_spawnp(&source->fetcher, words[0], &actions, NULL, words, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    source->fd = ends[0];
    return result;
}

/* What a file on a stick is called, whoever has written the stick says. */
static void complain_of(const char *name, const char *what, const char *why)
{
    char shown[PLACES_PATH_SIZE + NAME_MAX];

    utf8_clean(shown, sizeof(shown), name);
    fprintf(stderr, "odidctl: %s %s%s\n", shown, what, why);
}

static bool open_source(const char *name, struct source *source)
{
    int error = 0;

    source->fetcher = 0;
    if (is_url(name)) {
        error = open_url(name, source);
    } else {
        source->fd = open(name, O_RDONLY | O_CLOEXEC);
        error = source->fd < 0 ? errno : 0;
    }
    if (error != 0) {
        complain_of(name, "can't be opened: ", strerror(error));
    }
    return error == 0;
}

/* Returns whether the source was read to its end; it is closed then. */
static bool close_source(struct source *source)
{
    int status = 0;

    close(source->fd);
    return source->fetcher == 0 ||
           (waitpid(source->fetcher, &status, 0) == source->fetcher && status == 0);
}

/*
 * Hands the source over until its end, or until what becomes of it is known: an
 * installer that has refused may go on taking what a slow source brings.
 * Returns look_whether_over()'s answer; *whole: nothing of the source is missed.
 */
static int hand_over(struct source *source, int installer, const struct places *places,
                     struct before *before, bool *whole)
{
    static char piece[65536];
    struct pollfd input = {.fd = source->fd, .events = POLLIN};
    ssize_t length = 1;
    int code = -1;

    while (length > 0 && (code = look_whether_over(places, before)) < 0) {
        if (poll(&input, 1, LOOK_MS) == 0) {
            continue;
        }
        length = read(source->fd, piece, sizeof(piece));
        for (ssize_t done = 0, sent; done < length; done += sent) {
            sent = write(installer, piece + done, (size_t)(length - done));
            if (sent < 0) {
                *whole = true; /* it doesn't want any more: why is told elsewhere */
                return -1;
            }
        }
    }
    *whole = length >= 0;
    return code;
}

/* What a try was that came to nothing. What is armed meanwhile breaks it off: that isn't the
 * bundle's. */
struct attempt {
    bool counts; /* SWUpdate began with it */
    bool tried;  /* it was read to its end, whatever came of it, or cost the other slot; else it may
                    be another story next time */
};

/* Returns SWUpdate's connection, or -1, which is said. unattended: nobody asked for it. */
static int connect_installer(bool unattended)
{
    struct swupdate_request request;
    int installer;

    swupdate_prepare_req(&request);
    request.source = SOURCE_LOCAL; /* no server's: none is told, or left alone for it */
    if (unattended) {
        strcpy(request.info, UPDATE_UNATTENDED);
        request.len = strlen(request.info);
    }
    installer = ipc_inst_start_ext(&request, sizeof(request));
    if (installer < 0) {
        fputs("odidctl: SWUpdate takes no bundle: another update is being installed, or it isn't "
              "running.\n",
              stderr);
    }
    return installer;
}

static int install(const struct places *places, const char *name, bool unattended,
                   struct attempt *attempt)
{
    const struct timespec moment = {.tv_nsec = LOOK_MS * 1000000};
    struct before before;
    struct source source;
    int installer, code;
    bool whole, disarmed;
    char octet;

    *attempt = (struct attempt){0};
    if (!open_source(name, &source)) {
        return ODIDCTL_NOT_GOOD;
    }
    before = look_before(places); /* only now: a stick may take its time */
    installer = connect_installer(unattended);
    if (installer < 0) {
        close(source.fd);
        return ODIDCTL_NO_ANSWER;
    }
    signal(SIGPIPE, SIG_IGN);
    code = hand_over(&source, installer, places, &before, &whole);
    ipc_end(installer);
    attempt->tried = read(source.fd, &octet, 1) == 0;
    whole = close_source(&source) && whole;
    if (code < 0 && !whole) {
        complain_of(name, "could not be read to its end", "");
    }
    for (int i = 0; code < 0 && i < PATIENCE_S * 1000 / LOOK_MS; i++) {
        nanosleep(&moment, NULL);
        code = look_whether_over(places, &before);
    }
    if (code < 0) {
        fputs("odidctl: nothing looks after updates: what became of it isn't known\n", stderr);
    }
    disarmed = armed_not_disarmed(places) == NULL;
    attempt->tried = attempt->tried || (before.written && disarmed);
    attempt->counts = attempt->tried || disarmed;
    return code < 0 ? ODIDCTL_NO_ANSWER : code;
}

/* ---- a stick ---- */

/* Would the gate take it, as far as versions go? If not, it is said. */
static bool is_wanted(const struct places *places, const struct update_bundle *bundle)
{
    char running[UPDATE_VERSION_SIZE], rolled_back[UPDATE_VERSION_SIZE];
    char path[PLACES_PATH_SIZE], why[UPDATE_SENTENCE_SIZE];
    const struct update_versions versions = {.offered = bundle->version,
                                             .running = running,
                                             .rolled_back = rolled_back,
                                             .unattended = true};
    bool wanted;

    whole_file_line(places->version, running, sizeof(running));
    snprintf(path, sizeof(path), "%s/" UPDATE_BACK_FILE, places->data);
    whole_file_line(path, rolled_back, sizeof(rolled_back));
    wanted = update_versions_judge(&versions, why, sizeof(why));
    if (!wanted) {
        puts(why);
    }
    return wanted;
}

struct stick_files {
    char identity[STICK_FILES][UPDATE_IDENTITY_SIZE]; /* the last one first; "": none */
};

static void read_stick_files(const struct places *places, struct stick_files *files)
{
    char path[PLACES_PATH_SIZE], *text, *rest, *line;
    size_t length;

    memset(files, 0, sizeof(*files));
    snprintf(path, sizeof(path), "%s/" UPDATE_STICK_FILE, places->data);
    text = rest = whole_file_read(path, sizeof(*files), &length);
    for (unsigned i = 0; i < STICK_FILES && (line = strsep(&rest, "\n")) != NULL; i++) {
        snprintf(files->identity[i], UPDATE_IDENTITY_SIZE, "%s", line);
    }
    free(text);
}

static void write_stick_files(const struct places *places, const struct stick_files *files)
{
    char path[PLACES_PATH_SIZE], text[sizeof(*files) + 1] = "";
    size_t filled = 0;

    snprintf(path, sizeof(path), "%s/" UPDATE_STICK_FILE, places->data);
    for (unsigned i = 0; i < STICK_FILES && files->identity[i][0] != '\0'; i++) {
        filled +=
            (size_t)snprintf(text + filled, sizeof(text) - filled, "%s\n", files->identity[i]);
    }
    whole_file_replace(path, text, filled, 0644);
}

static bool was_tried(const struct places *places, const char *identity)
{
    struct stick_files files;
    bool found = false;

    read_stick_files(places, &files);
    for (unsigned i = 0; i < STICK_FILES; i++) {
        found = found || strcmp(files.identity[i], identity) == 0;
    }
    return found;
}

/* A stick that is forgotten in the aircraft comes again at each power-on, and each time it would
 * cost the other slot and keep the aircraft on the ground: a file that was read to its end is left
 * alone, and so is everything once as many came to nothing as a stick may cost. */
static bool is_tried_again(const struct places *places, const char *path,
                           char identity[UPDATE_IDENTITY_SIZE])
{
    char kept[PLACES_PATH_SIZE], failures[16];
    struct stat file = {0};
    const char *name = strrchr(path, '/');

    stat(path, &file);
    snprintf(identity, UPDATE_IDENTITY_SIZE, "%lld %lld %.60s", (long long)file.st_size,
             (long long)file.st_mtime, name == NULL ? path : name + 1);
    for (char *c = identity; *c != '\0'; c++) { /* it is kept as one line */
        *c = (unsigned char)*c < ' ' ? '?' : *c;
    }
    snprintf(kept, sizeof(kept), "%s/" UPDATE_STICK_FAILURES_FILE, places->state);
    whole_file_line(kept, failures, sizeof(failures));
    if (was_tried(places, identity)) {
        puts("This file was tried before: it is left alone. Copy it anew, or give it by the page.");
        return true;
    }
    if (atoi(failures) >= STICK_FAILURES_MAX) {
        puts("Two bundles from sticks came to nothing since power-on: no other one is tried.");
        return true;
    }
    return false;
}

static void remember_file(const struct places *places, const char *identity)
{
    struct stick_files files;

    read_stick_files(places, &files);
    memmove(files.identity[1], files.identity[0], sizeof(files) - UPDATE_IDENTITY_SIZE);
    snprintf(files.identity[0], UPDATE_IDENTITY_SIZE, "%s", identity);
    write_stick_files(places, &files);
}

static void count_failure(const struct places *places)
{
    char kept[PLACES_PATH_SIZE], text[16];

    snprintf(kept, sizeof(kept), "%s/" UPDATE_STICK_FAILURES_FILE, places->state);
    whole_file_line(kept, text, sizeof(text));
    snprintf(text, sizeof(text), "%d\n", atoi(text) + 1);
    whole_file_replace(kept, text, strlen(text), 0644);
}

/* One that isn't read to its end, of a slow stick or refused at once, isn't remembered; but such a
 * stick may come again and again, too. */
static void note_failure(const struct places *places, const char *identity,
                         const struct attempt *attempt)
{
    if (attempt->tried) {
        remember_file(places, identity);
    }
    if (attempt->counts) {
        count_failure(places);
    }
}

static int try_file(const struct places *places, const char *path, const char *version,
                    const char *identity)
{
    struct attempt attempt;
    int result;

    printf("Version %s is tried.\n", version);
    result = install(places, path, true, &attempt);
    if (result == ODIDCTL_GOOD) {
        remember_file(places, identity); /* of those that fail their trial the last one is known */
    } else {
        note_failure(places, identity, &attempt);
    }
    return result;
}

/* The newest bundle of the folder, as one that nobody asked for: the gate hears of it, and judges
 * by the description that was verified. This one only saves work. */
static int install_from(const struct places *places, const char *folder)
{
    char hardware[UPDATE_HARDWARE_SIZE], name[NAME_MAX + 1];
    char path[PLACES_PATH_SIZE + NAME_MAX + 2];
    char identity[UPDATE_IDENTITY_SIZE];
    struct update_bundle bundle;
    int result;

    snprintf(path, sizeof(path), "%s/hardware", places->state);
    whole_file_line(path, hardware, sizeof(hardware));
    result = update_bundle_newest(folder, hardware, name, &bundle);
    if (result < 0) {
        printf("There is no bundle for %s at the top level of %s%s%s.\n",
               hardware[0] == '\0' ? "this board" : hardware, folder, result == -ENOENT ? "" : ": ",
               result == -ENOENT ? "" : strerror(-result));
        return ODIDCTL_NOT_GOOD;
    }
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    if (!is_wanted(places, &bundle) || is_tried_again(places, path, identity)) {
        return ODIDCTL_NOT_GOOD;
    }
    return try_file(places, path, bundle.version, identity);
}

/* ---- calling it off ---- */

static int call_off(const struct places *places)
{
    char answer[UPDATE_SENTENCE_SIZE];

    if (update_gate_ask(places->state, "cancel", answer) < 0) {
        fputs("odidctl: the service update doesn't answer.\n", stderr);
        return ODIDCTL_NO_ANSWER;
    }
    puts(answer[0] == '\0' ? "The update is called off." : answer);
    return answer[0] == '\0' ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

int odidctl_update(const struct places *places, const char *name)
{
    struct attempt attempt;
    struct stat file;

    setenv("TMPDIR", places->swupdate, 0); /* where libswupdate looks for SWUpdate */
    if (name == NULL) {
        return print_state(places);
    }
    if (strcmp(name, "cancel") == 0) {
        return call_off(places);
    }
    return stat(name, &file) == 0 && S_ISDIR(file.st_mode) ? install_from(places, name)
                                                           : install(places, name, false, &attempt);
}
