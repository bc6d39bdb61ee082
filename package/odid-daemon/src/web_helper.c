#include "web_helper.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/* Each a whole datagram (SOCK_SEQPACKET). */
struct order {
    enum { ORDER_PASSWORD, ORDER_SET } what;
    enum web_setting setting;
    char text[WEB_VALUE_SIZE]; /* ended by a zero */
};

struct answer {
    enum web_password password;
    bool done;
    char said[WEB_SAID_SIZE]; /* ended by a zero */
};

/* ---- in the unprivileged half ---- */

/* False: root's half is gone, and we will be soon. */
static bool ask(int helper, struct order *order, struct answer *answer)
{
    ssize_t got;

    memset(answer, 0, sizeof(*answer));
    got = send(helper, order, sizeof(*order), MSG_NOSIGNAL);
    explicit_bzero(order, sizeof(*order));
    if (got < 0) {
        return false;
    }
    do {
        got = recv(helper, answer, sizeof(*answer), 0);
    } while (got < 0 && errno == EINTR);
    answer->said[sizeof(answer->said) - 1] = '\0';
    return got == (ssize_t)sizeof(*answer);
}

enum web_password web_helper_password(int helper, const char *password)
{
    struct order order = {.what = ORDER_PASSWORD};
    static struct answer answer;

    snprintf(order.text, sizeof(order.text), "%s", password);
    return ask(helper, &order, &answer) ? answer.password : WEB_NO_HELPER;
}

bool web_helper_set(int helper, enum web_setting setting, const char *value,
                    char said[WEB_SAID_SIZE])
{
    struct order order = {.what = ORDER_SET, .setting = setting};
    static struct answer answer;

    snprintf(order.text, sizeof(order.text), "%s", value);
    if (!ask(helper, &order, &answer)) {
        snprintf(said, WEB_SAID_SIZE, "The page's service is ending; nothing was changed.");
        return false;
    }
    memcpy(said, answer.said, WEB_SAID_SIZE);
    return answer.done;
}

/* ---- in root's half ---- */

static enum web_password check(const char *data, const char *password)
{
    int result = odidctl_check_password(data, password);

    return result > 0 ? WEB_PASSWORD_RIGHT : result == 0 ? WEB_PASSWORD_WRONG : WEB_PASSWORD_NONE;
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
static void set_and_exit(const struct odidctl_places *places, const char *key, char *value,
                         int said)
{
    if (dup2(said, STDOUT_FILENO) < 0 || dup2(said, STDERR_FILENO) < 0) {
        _exit(ODIDCTL_NOT_GOOD);
    }
    setvbuf(stdout, NULL, _IONBF, 0); /* in the order in which it is said */
    exit(odidctl_set(places, key, value));
}

static void set(const struct odidctl_places *places, struct order *order, struct answer *answer)
{
    int ends[2], status = -1;
    pid_t child;

    if (odidctl_armed(places)) {
        snprintf(answer->said, sizeof(answer->said), "The aircraft is armed: nothing was changed.");
        return;
    }
    if (pipe2(ends, O_CLOEXEC) < 0) {
        snprintf(answer->said, sizeof(answer->said), "Nothing was changed: %s.", strerror(errno));
        return;
    }
    fflush(NULL); /* not twice */
    child = fork();
    if (child == 0) {
        set_and_exit(places, keys[order->setting], order->text, ends[1]);
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

void web_helper_serve(int orders, const struct odidctl_places *places)
{
    static struct answer answer;
    struct order order;
    ssize_t got;

    /* MSG_TRUNC: the length as it was sent, so that a longer one isn't taken for an order. */
    while ((got = recv(orders, &order, sizeof(order), MSG_TRUNC)) > 0 ||
           (got < 0 && errno == EINTR)) {
        if (got != (ssize_t)sizeof(order)) {
            continue;
        }
        order.text[sizeof(order.text) - 1] = '\0';
        memset(&answer, 0, sizeof(answer));
        if (order.what == ORDER_PASSWORD) {
            answer.password = check(places->data, order.text);
        } else if (order.what == ORDER_SET && (unsigned)order.setting <= WEB_SERIAL) {
            set(places, &order, &answer);
        }
        explicit_bzero(&order, sizeof(order));
        if (send(orders, &answer, sizeof(answer), MSG_NOSIGNAL) < 0) {
            break;
        }
    }
}
