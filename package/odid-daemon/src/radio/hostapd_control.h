/*
 * hostapd's control interface: requests and replies as UNIX datagrams
 * (hostapd's wpa_ctrl protocol). One request at a time, never blocking.
 */
#ifndef ODID_HOSTAPD_CONTROL_H
#define ODID_HOSTAPD_CONTROL_H

#include <errno.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/loop.h"

/* A reply that takes longer means that hostapd hangs. */
#define HOSTAPD_REPLY_US 1000000
/* It passed descriptors along, which no hostapd does: it isn't hostapd's own program that speaks.
 */
#define HOSTAPD_PASSED (-EPROTO)

/* reply is NUL-terminated, without its newline at the end. */
typedef void hostapd_reply_fn(void *context, const char *reply, int64_t now_us);
/*
 * The socket is gone, or a reply did not come in time (ETIMEDOUT); closed already. error: -errno,
 * or HOSTAPD_PASSED.
 */
typedef void hostapd_lost_fn(void *context, int error, int64_t now_us);

struct hostapd_control {
    struct loop_watch watch;
    struct loop_timer timeout;
    struct loop_pause pause;
    bool waiting;       /* for a reply */
    unsigned passed;    /* times that descriptors came */
    int64_t shunned_us; /* until then it isn't connected to, for that */
    hostapd_reply_fn *on_reply;
    hostapd_lost_fn *on_lost;
    void *context;
};

/* on_reply is called for each request's reply; unsolicited "<N>..." events are skipped. */
void hostapd_control_init(struct hostapd_control *control, hostapd_reply_fn *on_reply,
                          hostapd_lost_fn *on_lost, void *context);
/*
 * Connects to <hostapd_dir>/<iface>. Our end has a name of the kernel's choice (unix(7), autobind):
 * hostapd, whose user isn't ours, can answer there, and nothing of it is left behind. It is another
 * one each time: what a hostapd that hung answers too late is addressed to nobody, instead of being
 * taken for the answer to what was asked since. Returns 0, or -errno; HOSTAPD_PASSED where it did
 * so before: it is left alone for a minute then, and twice as long each time. Another socket of
 * that name ends this no sooner: who is hostapd can make as many as it likes.
 */
int hostapd_control_open(struct hostapd_control *control, const char *hostapd_dir,
                         const char *iface);
void hostapd_control_close(struct hostapd_control *control);
/* Returns 0, or -errno (EBUSY: a reply is awaited), or HOSTAPD_PASSED. What came unasked before is
 * passed over. */
int hostapd_control_request(struct hostapd_control *control, const char *request, int64_t now_us);

/* The reply that is awaited may take until then. */
void hostapd_control_wait(struct hostapd_control *control, int64_t until_us);

/* Sends without awaiting an answer, whatever else is awaited: for the orderly end. */
void hostapd_control_tell(struct hostapd_control *control, const char *request);

#endif
