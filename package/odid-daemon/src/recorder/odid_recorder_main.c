/*
 * odid-recorder: keeps the flight record. Asks the daemon for its status once
 * a second; whatever fails, it goes on.
 */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "appliance/places.h"
#include "appliance/status_ask.h"
#include "appliance/update_names.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/utf8.h"
#include "base/whole_file.h"
#include "flights/recorder_json.h"
#include "flights/recorder_read.h"
#include "flights/recorder_store.h"
#include "recorder/recorder.h"
#include "recorder/recorder_board.h"
#include "recorder/recorder_snapshot.h"

#define SECOND_US 1000000
/* Less than a second, so that a daemon that hangs doesn't cost us our own pace. */
#define PATIENCE_MS 900
/* How often it is said how things stand when nothing happens: what a power cut may cost. */
#define TOTALS_ARMED_US 10000000
#define TOTALS_US 60000000
#define FAULT_NAME "flight-record"

static const char usage[] =
    "odid-recorder keeps the flight record: was Remote ID on the air the whole flight?\n"
    "\n"
    "  odid-recorder [-root DIR]\n"
    "\n"
    "See odid-recorder(8); odidctl flights shows what was recorded.\n";

static struct {
    struct places places;
    struct recorder recorder;
    struct recorder_store store;
    struct recorder_board_reader board;
    int64_t totals_us; /* when the totals were said last */
    bool fault_told;
    ino_t update; /* the file of the last update's result, which is a new one each time */
} self = {.board.places = &self.places};

static void on_line(void *context, const char *line)
{
    (void)context;
    recorder_text_add(&self.store.text, line);
}

/* ---- what is asked ---- */

static void explain(char out[RECORDER_TEXT_SIZE], int error)
{
    const char *what = error == ENOENT || error == ECONNREFUSED ? "the daemon does not run"
                       : error == EAGAIN                        ? "the daemon does not answer"
                       : error == EBADMSG ? "the daemon's answer can't be understood"
                                          : strerror(error);

    snprintf(out, RECORDER_TEXT_SIZE, "%s", what);
}

static void take_snapshot(struct recorder_snapshot *snapshot)
{
    static char answer[STATUS_ANSWER_MAX];
    ssize_t length = status_ask(self.places.run_dir, PATIENCE_MS, answer);
    struct json_object *status = length < 0 ? NULL : recorder_json_parse(answer, (size_t)length);

    memset(snapshot, 0, sizeof(*snapshot));
    if (status != NULL) {
        recorder_snapshot(snapshot, status, loop_now_us());
        json_object_put(status);
    } else {
        explain(snapshot->text, length < 0 ? (int)-length : EBADMSG);
    }
    recorder_board_read(&self.board, &self.recorder, &snapshot->board);
}

static ino_t update_file(char path[256])
{
    struct stat file;

    snprintf(path, 256, "%s/" UPDATE_RESULT_FILE, self.places.data);
    return stat(path, &file) < 0 ? 0 : file.st_ino;
}

/* odid-update has kept what became of an update since the last look. */
static void look_for_update(int64_t now_us)
{
    char path[256], sentence[RECORDER_TEXT_SIZE], *text;
    ino_t number = update_file(path);
    struct json_object *result;
    size_t length;

    if (number == self.update) {
        return;
    }
    self.update = number;
    text = number == 0 ? NULL : whole_file_read(path, sizeof(sentence) * 8, &length);
    result = text == NULL ? NULL : recorder_json_parse(text, length);
    if (result != NULL) {
        utf8_clean(sentence, sizeof(sentence), recorder_json_text(result, "sentence", "?"));
        recorder_say_update(&self.recorder, sentence, now_us);
    }
    json_object_put(result);
    free(text);
}

/* ---- what is written ---- */

/* Tells whoever asks odidctl; without that list of faults the log has to do. */
static void tell_fault(int error)
{
    char path[256], text[320];
    int length;

    snprintf(path, sizeof(path), "%s/" FAULT_NAME, self.places.faults);
    if (error == 0) {
        self.fault_told = unlink(path) < 0 && errno != ENOENT;
        return;
    }
    length = snprintf(text, sizeof(text),
                      "The flight record can't be written to %s (%s): it is in memory, and lost "
                      "at power-off.\n",
                      self.places.flights, strerror(error));
    self.fault_told = whole_file_replace(path, text, (size_t)length, 0644) == 0;
}

static void save(int64_t now_us)
{
    int error = -recorder_store_write(&self.store, now_us);

    if ((error != 0) != self.fault_told) {
        tell_fault(error);
    }
}

static void save_when_due(int64_t now_us)
{
    int64_t every_us = recorder_armed(&self.recorder) ? TOTALS_ARMED_US : TOTALS_US;
    bool news = self.store.text.length > self.store.text.stored || self.store.text.changed;

    if (!recorder_store_due(&self.store, now_us) || (!news && now_us - self.totals_us < every_us)) {
        return;
    }
    recorder_say_totals(&self.recorder);
    self.totals_us = now_us;
    save(now_us);
}

/* ---- start ---- */

/* VERSION= of the appliance; "unknown" where there is none. */
static void read_image(char out[64])
{
    FILE *file = fopen(self.places.release, "re");
    char line[256];

    snprintf(out, 64, "unknown");
    while (file != NULL && fgets(line, sizeof(line), file) != NULL) {
        line[strcspn(line, "\r\n")] = '\0';
        if (strncmp(line, "VERSION=", 8) == 0) {
            utf8_clean(out, 64, line + 8);
        }
    }
    if (file != NULL) {
        fclose(file);
    }
}

static void start_record(int64_t now_us)
{
    static struct recorder_flight before;
    char boot[64], clean[64], image[64], path[256];

    whole_file_line(self.places.boot_id, boot, sizeof(boot));
    utf8_clean(clean, sizeof(clean), boot);
    read_image(image);
    self.update = update_file(path);
    self.totals_us = now_us;
    self.fault_told = true; /* an earlier process may have: the first write takes it away */
    if (!recorder_store_open(&self.store, self.places.flights, clean)) {
        recorder_start(&self.recorder, on_line, NULL, clean, image, now_us);
        return;
    }
    recorder_read(&before, self.store.text.bytes, self.store.text.length, NULL, NULL);
    recorder_continue(&self.recorder, on_line, NULL, &before.totals, before.fault, before.faults,
                      now_us);
}

/* Returns the signal that ends us. */
static int record_until_signal(const sigset_t *signals)
{
    static struct recorder_snapshot snapshot;
    int64_t next_us = loop_now_us(), left_us;
    struct timespec pause;
    int number;

    do {
        take_snapshot(&snapshot);
        recorder_tick(&self.recorder, &snapshot, loop_now_us());
        look_for_update(loop_now_us());
        save_when_due(loop_now_us());
        next_us += SECOND_US;
        left_us = next_us - loop_now_us();
        if (left_us < 0) { /* a disk that took long: no catching up */
            next_us -= left_us;
            left_us = 0;
        }
        pause =
            (struct timespec){.tv_sec = left_us / SECOND_US, .tv_nsec = left_us % SECOND_US * 1000};
        number = sigtimedwait(signals, NULL, &pause);
    } while (number < 0);
    return number;
}

static bool read_options(int argc, char *argv[])
{
    enum { FLAG_ROOT = 1, FLAG_HELP, FLAG_VERSION };
    static const struct option flags[] = {
        {"root", required_argument, NULL, FLAG_ROOT},
        {"help", no_argument, NULL, FLAG_HELP},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    const char *root = "";
    int flag;

    while ((flag = getopt_long_only(argc, argv, "", flags, NULL)) != -1) {
        switch (flag) {
        case FLAG_ROOT:
            root = optarg;
            break;
        case FLAG_HELP:
            fputs(usage, stdout);
            exit(EXIT_SUCCESS);
        case FLAG_VERSION:
            puts("odid-recorder " ODID_VERSION);
            exit(EXIT_SUCCESS);
        default:
            return false; /* getopt said what is wrong */
        }
    }
    if (optind < argc) {
        fprintf(stderr, "odid-recorder: \"%s\" is no option\n\n%s", argv[optind], usage);
        return false;
    }
    places_under(&self.places, root);
    return true;
}

int main(int argc, char *argv[])
{
    sigset_t signals;
    int number;

    if (!read_options(argc, argv)) {
        return 2;
    }
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGHUP);
    if (sigprocmask(SIG_BLOCK, &signals, NULL) < 0) {
        log_error("can't wait for signals: %s", strerror(errno));
        return EXIT_FAILURE;
    }
    signal(SIGPIPE, SIG_IGN); /* a logger that ended doesn't end the record */
    signal(SIGXFSZ, SIG_IGN); /* nor does a limit on files */
    start_record(loop_now_us());
    number = record_until_signal(&signals);
    recorder_end(&self.recorder, loop_now_us());
    save(loop_now_us());
    log_info("ending on signal %d", number);
    return EXIT_SUCCESS;
}
