/* What the appliance's programs tell each other by a file in its state that is there or isn't. */
#ifndef ODID_APPLIANCE_MARKS_H
#define ODID_APPLIANCE_MARKS_H

/*
 * There for as long as an update goes on: the daemon tells the autopilot not to
 * arm. odid-update makes it, and a boot script when a slot is on trial: root's,
 * so it lies in root's folder and not in the daemon's. A name there, made by a
 * daemon that was taken over, could lead root anywhere.
 */
#define APPLIANCE_UPDATING "updating"

/* Maintenance (/etc/sv/maintenance/run) is asked for. */
#define APPLIANCE_MAINTENANCE "maintenance-asked"

/* There while /data is in memory (S30data); empty: without the settings that were in it. */
#define APPLIANCE_IN_MEMORY "data-in-memory"

#endif
