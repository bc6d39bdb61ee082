#include "daemon/status.h"

#include <errno.h>
#include <json-c/json_object.h>
#include <malloc.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "appliance/status_ask.h"
#include "base/log.h"
#include "base/loop.h"

#define BACKLOG 8
#define SOCKET_ROOM (4 * STATUS_ANSWER_MAX) /* with what the kernel needs for each piece */
/* An answer is made this often at most, and handed out as it is meanwhile. */
#define MADE_EVERY_US 250000
/* So many are taken in a slot. Whoever comes beyond that waits in the kernel: our time goes to the
 * broadcast, and a flood is no loop that never sleeps (RLIMIT_RTTIME would end us). */
#define SLOT_US 125000
#define TAKEN_MAX 8
/* After an accept that failed: the same error would come back at once, and for ever. */
#define PAUSE_US 1000000

static struct {
    struct loop_watch watch;
    struct loop_timer pause;
    const char *run_dir;
    status_gather_fn *gather;
    void *context;
    char answer[STATUS_ANSWER_MAX];
    size_t length; /* of that; 0: none was made yet */
    int64_t made_us, slot_us;
    unsigned taken; /* since slot_us */
} self = {.watch.fd = -1};

static void make_answer(int64_t now_us)
{
    struct status_snapshot snapshot = {0};
    struct json_object *root;
    const char *text;
    size_t length;

    self.length = 0;
    self.made_us = now_us;
    self.gather(self.context, &snapshot, now_us);
    root = status_json(&snapshot, now_us);
    if (root == NULL) {
        return;
    }
    text = json_object_to_json_string_length(root, JSON_C_TO_STRING_PLAIN, &length);
    if (text != NULL && length <= sizeof(self.answer)) {
        memcpy(self.answer, text, length);
        self.length = length;
    }
    json_object_put(root);
    malloc_trim(0); /* the heap is as small between two questions as before the first */
}

/*
 * A connection gets everything in one piece: it fits into its socket's buffer,
 * so nobody has to wait for a slow reader. Not by the kernel's default: whoever
 * has the right to change that cut each answer short.
 */
static void send_answer(int fd, int64_t now_us)
{
    const int room = SOCKET_ROOM;

    if (setsockopt(fd, SOL_SOCKET, SO_SNDBUFFORCE, &room, sizeof(room)) < 0) {
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &room, sizeof(room)); /* as far as that goes */
    }
    if (self.length == 0 || now_us - self.made_us >= MADE_EVERY_US) {
        make_answer(now_us);
    }
    if (send(fd, self.answer, self.length, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)self.length) {
        log_debug("status: a reader got only part of the answer");
    }
}

static void pause_until(int64_t end_us)
{
    loop_watch_events(&self.watch, 0);
    loop_arm(&self.pause, end_us);
}

static void on_reader(void *context, uint32_t events, int64_t now_us)
{
    int fd;

    (void)context;
    (void)events;
    if (now_us - self.slot_us >= SLOT_US) {
        self.slot_us = now_us;
        self.taken = 0;
    }
    if (self.taken == TAKEN_MAX) {
        pause_until(self.slot_us + SLOT_US);
        return;
    }
    self.taken++;
    fd = accept4(self.watch.fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
        send_answer(fd, now_us); /* one a round: the schedule comes first */
        close(fd);
    } else if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
        log_warning("status: accept: %s", strerror(errno));
        pause_until(now_us + PAUSE_US);
    }
}

/* For our own group, and root: there is no secret in it, but whoever asks costs time. */
static int bind_and_listen(int fd, const struct sockaddr_un *address)
{
    if (unlink(address->sun_path) < 0 && errno != ENOENT) {
        return -errno;
    }
    if (bind(fd, (const struct sockaddr *)address, sizeof(*address)) < 0 ||
        chmod(address->sun_path, 0660) < 0 || listen(fd, BACKLOG) < 0) {
        return -errno;
    }
    return loop_watch(&self.watch, fd, EPOLLIN, on_reader, NULL);
}

static int open_socket(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int length =
        snprintf(address.sun_path, sizeof(address.sun_path), "%s/%s", self.run_dir, STATUS_SOCKET);
    int fd, result;

    if (length >= (int)sizeof(address.sun_path)) {
        return -ENAMETOOLONG;
    }
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    result = fd < 0 ? -errno : bind_and_listen(fd, &address);
    if (result < 0 && fd >= 0) {
        close(fd);
    }
    return result;
}

static void after_pause(void *context, int64_t now_us)
{
    (void)context;
    if (self.watch.fd >= 0) {
        loop_watch_events(&self.watch, EPOLLIN);
    } else if (open_socket() < 0) {
        loop_arm(&self.pause, now_us + PAUSE_US);
    }
}

int status_start(const char *run_dir, status_gather_fn *gather, void *context)
{
    int result;

    self.run_dir = run_dir;
    self.gather = gather;
    self.context = context;
    loop_timer_init(&self.pause, after_pause, NULL);
    result = open_socket();
    if (result < 0) { /* whoever asks for armed gets no answer: tried again */
        log_warning("no status socket %s/%s: %s", run_dir, STATUS_SOCKET, strerror(-result));
        loop_arm(&self.pause, loop_now_us() + PAUSE_US);
    }
    return result;
}
