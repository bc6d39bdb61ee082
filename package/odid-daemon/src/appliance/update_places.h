/* Where on the appliance everything lies that an update has to do with. */
#ifndef ODID_UPDATE_PLACES_H
#define ODID_UPDATE_PLACES_H

#define STATE "/run/odid-appliance"
#define DATA "/data"
#define RUN_DIR "/run/odid"
#define VERSION_FILE "/etc/odid/version"
#define SERVICES "/run/service"
#define INSTALLER "/run/pid/swupdate"
#define FAULTS "/run/faults"
#define SLOTS "/dev/disk/odid/slot-" /* and a or b */
#define ENVIRONMENT_CONFIG "/run/fw_env.config"
#define ENVIRONMENT_DEFAULTS "/etc/u-boot-initial-env"
/* What SWUpdate has unpacked, and verified before it asks. */
#define DESCRIPTION "/run/swupdate/sw-description"
/* Not empty where hawkBit is asked for updates. Another file once settings that concern it are
 * saved. */
#define HAWKBIT "/run/swupdate.hawkbit"
/* While it is there SWUpdate starts without hawkBit, whose server would begin the same again. */
#define HAWKBIT_PAUSE STATE "/hawkbit-pause"
/* Maintenance (/etc/sv/maintenance/run) is asked for: now; and over our restart. */
#define MAINTENANCE STATE "/maintenance-asked"
#define MAINTENANCE_AGAIN DATA "/odid/maintenance-asked"
#define CONFIGURATION DATA "/odid/odid.conf"
/* There while /data is in memory (S30data); empty: without the settings that were in it. */
#define IN_MEMORY STATE "/data-in-memory"
/* Without one dropbear doesn't listen. */
#define SSH_KEYS DATA "/ssh/authorized_keys"

#endif
