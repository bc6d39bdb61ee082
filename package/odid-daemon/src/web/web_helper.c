#include "web/web_helper.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/password.h"
#include "appliance/settings.h"
#include "appliance/update_gate.h"
#include "base/log.h"
#include "base/loop.h"
#include "web/web_status.h"
#include "web/web_upload.h"

enum order_kind {
    ORDER_LOGIN = 1,
    ORDER_KNOWN,
    ORDER_LEAVE,
    ORDER_SET,
    ORDER_UPDATE,
    ORDER_CANCEL
};

/* Each a whole datagram (SOCK_SEQPACKET). */
struct order {
    enum order_kind what;
    enum web_setting setting;
    enum web_network network;
    char token[WEB_TOKEN_SIZE]; /* ended by a zero */
    char text[WEB_VALUE_SIZE];  /* ended by a zero */
};

/* An update's carries a descriptor besides. */
struct answer {
    struct web_login login;
    bool done;
    char said[WEB_SAID_SIZE]; /* ended by a zero */
};

/* Room for one descriptor beside a datagram. */
union attached {
    struct cmsghdr header;
    char room[CMSG_SPACE(sizeof(int))];
};

/* ---- in the unprivileged half ---- */

static struct answer answer_here;

static int descriptor_of(struct msghdr *message)
{
    const struct cmsghdr *part = CMSG_FIRSTHDR(message);
    int fd = -1;

    if (part != NULL && part->cmsg_level == SOL_SOCKET && part->cmsg_type == SCM_RIGHTS) {
        memcpy(&fd, CMSG_DATA(part), sizeof(fd));
    }
    return fd;
}

/* NULL: root's half is gone, and we will be soon. fd: what came with the answer, or -1. */
static struct answer *ask_helper(int helper, struct order *order, int *fd)
{
    struct iovec whole = {.iov_base = &answer_here, .iov_len = sizeof(answer_here)};
    union attached attached;
    struct msghdr message = {.msg_iov = &whole,
                             .msg_iovlen = 1,
                             .msg_control = &attached,
                             .msg_controllen = sizeof(attached)};
    ssize_t got;

    memset(&answer_here, 0, sizeof(answer_here));
    got = send(helper, order, sizeof(*order), MSG_NOSIGNAL);
    explicit_bzero(order, sizeof(*order));
    if (got < 0) {
        return NULL;
    }
    do {
        got = recvmsg(helper, &message, MSG_CMSG_CLOEXEC);
    } while (got < 0 && errno == EINTR);
    if (got != (ssize_t)sizeof(answer_here)) {
        return NULL;
    }
    if (fd != NULL) {
        *fd = descriptor_of(&message);
    }
    answer_here.said[sizeof(answer_here.said) - 1] = '\0';
    return &answer_here;
}

static struct order order_of(enum order_kind what, const char *token)
{
    struct order order = {.what = what};

    snprintf(order.token, sizeof(order.token), "%s", token);
    return order;
}

void web_helper_login(int helper, enum web_network network, const char *password,
                      struct web_login *login)
{
    struct order order = order_of(ORDER_LOGIN, "");
    const struct answer *answer;

    order.network = network;
    snprintf(order.text, sizeof(order.text), "%s", password);
    answer = ask_helper(helper, &order, NULL);
    *login = answer != NULL ? answer->login : (struct web_login){.verdict = WEB_NO_HELPER};
}

bool web_helper_known(int helper, const char token[WEB_TOKEN_SIZE])
{
    struct order order = order_of(ORDER_KNOWN, token);
    const struct answer *answer = ask_helper(helper, &order, NULL);

    return answer != NULL && answer->done;
}

void web_helper_leave(int helper, const char token[WEB_TOKEN_SIZE])
{
    struct order order = order_of(ORDER_LEAVE, token);

    ask_helper(helper, &order, NULL);
}

bool web_helper_set(int helper, const char token[WEB_TOKEN_SIZE], enum web_setting setting,
                    const char *value, char said[WEB_SAID_SIZE])
{
    struct order order = order_of(ORDER_SET, token);
    const struct answer *answer;

    order.setting = setting;
    snprintf(order.text, sizeof(order.text), "%s", value);
    answer = ask_helper(helper, &order, NULL);
    snprintf(said, WEB_SAID_SIZE, "%s",
             answer != NULL ? answer->said : "The page's service is ending; nothing was changed.");
    return answer != NULL && answer->done;
}

bool web_helper_cancel(int helper, const char token[WEB_TOKEN_SIZE], char *sentence, size_t size)
{
    struct order order = order_of(ORDER_CANCEL, token);
    const struct answer *answer = ask_helper(helper, &order, NULL);

    snprintf(sentence, size, "%s",
             answer != NULL ? answer->said : "The page's service is ending; nothing was changed.");
    return answer != NULL && answer->done;
}

int web_helper_update(int helper, const char token[WEB_TOKEN_SIZE], char *sentence, size_t size)
{
    struct order order = order_of(ORDER_UPDATE, token);
    int fd = -1;
    const struct answer *answer = ask_helper(helper, &order, &fd);

    snprintf(sentence, size, "%s",
             answer != NULL ? answer->said : "The page's service is ending; nothing was sent.");
    return fd;
}

/* ---- in root's half ---- */

static struct {
    const struct places *places;
    struct web_sessions sessions;
    struct stat password; /* the file with its key, when it was looked at last */
} self;

static enum web_password check(const char *password)
{
    int result = password_check(self.places->data, password);

    return result > 0 ? WEB_PASSWORD_RIGHT : result == 0 ? WEB_PASSWORD_WRONG : WEB_PASSWORD_NONE;
}

/* Who gave the password before is whoever knew that one. */
static void end_sessions_of_another_password(void)
{
    char path[PLACES_PATH_SIZE];
    struct stat file = {0};

    snprintf(path, sizeof(path), "%s/secrets/maintenance.psk", self.places->data);
    if (stat(path, &file) < 0) {
        memset(&file, 0, sizeof(file));
    }
    if (file.st_ino != self.password.st_ino ||
        file.st_mtim.tv_sec != self.password.st_mtim.tv_sec ||
        file.st_mtim.tv_nsec != self.password.st_mtim.tv_nsec) {
        web_sessions_end_all(&self.sessions);
    }
    self.password = file;
}

/* Each try counts, whoever it comes from; a right one is given back. */
static void login(enum web_network network, const char *password, struct web_login *login)
{
    uint8_t random[WEB_TOKEN_BYTES];

    network = network == WEB_BY_ACCESS_POINT ? network : WEB_BY_CABLE;
    if (!web_sessions_try(&self.sessions, network, loop_now_us(), &login->wait_s)) {
        login->verdict = WEB_PASSWORD_WAIT;
        return;
    }
    login->verdict = check(password);
    if (login->verdict == WEB_PASSWORD_WRONG) {
        log_warning("a wrong maintenance password was given");
    } else if (login->verdict == WEB_PASSWORD_RIGHT) {
        if (getrandom(random, sizeof(random), 0) != (ssize_t)sizeof(random)) {
            login->verdict = WEB_NO_HELPER;
            return;
        }
        web_sessions_begin(&self.sessions, network, random, loop_now_us(), login->token);
        log_info("somebody has given the maintenance password");
    }
}

static const char *const keys[] = {
    [WEB_OPERATOR] = "operator.operator_id",
    [WEB_SERIAL] = "basic_id.uas_id",
};

/* All that a child says, as far as there is room. */
static void read_said(int fd, char said[WEB_SAID_SIZE])
{
    size_t filled = 0;
    ssize_t got = 1;

    while (got > 0 || (got < 0 && errno == EINTR)) {
        char rest[256];
        bool room = filled < WEB_SAID_SIZE - 1;

        got = room ? read(fd, said + filled, WEB_SAID_SIZE - 1 - filled)
                   : read(fd, rest, sizeof(rest)); /* else the child would wait for ever */
        filled += got > 0 && room ? (size_t)got : 0;
    }
    said[filled] = '\0';
}

/* The value never gets into a list of processes: what odidctl set is made of is called, not run. */
static void set_and_exit(const struct places *places, const char *key, char *value, int said)
{
    if (dup2(said, STDOUT_FILENO) < 0 || dup2(said, STDERR_FILENO) < 0) {
        _exit(ODIDCTL_NOT_GOOD);
    }
    setvbuf(stdout, NULL, _IONBF, 0); /* in the order in which it is said */
    exit(settings_set(places, key, value));
}

static void set(struct order *order, struct answer *answer)
{
    int ends[2], status = -1;
    const char *why;
    pid_t child;

    if ((unsigned)order->setting > WEB_SERIAL) {
        return;
    }
    why = armed_not_disarmed(self.places);
    if (why != NULL) {
        snprintf(answer->said, sizeof(answer->said), "%s: nothing was changed.", why);
        return;
    }
    if (pipe2(ends, O_CLOEXEC) < 0) {
        snprintf(answer->said, sizeof(answer->said), "Nothing was changed: %s.", strerror(errno));
        return;
    }
    fflush(NULL); /* not twice */
    child = fork();
    if (child == 0) {
        set_and_exit(self.places, keys[order->setting], order->text, ends[1]);
    }
    close(ends[1]);
    read_said(ends[0], answer->said);
    close(ends[0]);
    if (child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status)) {
        answer->done =
            WEXITSTATUS(status) == ODIDCTL_GOOD || WEXITSTATUS(status) == ODIDCTL_HALF_DONE;
    } else {
        snprintf(answer->said, sizeof(answer->said), "It is not sure whether it was changed.");
    }
}

/* Returns the descriptor for the answer, or -1 with a sentence. */
static int update(struct answer *answer)
{
    web_update_obstacle(self.places, answer->said, sizeof(answer->said));
    if (answer->said[0] != '\0') {
        return -1;
    }
    return web_upload_open(self.places->swupdate, answer->said, sizeof(answer->said));
}

static void cancel_update(struct answer *answer)
{
    char why[UPDATE_SENTENCE_SIZE];

    if (update_gate_ask(self.places->state, "cancel", why) < 0) {
        snprintf(answer->said, sizeof(answer->said),
                 "Nobody looks after updates; it isn't known what becomes of it.");
        return;
    }
    answer->done = why[0] == '\0';
    snprintf(answer->said, sizeof(answer->said), "%s",
             answer->done ? "The update is called off." : why);
}

/* Returns the descriptor that goes with the answer, or -1. */
static int obey(struct order *order, struct answer *answer)
{
    bool known;

    end_sessions_of_another_password();
    known = order->what != ORDER_LOGIN &&
            web_sessions_known(&self.sessions, order->token, loop_now_us());
    if (order->what == ORDER_LOGIN) {
        login(order->network, order->text, &answer->login);
    } else if (!known) {
        snprintf(answer->said, sizeof(answer->said), "Give the maintenance password first.");
    } else if (order->what == ORDER_KNOWN) {
        answer->done = true;
    } else if (order->what == ORDER_LEAVE) {
        web_sessions_end(&self.sessions, order->token);
    } else if (order->what == ORDER_SET) {
        set(order, answer);
    } else if (order->what == ORDER_UPDATE) {
        return update(answer);
    } else if (order->what == ORDER_CANCEL) {
        cancel_update(answer);
    }
    return -1;
}

static bool reply(int orders, struct answer *answer, int fd)
{
    struct iovec whole = {.iov_base = answer, .iov_len = sizeof(*answer)};
    union attached attached = {.header = {.cmsg_len = CMSG_LEN(sizeof(fd)),
                                          .cmsg_level = SOL_SOCKET,
                                          .cmsg_type = SCM_RIGHTS}};
    struct msghdr message = {.msg_iov = &whole, .msg_iovlen = 1};

    if (fd >= 0) {
        message.msg_control = &attached;
        message.msg_controllen = sizeof(attached);
        memcpy(CMSG_DATA(&attached.header), &fd, sizeof(fd));
    }
    return sendmsg(orders, &message, MSG_NOSIGNAL) >= 0;
}

void web_helper_serve(int orders, const struct places *places)
{
    static struct answer answer;
    struct order order;
    bool heard = true;
    ssize_t got;
    int fd;

    self.places = places;
    /* MSG_TRUNC: the length as it was sent, so that a longer one isn't taken for an order. */
    while (heard && ((got = recv(orders, &order, sizeof(order), MSG_TRUNC)) > 0 ||
                     (got < 0 && errno == EINTR))) {
        if (got != (ssize_t)sizeof(order)) {
            continue;
        }
        order.text[sizeof(order.text) - 1] = '\0';
        order.token[sizeof(order.token) - 1] = '\0';
        memset(&answer, 0, sizeof(answer));
        fd = obey(&order, &answer);
        explicit_bzero(&order, sizeof(order));
        heard = reply(orders, &answer, fd);
        if (fd >= 0) {
            close(fd);
        }
    }
}
