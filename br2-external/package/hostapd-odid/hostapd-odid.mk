################################################################################
#
# hostapd-odid
#
################################################################################

HOSTAPD_ODID_VERSION = 2.10
HOSTAPD_ODID_SOURCE = hostapd-$(HOSTAPD_ODID_VERSION).tar.gz
HOSTAPD_ODID_SITE = https://w1.fi/releases
# Its folder on Buildroot's own server, which is asked when w1.fi doesn't answer: that has it under this name.
HOSTAPD_ODID_DL_SUBDIR = hostapd
HOSTAPD_ODID_SUBDIR = hostapd
HOSTAPD_ODID_LICENSE = BSD-3-Clause
HOSTAPD_ODID_LICENSE_FILES = README
HOSTAPD_ODID_CPE_ID_VENDOR = w1.fi
HOSTAPD_ODID_CPE_ID_PRODUCT = hostapd
HOSTAPD_ODID_DEPENDENCIES = host-pkgconf libnl

# DPP and PKEX only, which are not built.
HOSTAPD_ODID_IGNORE_CVES += CVE-2022-37660
# RADIUS only, which is not built.
HOSTAPD_ODID_IGNORE_CVES += CVE-2025-24912

define HOSTAPD_ODID_CONFIGURE_CMDS
	cp $(HOSTAPD_ODID_PKGDIR)/hostapd.config $(@D)/hostapd/.config
endef

define HOSTAPD_ODID_BUILD_CMDS
	$(TARGET_MAKE_ENV) CFLAGS="$(TARGET_CFLAGS)" LDFLAGS="$(TARGET_LDFLAGS)" \
		$(MAKE) CC="$(TARGET_CC)" PKG_CONFIG="$(PKG_CONFIG_HOST_BINARY)" \
		-C $(@D)/$(HOSTAPD_ODID_SUBDIR) hostapd hostapd_cli
endef

define HOSTAPD_ODID_INSTALL_TARGET_CMDS
	$(INSTALL) -D -m 0755 $(@D)/hostapd/hostapd $(TARGET_DIR)/usr/sbin/hostapd
	$(INSTALL) -D -m 0755 $(@D)/hostapd/hostapd_cli \
		$(TARGET_DIR)/usr/bin/hostapd_cli
endef

$(eval $(generic-package))
