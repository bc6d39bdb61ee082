#include "beacons/nl80211.h"

#include <netlink/genl/ctrl.h>
#include <netlink/genl/genl.h>
#include <stdbool.h>

static struct nl_sock *radios;
static int family;

struct answers {
    nl80211_take *take;
    void *context;
    bool awaited; /* the end of them: an acknowledgement, or an error */
    int error;    /* libnl's, negative */
};

int nl80211_open(void)
{
    int result;

    radios = nl_socket_alloc();
    result = radios == NULL ? -NLE_NOMEM : genl_connect(radios);
    if (result == 0) {
        family = genl_ctrl_resolve(radios, NL80211_GENL_NAME);
    }
    return result < 0 ? result : family < 0 ? family : 0;
}

struct nl_msg *nl80211_question(enum nl80211_commands command, int flags, unsigned interface)
{
    struct nl_msg *question = nlmsg_alloc();

    if (question == NULL) {
        return NULL;
    }
    if (genlmsg_put(question, NL_AUTO_PORT, NL_AUTO_SEQ, family, 0, flags, (uint8_t)command, 0) ==
            NULL ||
        (interface != 0 && nla_put_u32(question, NL80211_ATTR_IFINDEX, interface) < 0)) {
        nlmsg_free(question);
        return NULL;
    }
    return question;
}

static int take_answer(struct nl_msg *message, void *context)
{
    struct nlattr *attributes[NL80211_ATTR_MAX + 1];
    struct answers *answers = context;

    if (answers->take != NULL &&
        genlmsg_parse(nlmsg_hdr(message), 0, attributes, NL80211_ATTR_MAX, NULL) == 0) {
        answers->take(attributes, answers->context);
    }
    return NL_OK;
}

static int take_end(struct nl_msg *message, void *context)
{
    struct answers *answers = context;

    (void)message;
    answers->awaited = false;
    return NL_STOP;
}

static int take_error(struct sockaddr_nl *address, struct nlmsgerr *error, void *context)
{
    struct answers *answers = context;

    (void)address;
    answers->awaited = false;
    answers->error = -nl_syserr2nlerr(error->error);
    return NL_STOP;
}

int nl80211_ask(struct nl_msg *question, nl80211_take *take, void *context)
{
    struct answers answers = {.take = take, .context = context, .awaited = true};
    int result;

    if (question == NULL || (radios == NULL && nl80211_open() < 0)) {
        nlmsg_free(question);
        return -NLE_NOMEM;
    }
    nl_socket_modify_cb(radios, NL_CB_VALID, NL_CB_CUSTOM, take_answer, &answers);
    nl_socket_modify_cb(radios, NL_CB_ACK, NL_CB_CUSTOM, take_end, &answers);
    nl_socket_modify_cb(radios, NL_CB_FINISH, NL_CB_CUSTOM, take_end, &answers);
    nl_socket_modify_err_cb(radios, NL_CB_CUSTOM, take_error, &answers);
    result = nl_send_auto(radios, question);
    nlmsg_free(question);
    while (result >= 0 && answers.awaited) {
        result = nl_recvmsgs_default(radios);
    }
    result = answers.error < 0 ? answers.error : result < 0 ? result : 0;
    /* Of what is still to come nothing answers another question; or cfg80211 was loaded anew. */
    if (result < 0 && (answers.error == 0 || result == -NLE_OBJ_NOTFOUND)) {
        nl_socket_free(radios);
        (void)nl80211_open(); /* where that fails so does the next question */
    }
    return result;
}
