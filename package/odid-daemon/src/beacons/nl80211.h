/*
 * Questions to the kernel's radios (nl80211), one at a time. A radio that hangs holds up who asks.
 */
#ifndef ODID_NL80211_H
#define ODID_NL80211_H

#include <linux/nl80211.h>
#include <netlink/attr.h>
#include <netlink/msg.h>

/* Returns 0, or libnl's error, negative. */
int nl80211_open(void);

/* A question of that interface; flags: NLM_F_DUMP where several answers are awaited. NULL: no
 * memory. interface: its index, 0 for all. */
struct nl_msg *nl80211_question(enum nl80211_commands command, int flags, unsigned interface);

/* What is done with each answer. Those that aren't in it are NULL. */
typedef void nl80211_take(struct nlattr *attributes[NL80211_ATTR_MAX + 1], void *context);

/* Sends and frees the question (one that is NULL had no memory), and waits for its end. take: NULL
 * where only that is awaited. Returns 0, or libnl's error, negative. */
int nl80211_ask(struct nl_msg *question, nl80211_take *take, void *context);

#endif
