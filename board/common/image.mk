# The release image, made by Buildroot: docs/building.md. Part of the project's Makefile.
#
#   BOARD=<board>          which machine, of those in configs (default: cm4)
#   DL_DIR=<dir>           where sources are kept, Buildroot itself among them (default: build/sources).
#                          With all of them there (make source) nothing is fetched.
#   BUILDROOT_DIR=<dir>    a Buildroot of your own instead of the pinned one
#   IMAGE_LAYER=<dir>      a layer of your own on top of this one: docs/extending.md
#   IMAGE_CONFIG=<files>   Buildroot options beside the defconfig's, or in place of them: what your
#                          layer adds, a mirror, a toolchain
#   IMAGE_OUT=<dir>        where it is built (default: build/image/<board>)

BUILDROOT_VERSION = 2025.02.16
BUILDROOT_COMMIT = 135af563b945b8c3d18f8fd370370075b9edb140
# The one after the other; the commit says what is right.
BUILDROOT_URLS = https://gitlab.com/buildroot.org/buildroot.git https://github.com/buildroot/buildroot.git

BOARD ?= cm4
DL_DIR ?= build/sources
BUILDROOT_PINNED = $(DL_DIR)/buildroot-$(BUILDROOT_VERSION)
BUILDROOT_DIR ?= $(BUILDROOT_PINNED)
IMAGE_OUT ?= build/image/$(BOARD)
IMAGE_OUTS = $(IMAGE_OUT)
IMAGE_VERSION = $(shell sed -n 's/^project.odid-daemon VERSION \([0-9.]*\).*/\1/p' \
	$(DAEMON_SOURCE)/CMakeLists.txt)

# Debian's packages for it; the rest that building needs, Buildroot makes for itself.
IMAGE_PACKAGES = bc bmap-tools build-essential bzip2 ca-certificates cpio file git openssl patch perl python3 \
	rsync unzip wget xxd xz-utils

# The same commit, the same bytes. Everything is dated 2026-01-01, so that what was built for an earlier
# commit and is still good has no other date in it; the commit's own time is in /etc/odid-release.
IMAGE_DATE = 1767225600
IMAGE_TIME = $(or $(SOURCE_DATE_EPOCH),$(shell git log -1 --format=%ct 2>/dev/null),\
	$(shell stat -c %Y $(DAEMON_SOURCE)/CMakeLists.txt))
# MAKEFLAGS: the project's own --no-builtin-rules is not for other people's makefiles. PYTHONHASHSEED:
# the bill of materials would be in another order each time. FORCE_...: tar's, for those who are root.
BUILDROOT_MAKE = MAKEFLAGS= PYTHONHASHSEED=0 FORCE_UNSAFE_CONFIGURE=1 SOURCE_DATE_EPOCH=$(IMAGE_DATE) \
	ODID_BUILD_TIME=$(IMAGE_TIME) ODID_TRUSTED=$(abspath $(KEYS))/trusted.pem \
	$(MAKE) --no-print-directory -C $(BUILDROOT_DIR) O=$(abspath $(IMAGE_OUT)) \
	BR2_EXTERNAL=$(CURDIR)/br2-external$(addprefix :,$(abspath $(IMAGE_LAYER))) \
	BR2_DL_DIR=$(abspath $(DL_DIR))

# Buildroot says a lot: all of it is in the log, its headings are shown. $(1) names the log.
buildroot = @{ $(BUILDROOT_MAKE) $(2) || echo failed; } 2>&1 | tee $(IMAGE_OUT)/$(1).log | \
	sed -n -u 's/\x1b\[[0-9]*m//g; s/^>>> */$(BOARD): /p'; \
	if [ "$$(tail -n 1 $(IMAGE_OUT)/$(1).log)" = failed ]; then \
		tail -n 40 $(IMAGE_OUT)/$(1).log >&2; \
		echo "The whole log: $(IMAGE_OUT)/$(1).log. What is built stays: the same command goes on." >&2; \
		exit 1; \
	fi

sbom = @$(BUILDROOT_MAKE) -s show-info | env PYTHONHASHSEED=0 board/common/bill-of-materials.sh $(abspath $(DL_DIR)) $(BUILDROOT_DIR) \
	$(IMAGE_OUT) odid-$(BOARD) $(IMAGE_VERSION)

# Buildroot doesn't look whether a package's recipe, patches or source have changed; for the layer's own we do.
changed-recipes = $(if $(wildcard $(IMAGE_OUT)/built),$(addsuffix -dirclean,$(filter-out odid-daemon,\
	$(shell find br2-external/package/*/ br2-external/patches/*/ -newer $(IMAGE_OUT)/built -type f | cut -d / -f 3 | sort -u))))

.PHONY: image source legal reproducible buildroot test-image image-host
image: $(IMAGE_OUT)/defconfig keys
	@board/common/licence-names.sh $(DL_DIR) $(BUILDROOT_DIR) || echo 'image: going on without it' >&2
	@touch $(IMAGE_OUT)/building
	$(call buildroot,build,$(changed-recipes) odid-daemon-rebuild all)
	@mv $(IMAGE_OUT)/building $(IMAGE_OUT)/built
	$(call buildroot,legal,legal-info)
	$(sbom)
	@board/common/pack-release.sh $(BOARD) $(IMAGE_OUT) odid-$(BOARD)-$(IMAGE_VERSION)

# Everything that building needs, for those who build without a network, or in ten years.
source: $(IMAGE_OUT)/defconfig
	$(call buildroot,source,source)
	@board/common/licence-names.sh $(DL_DIR) $(BUILDROOT_DIR)
	@echo 'source: all is in $(DL_DIR)'

# Licences and sources, as they have to be passed on with an image: docs/licences.md.
legal: $(IMAGE_OUT)/defconfig
	$(call buildroot,legal,legal-info)
	@echo 'legal: $(IMAGE_OUT)/legal-info'

# What make image has made, against the same made from nothing in another folder.
IMAGE_AGAIN = $(IMAGE_OUT)-made-once-more
reproducible: IMAGE_OUTS = $(IMAGE_OUT) $(IMAGE_AGAIN)
reproducible: image
	@rm -rf $(IMAGE_AGAIN)
	@$(MAKE) --no-print-directory image IMAGE_OUT=$(IMAGE_AGAIN)
	@board/common/compare-images.sh $(IMAGE_OUT) $(IMAGE_AGAIN)

# Anything else that Buildroot can, with all that the image is built with: GOALS=menuconfig.
buildroot: $(IMAGE_OUT)/defconfig
	@$(BUILDROOT_MAKE) $(or $(GOALS),$(error buildroot: which of Buildroot's goals? GOALS=menuconfig))

# What is in the built images, and the Compute Module's booted as far as QEMU can.
test-image: setup qemu-raspi
	@$(RUN) -m pytest tests/release -o cache_dir=build/pytest -ra

# Kept when nothing in it is new: Buildroot goes on where it was.
$(IMAGE_OUT)/defconfig: configs/odid_$(BOARD)_defconfig $(IMAGE_CONFIG) | image-host $(BUILDROOT_DIR)/Makefile
	@mkdir -p $(IMAGE_OUT) $(DL_DIR)
	@board/common/merge-config.sh configs/odid_$(BOARD)_defconfig $(IMAGE_CONFIG) >$@.part
	@$(BUILDROOT_MAKE) -s BR2_DEFCONFIG=$(abspath $@.part) defconfig >/dev/null
	@mv $@.part $@
	@[ ! -e $(IMAGE_OUT)/built ] || { \
		echo "$(BOARD): the configuration is new. What is built already stays as it was: Buildroot" && \
		echo "$(BOARD): doesn't know what an option changes. To be sure: rm -r $(IMAGE_OUT)"; }
	@sed -i -e 's,^BR2_DEFCONFIG=.*,BR2_DEFCONFIG="$(abspath $@)",' \
		-e 's,^BR2_DL_DIR=.*,BR2_DL_DIR="$(abspath $(DL_DIR))",' $(IMAGE_OUT)/.config

image-host:
	@tests/setup/debian.sh $(IMAGE_PACKAGES)
	@board/common/check-host.sh '$(BOARD)' '$(DL_DIR)' $(IMAGE_OUTS)

$(BUILDROOT_PINNED)/Makefile: | image-host
	@for url in $(BUILDROOT_URLS); do \
		rm -rf $(@D).part; \
		git -c advice.detachedHead=false clone --quiet --depth 1 --branch $(BUILDROOT_VERSION) $$url $(@D).part || continue; \
		[ "$$(git -C $(@D).part rev-parse HEAD)" != $(BUILDROOT_COMMIT) ] || exec mv $(@D).part $(@D); \
		echo "$$url: tag $(BUILDROOT_VERSION) is not commit $(BUILDROOT_COMMIT)" >&2; \
	done; \
	echo "image: Buildroot $(BUILDROOT_VERSION) could not be fetched from any of: $(BUILDROOT_URLS)" >&2; \
	echo "image: name one that is there: BUILDROOT_DIR=<dir>" >&2; exit 1
