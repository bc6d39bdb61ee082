/* What is said and kept about updates: how long it gets, and in which files. */
#ifndef ODID_UPDATE_NAMES_H
#define ODID_UPDATE_NAMES_H

#define UPDATE_SENTENCE_SIZE 240
#define UPDATE_VERSION_SIZE 64
#define UPDATE_IDENTITY_SIZE 128 /* of a file: which one it is */

/* What a request to SWUpdate says of itself when nobody asked for the bundle: a stick's. SWUpdate
 * repeats it when it begins, before it asks the gate. */
#define UPDATE_UNATTENDED "unattended"

#define UPDATE_STATE_FILE "update-state.json" /* in /run/odid-appliance */
#define UPDATE_RESULT_FILE "odid/update.json" /* in /data */
#define UPDATE_RECORD_FILE "odid/trial.json"  /* in /data */
#define UPDATE_BACK_FILE "odid/rolled-back"   /* in /data: the version, for sticks */
#define UPDATE_STICK_FILE "odid/stick-failed" /* in /data: sticks' files that were tried last */
#define UPDATE_STICK_FAILURES_FILE "stick-failures" /* in /run/odid-appliance: how many did */

#endif
