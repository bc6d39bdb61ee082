################################################################################
#
# mavlink-router
#
################################################################################

# The release v4, by its commit: a tag can be moved.
MAVLINK_ROUTER_VERSION = 42529d55b665e0a9a29e424e186f514c56c2e5b5
MAVLINK_ROUTER_SITE = https://github.com/mavlink-router/mavlink-router.git
MAVLINK_ROUTER_SITE_METHOD = git
MAVLINK_ROUTER_LICENSE = Apache-2.0
MAVLINK_ROUTER_LICENSE_FILES = LICENSE
MAVLINK_ROUTER_DEPENDENCIES = mavlink-c-library-v2
MAVLINK_ROUTER_CONF_OPTS = -Dsystemdsystemunitdir=/usr/lib/systemd/system
# dedup.h uses uint32_t without asking for it, which later compilers mind; upstream has it since 2026
# (pull request 476).
MAVLINK_ROUTER_CXXFLAGS = $(TARGET_CXXFLAGS) -include cstdint

# Its submodule is MAVLink as of 2021, which lacks Remote ID's SYSTEM_UPDATE: the one MAVLink of
# this layer takes its place, for mavlink-router and odid-daemon alike.
define MAVLINK_ROUTER_USE_MAVLINK
	rm -rf $(@D)/modules/mavlink_c_library_v2
	mkdir -p $(@D)/modules
	ln -s $(STAGING_DIR)/usr/include/mavlink/v2.0 \
		$(@D)/modules/mavlink_c_library_v2
endef
MAVLINK_ROUTER_PRE_CONFIGURE_HOOKS += MAVLINK_ROUTER_USE_MAVLINK

# It asks git for its version, and there is no git here. Of the rest, its tests would be compiled
# whenever this machine has GoogleTest, its examples always; nothing of either is installed.
define MAVLINK_ROUTER_ONLY_ROUTER
	$(SED) 's/^    GIT_VERSION="VERSION"/    GIT_VERSION="v4"/' \
		$(@D)/tools/meson-vcs-tag.sh
	$(SED) "s/^dep_gtest = .*/dep_gtest = disabler()/; /^subdir('examples')/d" \
		$(@D)/meson.build
endef
MAVLINK_ROUTER_POST_PATCH_HOOKS += MAVLINK_ROUTER_ONLY_ROUTER

# There is no systemd.
define MAVLINK_ROUTER_REMOVE_UNIT
	rm -rf $(TARGET_DIR)/usr/lib/systemd
endef
MAVLINK_ROUTER_POST_INSTALL_TARGET_HOOKS += MAVLINK_ROUTER_REMOVE_UNIT

$(eval $(meson-package))
