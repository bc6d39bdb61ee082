################################################################################
#
# libbluetooth
#
################################################################################

LIBBLUETOOTH_VERSION = 5.79
LIBBLUETOOTH_SOURCE = bluez-$(LIBBLUETOOTH_VERSION).tar.xz
LIBBLUETOOTH_SITE = $(BR2_KERNEL_MIRROR)/linux/bluetooth
# Its folder on Buildroot's own server, which is asked when the mirror doesn't answer.
LIBBLUETOOTH_DL_SUBDIR = bluez5_utils
LIBBLUETOOTH_LICENSE = GPL-2.0+, LGPL-2.1+
LIBBLUETOOTH_LICENSE_FILES = COPYING COPYING.LIB
LIBBLUETOOTH_CPE_ID_VENDOR = bluez
LIBBLUETOOTH_CPE_ID_PRODUCT = bluez
LIBBLUETOOTH_INSTALL_STAGING = YES

LIBBLUETOOTH_HEADERS = bluetooth.h hci.h hci_lib.h

# Its own configure script asks for GLib and D-Bus, which these files don't use.
define LIBBLUETOOTH_BUILD_CMDS
	ln -sfn . $(@D)/lib/bluetooth
	$(TARGET_CC) $(TARGET_CFLAGS) $(TARGET_LDFLAGS) -fPIC -shared \
		-Wl,-soname,libbluetooth.so.3 -I$(@D)/lib -I$(@D) \
		-o $(@D)/libbluetooth.so.3 \
		$(addprefix $(@D)/lib/,bluetooth.c hci.c sdp.c uuid.c)
endef

define LIBBLUETOOTH_INSTALL_STAGING_CMDS
	$(INSTALL) -D -m 0755 $(@D)/libbluetooth.so.3 \
		$(STAGING_DIR)/usr/lib/libbluetooth.so.3
	ln -sf libbluetooth.so.3 $(STAGING_DIR)/usr/lib/libbluetooth.so
	$(foreach header,$(LIBBLUETOOTH_HEADERS), \
		$(INSTALL) -D -m 0644 $(@D)/lib/$(header) \
			$(STAGING_DIR)/usr/include/bluetooth/$(header)
	)
	mkdir -p $(STAGING_DIR)/usr/lib/pkgconfig
	sed -e 's,@prefix@,/usr,; s,@exec_prefix@,/usr,; s,@libdir@,/usr/lib,' \
		-e 's,@includedir@,/usr/include,; s,@VERSION@,$(LIBBLUETOOTH_VERSION),' \
		$(@D)/lib/bluez.pc.in >$(STAGING_DIR)/usr/lib/pkgconfig/bluez.pc
endef

define LIBBLUETOOTH_INSTALL_TARGET_CMDS
	$(INSTALL) -D -m 0755 $(@D)/libbluetooth.so.3 \
		$(TARGET_DIR)/usr/lib/libbluetooth.so.3
endef

$(eval $(generic-package))
