/*
 * Which of several serial ports has the autopilot: the one on which an
 * autopilot speaks (MAVLink component 1). All are listened to at once, each by a process of its
 * own, and spoken to as by a companion computer, for some autopilots are silent until somebody is
 * there.
 */
#ifndef ODID_AUTOPILOT_FIND_H
#define ODID_AUTOPILOT_FIND_H

#define AUTOPILOT_PORTS_MAX 16

/*
 * ports: paths, the one that is most likely first; it is preferred for a second
 * to one that speaks before. Only the first AUTOPILOT_PORTS_MAX count.
 * seconds: how long to listen; 0: for ever. asker: a pipe to whoever wants to
 * know: when nobody reads it any more, that is the end; -1: none. Returns the
 * port's index; -ENODEV when none speaks, or none is left; -EPIPE. A device that
 * doesn't answer holds nobody up but its own process, which may outlast this.
 * All children of the calling process are taken for those.
 */
int autopilot_find(char *const ports[], unsigned count, unsigned baud, unsigned seconds, int asker);

#endif
