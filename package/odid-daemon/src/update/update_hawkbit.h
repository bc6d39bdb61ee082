/*
 * hawkBit's client, which is a part of SWUpdate, and when it is left alone: its
 * server, which doesn't know why an update came to nothing, would begin the same
 * at once, again and again, and the aircraft would stay on the ground. So for ten
 * minutes SWUpdate is without it, and twice as long each time, up to 160, until an
 * update comes through: a server that goes on so gets less and less of the day.
 *
 * One process has it once. In the process's loop (loop.h).
 */
#ifndef ODID_UPDATE_HAWKBIT_H
#define ODID_UPDATE_HAWKBIT_H

#include <stdbool.h>
#include <stdint.h>

/*
 * is_idle: no update is going on. restart: SWUpdate is ended, and starts again as it
 * is now to be. A pause that an earlier process began counts from now on.
 */
void update_hawkbit_begin(bool (*is_idle)(void), void (*restart)(void), int64_t now_us);

/* While no update is going on: settings that concern it were saved, and SWUpdate is ended for them.
 */
void update_hawkbit_follow_configuration(void);

/* Is a server asked for updates at all? */
bool update_hawkbit_is_asked(void);

/* Leaves it alone from the next start of SWUpdate on. Without a server: nothing. */
void update_hawkbit_pause(int64_t now_us);

/* The same for an update that broke off, once its server has been told so, for 15 s. */
void update_hawkbit_report_and_pause(int64_t now_us);
bool update_hawkbit_reports(int64_t now_us);

/* One of its server's updates came to nothing before it was looked at closer. It may; but from the
 * second one in a row on the same is done. */
void update_hawkbit_failed(int64_t now_us);

/*
 * SWUpdate ended, and we haven't ended it. Its client does that by itself over an answer that it
 * doesn't understand, at each start. It is left alone, and the fault hawkbit-server says so, after
 * three times without ten minutes of quiet between them; at once where that broke off (broke_off)
 * somebody else's update, which has to come in. Not counted: the end for settings that were saved.
 */
void update_hawkbit_lost(bool broke_off, int64_t now_us);

/* An update came through: the next pause is a short one again. */
void update_hawkbit_came_through(void);

#endif
