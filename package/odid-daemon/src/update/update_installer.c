#include "update/update_installer.h"

#include <errno.h>
#include <network_ipc.h>
#include <progress_ipc.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/loop.h"
#include "base/whole_file.h"
#include "update/update.h"

/* Soon: what hawkBit's client begins may come a moment after SWUpdate's start. */
#define AGAIN_US 100000
/* To a new listener SWUpdate first repeats, at once, what it said of its last install. */
#define HISTORY_US 300000
/* What a subprocess complains of has this error: br2-external/patches/swupdate. */
#define OF_A_SUBPROCESS 3

static struct {
    const struct update_installer_calls *calls;
    struct loop_timer again, history;
    bool in_history; /* what comes was heard before */
    pid_t heard;     /* the SWUpdate that was listened to last; 0: none, -1: not known which */
    struct loop_watch notices, progress;
    bool running, succeeded;
    bool unattended; /* what was begun last */
    enum update_source source;
    char complaint[UPDATE_SENTENCE_SIZE];
} self = {.notices = {.fd = -1}, .progress = {.fd = -1}};

/* ---- ending it ---- */

/* When a process started, in clock ticks; 0: there is none. */
static unsigned long long started_at(pid_t pid)
{
    char path[40], *text, *at;
    size_t length;
    unsigned long long started;

    snprintf(path, sizeof(path), "/proc/%d/stat", (int)pid);
    text = whole_file_read(path, 4096, &length);
    /* The second field, the name, may hold anything but ends with the last bracket; it is the 22nd.
     */
    at = text == NULL ? NULL : strrchr(text, ')');
    for (int field = 3; at != NULL && field <= 22; field++) {
        at = strchr(at + 1, ' ');
    }
    started = at == NULL ? 0 : strtoull(at, NULL, 10);
    free(text);
    return started;
}

int update_installer_end(const char *pid_file)
{
    size_t length;
    char *text = whole_file_read(pid_file, 64, &length), *rest = text;
    pid_t pid;

    if (text == NULL) {
        return -errno;
    }
    pid = (pid_t)strtol(text, &rest, 10);
    /* With its start it is known for sure: numbers are used again. */
    if (pid <= 0 || started_at(pid) == 0 || started_at(pid) != strtoull(rest, NULL, 10)) {
        pid = 0;
    }
    free(text);
    if (pid == 0) {
        return -ESRCH;
    }
    return kill(pid, SIGKILL) < 0 ? -errno : 0;
}

/* ---- what is wrong, for people ---- */

void update_installer_explain(const char *complaint, const char *hardware, char *out,
                              unsigned long size)
{
    static const struct {
        const char *part, *sentence;
    } known[] = {
        {"ignature", "It isn't signed by a key that this aircraft trusts, or was altered."},
        {"signer", "It isn't signed by a key that this aircraft trusts, or was altered."},
        {"not compatible with hardware", "It is for other hardware than this board, %s."},
        {"HASH mismatch", "It is damaged: what was written isn't what its maker signed."},
        {"hash", "It is damaged: what was written isn't what its maker signed."},
        {"Checksum WRONG", "It is damaged: something in it was changed on its way."},
        {"CPIO", "It is no whole bundle: cut short, or another kind of file."},
        {"Compatible SW not found", "It is no bundle for this appliance, or was altered."},
        {"treaming", "It is cut short or damaged."},
        {"missing...aborting", "It is cut short: there is no slot in it."},
        /* What it says when it asks whether the update is still wanted, and it isn't. */
        {"delivered empty 'update'", "It was called off at the server while it was written."},
        {"Image invalid", "It isn't signed, or is another kind of file: no bundle for this board."},
    };

    for (unsigned i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
        if (strstr(complaint, known[i].part) != NULL) {
            const char *gap = strstr(known[i].sentence, "%s");

            snprintf(out, size, "%.*s%s%s",
                     gap == NULL ? (int)strlen(known[i].sentence) : (int)(gap - known[i].sentence),
                     known[i].sentence, gap == NULL ? "" : hardware, gap == NULL ? "" : gap + 2);
            return;
        }
    }
    snprintf(out, size, "The installer says: %s", complaint[0] == '\0' ? "nothing" : complaint);
}

/* ---- what it says ---- */

static void begin_install(int64_t now_us)
{
    if (!self.in_history) {
        self.calls->begins(now_us);
        self.calls->source(self.source);
    }
}

/* It may be read before the START that was said first, by the other socket: while nothing goes on
 * it is of what comes. */
static void take_source(sourcetype said)
{
    enum update_source source = said == SOURCE_SURICATTA ? UPDATE_SOURCE_SERVER
                                : said == SOURCE_UNKNOWN ? UPDATE_SOURCE_UNKNOWN
                                                         : UPDATE_SOURCE_OTHER;

    if (source != self.source) {
        self.source = source;
        if (self.running && !self.in_history) {
            self.calls->source(source);
        }
    }
}

/* The request's own word, when its description is verified: another install's has another message,
 * and whoever speaks to SWUpdate's notifier makes none that begins one. */
static void take_request(const struct progress_msg *message)
{
    self.unattended = message->infolen == strlen(UPDATE_UNATTENDED) &&
                      memcmp(message->info, UPDATE_UNATTENDED, message->infolen) == 0;
}

static void take_progress(const struct progress_msg *message, int64_t now_us)
{
    take_source(message->source);
    if (message->status == START) {
        take_request(message);
    }
    if (self.running && !self.in_history && message->cur_step > 0 &&
        (message->status == RUN || message->status == PROGRESS)) {
        self.calls->progress((int)message->cur_percent, now_us);
    }
}

/* One, in one piece: SWUpdate sends them so. 0, or -EAGAIN: there is none, although epoll may have
 * announced one, as the notice of an end reads them too; another negative errno: it is gone. */
static int read_progress(int64_t now_us)
{
    static struct progress_msg message;
    ssize_t length = recv(self.progress.fd, &message, sizeof(message), MSG_DONTWAIT);

    if (length != (ssize_t)sizeof(message)) {
        return length < 0 ? -errno : -ECONNRESET;
    }
    take_progress(&message, now_us);
    return 0;
}

bool update_installer_is_unattended(int64_t now_us)
{
    int result;

    do {
        result = read_progress(now_us);
    } while (result == 0);
    return result != -EAGAIN || self.unattended;
}

static void end_install(int64_t now_us)
{
    self.running = false;
    if (!self.in_history) {
        self.calls->ends(self.succeeded ? "" : self.complaint, now_us);
    }
    self.source = UPDATE_SOURCE_UNKNOWN;
}

static void read_all_progress(int64_t now_us)
{
    while (self.running && read_progress(now_us) == 0) {
    }
}

/* Of its hawkBit client, whose server doesn't answer or says what it can't use. Debian's SWUpdate
 * doesn't say which process complains; what its own says of the client's questions none does. */
static bool is_of_the_client(const ipc_message *message)
{
    return message->data.notify.error == OF_A_SUBPROCESS ||
           strstr(message->data.notify.msg, ": Channel ") != NULL ||
           strstr(message->data.notify.msg, "update state") != NULL;
}

/* What its client complains of is nothing of an update that isn't that one's server's. */
static bool is_of_this_update(const ipc_message *message)
{
    /* The client asks SWUpdate all the time, and doesn't wait for each answer. */
    return strstr(message->data.notify.msg, "on socket ctrl") == NULL &&
           (self.source != UPDATE_SOURCE_OTHER || !is_of_the_client(message));
}

static void take_notice(const ipc_message *message, int64_t now_us)
{
    switch (message->data.notify.status) {
    case START:
        self.running = true;
        self.succeeded = false;
        self.complaint[0] = '\0';
        begin_install(now_us);
        break;
    case SUCCESS:
        self.succeeded = true;
        break;
    case FAILURE:
        read_all_progress(now_us); /* whose it is it may have said there */
        if (!is_of_this_update(message)) {
            break;
        }
        self.succeeded = false;
        if (self.complaint[0] == '\0') {
            snprintf(self.complaint, sizeof(self.complaint), "%.*s",
                     (int)sizeof(self.complaint) - 1, message->data.notify.msg);
        }
        break;
    case IDLE:
        /* By the other socket it has said before whose it was. */
        read_all_progress(now_us);
        if (self.running) {
            end_install(now_us);
        }
        break;
    default:
        break;
    }
}

static void lose_installer(int64_t now_us)
{
    struct loop_watch *const watches[] = {&self.notices, &self.progress};
    bool installing = self.running && !self.in_history;

    for (unsigned i = 0; i < 2; i++) {
        int fd = watches[i]->fd;

        if (fd >= 0) {
            loop_unwatch(watches[i]);
            close(fd);
        }
    }
    loop_arm(&self.history, LOOP_NEVER);
    if (self.running) {
        self.succeeded = false;
        snprintf(self.complaint, sizeof(self.complaint), "SWUpdate ended");
        end_install(now_us);
    }
    self.calls->lost(installing, now_us);
    self.in_history = false;
    loop_arm(&self.again, now_us + AGAIN_US);
}

static void on_notice(void *context, uint32_t events, int64_t now_us)
{
    static ipc_message message;

    (void)context;
    (void)events;
    /* One a call, in one piece: SWUpdate sends them so. */
    if (read(self.notices.fd, &message, sizeof(message)) == (ssize_t)sizeof(message)) {
        take_notice(&message, now_us);
    } else {
        lose_installer(now_us);
    }
}

static void on_progress(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)events;
    int result = read_progress(now_us);

    if (result < 0 && result != -EAGAIN) {
        lose_installer(now_us);
    }
}

/* ---- connecting ---- */

static void on_history_told(void *context, int64_t now_us)
{
    (void)context;
    self.in_history = false;
    if (self.running) { /* an install is going on: we came late */
        begin_install(now_us);
    }
}

static pid_t peer_of(int socket)
{
    struct ucred peer = {.pid = 0};
    socklen_t size = sizeof(peer);

    getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size);
    return peer.pid;
}

static void connect_now(void *context, int64_t now_us)
{
    int notices = -1, progress = -1;
    pid_t peer;

    (void)context;
    if (access(get_ctrl_socket(), F_OK) == 0 && access(get_prog_socket(), F_OK) == 0) {
        progress = progress_ipc_connect(false);
        notices = progress < 0 ? -1 : ipc_notify_connect();
    }
    if (notices < 0) {
        if (progress >= 0) {
            close(progress);
        }
        loop_arm(&self.again, now_us + AGAIN_US);
        return;
    }
    /* What a SWUpdate that nobody listened to yet repeats is news: it can have refused a bundle
     * before we were there. */
    peer = peer_of(notices);
    self.in_history = self.heard == -1 || self.heard == peer;
    self.heard = peer;
    if (self.in_history) {
        loop_arm(&self.history, now_us + HISTORY_US);
    }
    self.unattended = true; /* until it is heard: nothing of this is repeated */
    loop_watch(&self.progress, progress, EPOLLIN, on_progress, NULL);
    loop_watch(&self.notices, notices, EPOLLIN, on_notice, NULL);
}

void update_installer_watch(const struct update_installer_calls *calls, bool from_the_start)
{
    self.calls = calls;
    self.heard = from_the_start ? 0 : -1;
    loop_timer_init(&self.again, connect_now, NULL);
    loop_timer_init(&self.history, on_history_told, NULL);
    loop_arm(&self.again, loop_now_us());
}
