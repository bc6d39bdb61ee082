# The release image, made by Buildroot. Part of the project's Makefile.
#
#   BOARD=cm4|qemu         which machine (default: cm4)
#   BUILDROOT_DIR=<dir>    a Buildroot of your own instead of the pinned one
#   DL_DIR=<dir>           where sources are kept (default: build/sources); with all of them there
#                          (make source) nothing is fetched
#   IMAGE_CONFIG=<file>    Buildroot options that differ on your machine: a mirror, a toolchain
#   IMAGE_OUT=<dir>        where it is built (default: build/image/<board>)

BUILDROOT_VERSION = 2025.02.16
BUILDROOT_COMMIT = 135af563b945b8c3d18f8fd370370075b9edb140
BUILDROOT_URL = https://gitlab.com/buildroot.org/buildroot.git
BUILDROOT_DIR ?= build/buildroot-$(BUILDROOT_VERSION)

BOARD ?= cm4
DL_DIR ?= build/sources
IMAGE_OUT ?= build/image/$(BOARD)
IMAGE_VERSION = $(shell sed -n 's/^project.odid-daemon VERSION \([0-9.]*\).*/\1/p' \
	$(DAEMON)/CMakeLists.txt)
IMAGE_NAME = odid-$(BOARD)-$(IMAGE_VERSION).img

# The same commit, the same bytes.
IMAGE_TIME := $(or $(SOURCE_DATE_EPOCH),$(shell git log -1 --format=%ct))
# MAKEFLAGS: the project's own --no-builtin-rules is not for other people's makefiles.
BUILDROOT_MAKE = MAKEFLAGS= SOURCE_DATE_EPOCH=$(IMAGE_TIME) $(MAKE) --no-print-directory -C $(BUILDROOT_DIR) \
	O=$(abspath $(IMAGE_OUT)) BR2_EXTERNAL=$(CURDIR)/br2-external BR2_DL_DIR=$(abspath $(DL_DIR))

# Buildroot says a lot: all of it is in the log, its headings are shown. $(1) names the log.
buildroot = @{ $(BUILDROOT_MAKE) $(2) || echo failed; } 2>&1 | tee $(IMAGE_OUT)/$(1).log | \
	sed -n -u 's/\x1b\[[0-9]*m//g; s/^>>> */$(BOARD): /p'; \
	if [ "$$(tail -n 1 $(IMAGE_OUT)/$(1).log)" = failed ]; then \
		tail -n 40 $(IMAGE_OUT)/$(1).log >&2; \
		echo "The whole log: $(IMAGE_OUT)/$(1).log. What is built stays: make image goes on." >&2; \
		exit 1; \
	fi

.PHONY: image source legal
# The daemon's sources are this project's: Buildroot doesn't look whether they changed.
image: $(IMAGE_OUT)/defconfig
	$(call buildroot,build,odid-daemon-rebuild all)
	@cd $(IMAGE_OUT)/images && xz -T0 -c disk.img >$(IMAGE_NAME).xz && \
		sha256sum $(IMAGE_NAME).xz >SHA256SUMS
	@echo "image: $(IMAGE_OUT)/images/$(IMAGE_NAME).xz"

# Everything that building needs, for those who build without a network, or in ten years.
source: $(IMAGE_OUT)/defconfig
	$(call buildroot,source,source)

# Licences and sources, as they have to be passed on.
legal: $(IMAGE_OUT)/defconfig
	$(call buildroot,legal,legal-info)

# Kept when nothing in it is new: Buildroot goes on where it was.
$(IMAGE_OUT)/defconfig: configs/odid_$(BOARD)_defconfig $(IMAGE_CONFIG) | $(BUILDROOT_DIR)/Makefile
	@mkdir -p $(IMAGE_OUT) $(DL_DIR)
	@board/common/merge-config.sh configs/odid_$(BOARD)_defconfig $(IMAGE_CONFIG) >$@.part
	@$(BUILDROOT_MAKE) -s BR2_DEFCONFIG=$(abspath $@.part) defconfig >/dev/null
	@mv $@.part $@
	@sed -i 's,^BR2_DEFCONFIG=.*,BR2_DEFCONFIG="$(abspath $@)",' $(IMAGE_OUT)/.config

build/buildroot-$(BUILDROOT_VERSION)/Makefile:
	@rm -rf $(@D).part
	@git clone --quiet --depth 1 --branch $(BUILDROOT_VERSION) $(BUILDROOT_URL) $(@D).part
	@if [ "$$(git -C $(@D).part rev-parse HEAD)" != $(BUILDROOT_COMMIT) ]; then \
		echo "$(BUILDROOT_URL): tag $(BUILDROOT_VERSION) is not commit $(BUILDROOT_COMMIT)" >&2; exit 1; \
	fi
	@mv $(@D).part $(@D)
