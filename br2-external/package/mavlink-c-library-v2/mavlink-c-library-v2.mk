################################################################################
#
# mavlink-c-library-v2
#
################################################################################

# The repository has no releases: the commit is the version, of 2026-08-22.
MAVLINK_C_LIBRARY_V2_VERSION = 7e16bc08f14a4f8bfab474de831013a6455ee3da
MAVLINK_C_LIBRARY_V2_SITE = https://github.com/mavlink/c_library_v2.git
MAVLINK_C_LIBRARY_V2_SITE_METHOD = git
# The generated headers name no licence; their generator says MIT. One header has another one.
MAVLINK_C_LIBRARY_V2_LICENSE = MIT, BSD-3-Clause (mavlink_sha256.h)
MAVLINK_C_LIBRARY_V2_LICENSE_FILES = mavlink_sha256.h
MAVLINK_C_LIBRARY_V2_INSTALL_STAGING = YES
MAVLINK_C_LIBRARY_V2_INSTALL_TARGET = NO

# The dialects that mavlink-router (ardupilotmega) and odid-daemon (common) are compiled with, and
# those that these include.
MAVLINK_C_LIBRARY_V2_DIALECTS = \
	ardupilotmega common cubepilot csAirLink icarous loweheiser minimal \
	standard uAvionix

define MAVLINK_C_LIBRARY_V2_INSTALL_STAGING_CMDS
	mkdir -p $(STAGING_DIR)/usr/include/mavlink/v2.0
	cp -a $(@D)/*.h $(addprefix $(@D)/,$(MAVLINK_C_LIBRARY_V2_DIALECTS)) \
		$(STAGING_DIR)/usr/include/mavlink/v2.0/
endef

$(eval $(generic-package))
