################################################################################
#
# opendroneid-core-c
#
################################################################################

# Its releases are older than the standard's current edition: a commit of 2026-02-04.
OPENDRONEID_CORE_C_VERSION = beb5639c78d8f05d9debe08a666c6a5f1cb0fa02
OPENDRONEID_CORE_C_SITE = https://github.com/opendroneid/opendroneid-core-c.git
OPENDRONEID_CORE_C_SITE_METHOD = git
OPENDRONEID_CORE_C_LICENSE = Apache-2.0
OPENDRONEID_CORE_C_LICENSE_FILES = LICENSE
OPENDRONEID_CORE_C_INSTALL_STAGING = YES
OPENDRONEID_CORE_C_INSTALL_TARGET = NO

# Not by its CMakeLists.txt: that one compiles with -O0 and installs no header.
define OPENDRONEID_CORE_C_BUILD_CMDS
	$(TARGET_CC) $(TARGET_CFLAGS) -fPIC -c \
		-o $(@D)/opendroneid.o $(@D)/libopendroneid/opendroneid.c
	rm -f $(@D)/libopendroneid.a
	$(TARGET_AR) rcs $(@D)/libopendroneid.a $(@D)/opendroneid.o
endef

define OPENDRONEID_CORE_C_INSTALL_STAGING_CMDS
	$(INSTALL) -D -m 0644 $(@D)/libopendroneid.a \
		$(STAGING_DIR)/usr/lib/libopendroneid.a
	$(INSTALL) -D -m 0644 $(@D)/libopendroneid/opendroneid.h \
		$(STAGING_DIR)/usr/include/opendroneid.h
	$(INSTALL) -D -m 0644 $(OPENDRONEID_CORE_C_PKGDIR)/libopendroneid.pc \
		$(STAGING_DIR)/usr/lib/pkgconfig/libopendroneid.pc
endef

$(eval $(generic-package))
