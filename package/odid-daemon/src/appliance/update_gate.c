#include "appliance/update_gate.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/log.h"
#include "base/loop.h"

#define CONNECTIONS 4
#define WORD_SIZE 16
/* SWUpdate's word that it has begun comes at once, unless we have just been started. */
#define KNOWN_US 5000000
#define LOOK_US 100000
/* The other end's: the daemon is asked for its status too. */
#define PATIENCE_S 20

struct connection {
    struct loop_watch watch;
    bool asking; /* at the gate */
    int64_t since_us;
};

static struct {
    const struct update_gate_calls *calls;
    struct loop_watch listener;
    struct loop_timer look;
    struct connection connections[CONNECTIONS];
} self;

static bool fill_address(struct sockaddr_un *address, const char *directory)
{
    int length;

    memset(address, 0, sizeof(*address));
    address->sun_family = AF_UNIX;
    length =
        snprintf(address->sun_path, sizeof(address->sun_path), "%s/" UPDATE_GATE_SOCKET, directory);
    return length < (int)sizeof(address->sun_path);
}

/* ---- serving ---- */

static void end_connection(struct connection *connection)
{
    int fd = connection->watch.fd;

    loop_unwatch(&connection->watch);
    close(fd);
}

static void answer_and_end(struct connection *connection, const char *sentence)
{
    if (send(connection->watch.fd, sentence, strlen(sentence) + 1, MSG_NOSIGNAL | MSG_DONTWAIT) <
        0) {
        log_warning("update: whoever asked has gone: %s", strerror(errno));
    }
    end_connection(connection);
}

/* Returns whether it is answered. */
static bool try_gate(struct connection *connection, int64_t now_us)
{
    char sentence[UPDATE_SENTENCE_SIZE] = "";

    if (self.calls->known()) {
        self.calls->judge(sentence);
    } else if (now_us - connection->since_us >= KNOWN_US) {
        snprintf(sentence, sizeof(sentence),
                 "SWUpdate didn't say that it has begun. Try again in a minute.");
    } else {
        return false;
    }
    answer_and_end(connection, sentence);
    return true;
}

static void on_look(void *context, int64_t now_us)
{
    (void)context;
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        struct connection *one = &self.connections[i];

        if (one->watch.fd >= 0 && one->asking && !try_gate(one, now_us)) {
            loop_arm(&self.look, now_us + LOOK_US);
        }
    }
}

static void take_word(struct connection *connection, const char *word, int64_t now_us)
{
    char sentence[UPDATE_SENTENCE_SIZE] = "";

    if (strcmp(word, "gate") == 0) {
        connection->asking = true;
        connection->since_us = now_us;
        on_look(NULL, now_us);
    } else if (strcmp(word, "cancel") == 0) {
        self.calls->cancel(sentence);
        answer_and_end(connection, sentence);
    } else {
        end_connection(connection);
    }
}

static void on_word(void *context, uint32_t events, int64_t now_us)
{
    struct connection *connection = context;
    char word[WORD_SIZE + 1] = "";
    ssize_t length = recv(connection->watch.fd, word, WORD_SIZE, MSG_DONTWAIT);

    (void)events;
    if (length < 0 && errno == EAGAIN) {
        return;
    }
    if (length <= 0 || connection->asking) {
        end_connection(connection);
        return;
    }
    take_word(connection, word, now_us);
}

static void on_asker(void *context, uint32_t events, int64_t now_us)
{
    int fd = accept4(self.listener.fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);

    (void)context;
    (void)events;
    (void)now_us;
    for (unsigned i = 0; fd >= 0 && i < CONNECTIONS; i++) {
        struct connection *one = &self.connections[i];

        if (one->watch.fd < 0) {
            one->asking = false;
            if (loop_watch(&one->watch, fd, EPOLLIN, on_word, one) == 0) {
                return;
            }
        }
    }
    if (fd >= 0) {
        close(fd);
    }
}

int update_gate_serve(const char *directory, const struct update_gate_calls *calls)
{
    struct sockaddr_un address;
    int fd, result = 0;

    self.calls = calls;
    loop_timer_init(&self.look, on_look, NULL);
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        self.connections[i].watch.fd = -1;
    }
    if (!fill_address(&address, directory)) {
        return -ENAMETOOLONG;
    }
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    /* Nobody but root from the beginning: the mode is the one that bind gives it. */
    mode_t mask = umask(0177);
    if ((unlink(address.sun_path) < 0 && errno != ENOENT) ||
        bind(fd, (struct sockaddr *)&address, sizeof(address)) < 0 || listen(fd, CONNECTIONS) < 0) {
        result = -errno;
    }
    umask(mask);
    if (result == 0) {
        result = loop_watch(&self.listener, fd, EPOLLIN, on_asker, NULL);
    }
    if (result < 0) {
        close(fd);
    }
    return result;
}

/* ---- the other end ---- */

int update_gate_say(const char *directory, const char *word)
{
    const struct timeval patience = {.tv_sec = PATIENCE_S};
    struct sockaddr_un address;
    int fd, error = 0;

    if (!fill_address(&address, directory)) {
        return -ENAMETOOLONG;
    }
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    if (setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience)) < 0 ||
        setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience)) < 0 ||
        connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0 ||
        send(fd, word, strlen(word), MSG_NOSIGNAL) < 0) {
        error = errno;
        close(fd);
    }
    return error != 0 ? -error : fd;
}

int update_gate_ask(const char *directory, const char *word, char answer[UPDATE_SENTENCE_SIZE])
{
    int fd = update_gate_say(directory, word), error;
    ssize_t length;

    if (fd < 0) {
        return fd;
    }
    length = recv(fd, answer, UPDATE_SENTENCE_SIZE - 1, 0);
    error = length < 0 ? errno : ECONNRESET; /* it ended meanwhile */
    close(fd);
    if (length <= 0) {
        return -error;
    }
    answer[length] = '\0';
    return 0;
}
