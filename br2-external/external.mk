# The layer's packages, and what it adds to Buildroot's own.

include $(sort $(wildcard $(BR2_EXTERNAL_ODID_PATH)/package/*/*.mk))

ODID_BOARD_DIR = $(BR2_EXTERNAL_ODID_PATH)/../board

# --- Kernel and BusyBox are what their fragments name, and nothing else -----

# allnoconfig with the fragments as KCONFIG_ALLCONFIG; Buildroot would start from arm64's defconfig.
ODID_LINUX_CONFIG = $(BUILD_DIR)/odid-linux.config
LINUX_KCONFIG_DEFCONFIG = allnoconfig
LINUX_MAKE_ENV += KCONFIG_ALLCONFIG=$(ODID_LINUX_CONFIG)

$(ODID_LINUX_CONFIG): $(LINUX_KCONFIG_FRAGMENT_FILES)
	mkdir -p $(@D)
	cat $^ >$@
# The device tree is copied when the kernel is built, and Buildroot doesn't look whether it has changed.
$(LINUX_DIR)/.stamp_dotconfig: $(ODID_LINUX_CONFIG) $(call qstrip,$(BR2_LINUX_KERNEL_CUSTOM_DTS_PATH))

# Its default environment is a part of U-Boot; Buildroot notices fragments only.
$(UBOOT_DIR)/.stamp_dotconfig: $(call qstrip,$(BR2_TARGET_UBOOT_DEFAULT_ENV_FILE))

# BusyBox' allnoconfig knows no such file; a script of ours, shared with the bench, does the same.
define ODID_BUSYBOX_CONFIG
	cd $(@D) && PATH="$(BR_PATH)" $(abspath $(ODID_BOARD_DIR))/common/busybox-config.sh
endef
PACKAGES_BUSYBOX_CONFIG_FIXUPS += $(ODID_BUSYBOX_CONFIG)$(sep)

# --- Updates come by HTTP and HTTPS --------------------------------------------

# Who names an address, an update server's answer included, doesn't read this board's files by it.
LIBCURL_CONF_OPTS += --disable-file --disable-ftp --disable-mqtt

# --- No trace of the folder it was built in ------------------------------------

# Libtool and CMake link with the build folder as search path and take it out again, when they install or Buildroot's
# patchelf does: its length stays, in the string table. So it isn't put in: one image in each folder.
LIBUBOOTENV_CONF_OPTS += -DCMAKE_SKIP_RPATH=ON
define ODID_NO_RPATH
	$(SED) 's/^hardcode_into_libs=.*/hardcode_into_libs=no/; s/^hardcode_libdir_flag_spec=.*/hardcode_libdir_flag_spec=/; s/^runpath_var=.*/runpath_var=/' \
		$(@D)/libtool
endef
LIBNL_POST_CONFIGURE_HOOKS += ODID_NO_RPATH
LIBCURL_POST_CONFIGURE_HOOKS += ODID_NO_RPATH
LIBNFTNL_POST_CONFIGURE_HOOKS += ODID_NO_RPATH
NFTABLES_POST_CONFIGURE_HOOKS += ODID_NO_RPATH

# --- A wish that did not survive is an error --------------------------------

ODID_CHECK_CONFIG = $(ODID_BOARD_DIR)/common/check-config.sh

define ODID_CHECK_LINUX
	$(ODID_CHECK_CONFIG) "kernel" $(@D)/.config $(LINUX_KCONFIG_FRAGMENT_FILES)
endef
LINUX_PRE_BUILD_HOOKS += ODID_CHECK_LINUX

define ODID_CHECK_BUSYBOX
	$(ODID_CHECK_CONFIG) "BusyBox" $(@D)/.config $(ODID_BOARD_DIR)/common/busybox.fragment
endef
BUSYBOX_PRE_BUILD_HOOKS += ODID_CHECK_BUSYBOX

define ODID_CHECK_UBOOT
	$(ODID_CHECK_CONFIG) "U-Boot" $(@D)/.config $(UBOOT_KCONFIG_FRAGMENT_FILES)
endef
UBOOT_PRE_BUILD_HOOKS += ODID_CHECK_UBOOT

define ODID_CHECK_SWUPDATE
	$(ODID_CHECK_CONFIG) "SWUpdate" $(@D)/.config $(ODID_BOARD_DIR)/common/swupdate.fragment
endef
SWUPDATE_PRE_BUILD_HOOKS += ODID_CHECK_SWUPDATE

# What somebody's own layer sets replaces what the defconfig says; of these lists ours have to stay in them.
ODID_LISTS = ROOTFS_DEVICE_TABLE ROOTFS_USERS_TABLES ROOTFS_OVERLAY ROOTFS_POST_BUILD_SCRIPT ROOTFS_POST_IMAGE_SCRIPT \
	LINUX_KERNEL_CONFIG_FRAGMENT_FILES
ODID_LISTED = $(filter $(BR2_EXTERNAL_ODID_PATH)/%,$(call qstrip,$(BR2_$(1))))

ifeq ($(BR_BUILDING),y)
$(foreach list,$(ODID_LISTS),$(if $(call ODID_LISTED,$(list)),,\
	$(error BR2_$(list)="$(call qstrip,$(BR2_$(list)))" lacks this project's own: put them before yours (docs/extending.md))))
ifneq ($(shell $(ODID_CHECK_CONFIG) "Buildroot" $(BR2_CONFIG) $(call qstrip,$(BR2_DEFCONFIG)) || echo lost),)
$(error see above)
endif
endif
