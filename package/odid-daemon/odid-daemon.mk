################################################################################
#
# odid-daemon
#
################################################################################

# Its version's home is CMakeLists.txt; its source is this folder.
ODID_DAEMON_VERSION = $(shell sed -n \
	's/^project.odid-daemon VERSION \([0-9.]*\).*/\1/p' \
	$(BR2_EXTERNAL_ODID_PATH)/package/odid-daemon/CMakeLists.txt)
ODID_DAEMON_SITE = $(BR2_EXTERNAL_ODID_PATH)/package/odid-daemon
ODID_DAEMON_SITE_METHOD = local
ODID_DAEMON_LICENSE = Apache-2.0
ODID_DAEMON_LICENSE_FILES = LICENSE
ODID_DAEMON_DEPENDENCIES = \
	host-pkgconf inih json-c libbluetooth libcap-ng libmicrohttpd libnl libseccomp \
	mavlink-c-library-v2 nettle opendroneid-core-c swupdate

# The project's licence is in its top folder.
define ODID_DAEMON_COPY_LICENSE
	cp $(BR2_EXTERNAL_ODID_PATH)/../LICENSE $(@D)/
endef
ODID_DAEMON_POST_RSYNC_HOOKS += ODID_DAEMON_COPY_LICENSE

$(eval $(cmake-package))
