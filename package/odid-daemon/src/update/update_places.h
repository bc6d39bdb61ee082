/* Where on the appliance everything lies that an update has to do with. */
#ifndef ODID_UPDATE_PLACES_H
#define ODID_UPDATE_PLACES_H

#include "appliance/appliance_marks.h"
#include "appliance/places.h"

#ifndef ROOT
#define ROOT "" /* tests have their own */
#endif

#define STATE ROOT PLACES_STATE
#define DATA ROOT PLACES_DATA
#define RUN_DIR ROOT PLACES_RUN_DIR
#define FAULTS ROOT PLACES_FAULTS
#define SWUPDATE ROOT PLACES_SWUPDATE
#define VERSION_FILE ROOT PLACES_VERSION
#define CONFIGURATION ROOT PLACES_CONFIG
#define SERVICES ROOT "/run/service"
#define INSTALLER ROOT "/run/pid/swupdate"
#define SLOTS ROOT "/dev/disk/odid/slot-" /* and a or b */
#define ENVIRONMENT_CONFIG ROOT "/run/fw_env.config"
#define ENVIRONMENT_DEFAULTS ROOT "/etc/u-boot-initial-env"
/* What SWUpdate has unpacked, and verified before it asks. */
#define DESCRIPTION SWUPDATE "/sw-description"
/* Not empty where hawkBit is asked for updates. Another file once settings that concern it are
 * saved. */
#define HAWKBIT ROOT "/run/swupdate.hawkbit"
/* While it is there SWUpdate starts without hawkBit, whose server would begin the same again. */
#define HAWKBIT_PAUSE STATE "/hawkbit-pause"
#define UPDATING STATE "/" APPLIANCE_UPDATING
#define IN_MEMORY STATE "/" APPLIANCE_IN_MEMORY
/* Maintenance is asked for: now; and over our restart. */
#define MAINTENANCE STATE "/" APPLIANCE_MAINTENANCE
#define MAINTENANCE_AGAIN DATA "/odid/" APPLIANCE_MAINTENANCE
/* Without one dropbear doesn't listen. */
#define SSH_KEYS DATA "/ssh/authorized_keys"

#endif
