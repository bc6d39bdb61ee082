# The front door. Everything that is built or measured goes into build/.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

DAEMON := package/odid-daemon
JOBS := $(shell nproc 2>/dev/null || echo 2)

# What set-up and the bench fetch from Debian and PyPI is kept here: another checkout, and this one after
# `make clean`, doesn't fetch it again, and needs no network.
override FETCHED := $(abspath $(or $(FETCHED),$(or $(XDG_CACHE_HOME),$(HOME)/.cache)/odid))
export FETCHED

# Where the two foreign sources are; naming one of these replaces what set-up would fetch.
ifeq ($(OPENDRONEID_DIR),)
OPENDRONEID := $(CURDIR)/build/opendroneid
SETUP += build/opendroneid/stamp
else
OPENDRONEID := $(abspath $(OPENDRONEID_DIR))
endif
ifeq ($(MAVLINK_DIR),)
MAVLINK := $(CURDIR)/build/mavlink
SETUP += build/mavlink/stamp
else
MAVLINK := $(abspath $(MAVLINK_DIR))
endif

# What the demo, the bench and the tests take from the command line. Handed over by env(1), not by
# `export`: a shell that is bash counts SECONDS up.
OPTIONS = $(foreach name,FLIGHT SECONDS TEST_DATA LOSS KEYS,$(if $($(name)),$(name)='$($(name))')) \
	$(if $(IMAGE),IMAGE=build/appliance/tested/disk.img)
RUN = env $(OPTIONS) PYTHONPATH=tests PYTHONPYCACHEPREFIX=build/pycache \
	build/venv/bin/python3

CONFIGURE = cmake -S $(DAEMON) -G 'Unix Makefiles' -DODID_WERROR=ON \
	-DOPENDRONEID_DIR='$(OPENDRONEID)' -DMAVLINK_DIR='$(MAVLINK)'

# cmake is asked every time (it finds new files and changed paths) and is silent unless it fails.
define cmake-build
@mkdir -p build/setup
@$(CONFIGURE) -B build/$(1) $(2) >build/setup/cmake-$(1).log 2>&1 || \
	{ cat build/setup/cmake-$(1).log; exit 1; }
@cmake --build build/$(1) -j $(JOBS) -- --no-print-directory -s
endef

.PHONY: help
help:
	@echo 'make demo       boots the appliance in QEMU and flies it past an independent listener'
	@echo 'make demo-host  the same flight through the daemon alone, on this machine'
	@echo 'make test       every test that fits in minutes, with a summary'
	@echo 'make system     of these only those that boot the appliance and do it harm'
	@echo 'make update     updates the appliance, well and badly'
	@echo 'make power-cuts 300 power cuts in the middle of updates (an hour; SEED=, COUNT=, CONTROL=)'
	@echo 'make test-long  whole flights, long fuzzing, long benchmarks, the soak (hours)'
	@echo 'make faults-without  faults done to an appliance that lacks what is there against them'
	@echo 'make soak       the appliance in flight for half an hour: nothing may go wrong or grow'
	@echo 'make bench      measures the daemon beside the field study'\''s figures'
	@echo 'make daemon     only builds the daemon: build/daemon'
	@echo 'make appliance  only builds the disk that the bench boots: build/appliance/disk.img'
	@echo 'make image      the release image: build/image/cm4/release (docs/building.md)'
	@echo 'make source     fetches all that building it needs, to build without a network'
	@echo 'make legal      licences and sources as they have to be passed on with an image'
	@echo 'make test-image tests what make image has built, and boots the CM4'\''s in QEMU'
	@echo 'make bundle     a signed update to the built image: build/bundle (docs/keys.md)'
	@echo 'make reproducible  builds the image twice and compares every file'
	@echo 'make check      formatting, shell scripts, man pages, Python'
	@echo 'make format     formats the C sources'
	@echo 'make setup      only installs and fetches what the others need'
	@echo 'make clean      removes build/'
	@echo
	@echo 'FLIGHT=<log>    the flight to play (default: the one in TEST_DATA, else a generated one)'
	@echo 'SECONDS=<n>     how much of it the demo plays'
	@echo 'TEST_DATA=<dir> where recorded flights and captures are (default: ../shared/data)'
	@echo 'IMAGE=<disk>    the release image for QEMU instead of the bench'\''s: build/image/qemu/images/disk.img'
	@echo 'LOSS=<model>    receptions that the listener drops, for the edge of range'
	@echo 'BOARD=qemu      the release image for QEMU instead of the CM4; DL_DIR=<dir> keeps its sources,'
	@echo '                BUILDROOT_DIR=<dir> IMAGE_CONFIG=<file> IMAGE_OUT=<dir>: board/common/image.mk'
	@echo 'KEYS=<dir>      whose key signs bundles, and whose keys images trust (default: build/keys)'
	@echo 'FETCHED=<dir>   where fetched packages are kept (default: ~/.cache/odid)'
	@echo 'OPENDRONEID_DIR=<dir>  MAVLINK_DIR=<dir>  sources of your own instead of fetched ones'

# --- Set-up -----------------------------------------------------------------

.PHONY: setup base debian debian-tests
base: build/venv/stamp $(SETUP)
setup: base debian-tests

# Asked every time: it costs 20 ms, and a package may have gone since.
debian:
	@tests/setup/debian.sh debian.txt

# Not what the demo has to wait for: a browser, a second compiler.
debian-tests: debian
	@tests/setup/debian.sh debian-tests.txt

# The stamps lie in what they stand for, and go with it. The packages themselves may have gone with FETCHED.
.PHONY: gone
build/venv/stamp: tests/setup/python.sh tests/setup/requirements.txt $(if $(wildcard build/venv/bin/python3),,gone) | debian
	@tests/setup/python.sh
	@touch $@

build/mavlink/stamp: tests/setup/mavlink.sh tests/setup/mavlink.sha256 build/venv/stamp
	@tests/setup/mavlink.sh
	@touch $@

build/opendroneid/stamp: tests/setup/opendroneid.sh tests/setup/opendroneid.sha256 \
		tests/setup/opendroneid/Cargo.toml tests/setup/opendroneid/Cargo.lock | debian
	@tests/setup/opendroneid.sh
	@touch $@

# --- Building ---------------------------------------------------------------

.PHONY: daemon unit fuzzers
daemon: base
	$(call cmake-build,daemon,-DCMAKE_BUILD_TYPE=Release)

unit: setup
	$(call cmake-build,unit,-DCMAKE_BUILD_TYPE=Debug -DODID_TESTS=ON -DODID_SANITIZE=ON)

fuzzers: setup
	$(call cmake-build,fuzz,-DCMAKE_BUILD_TYPE=Debug -DODID_FUZZ=ON -DCMAKE_C_COMPILER=clang)

# Debian's packages around the daemon and overlay/; what it is and isn't: tests/bench/README.md.
.PHONY: appliance
ifeq ($(IMAGE),)
appliance: base
	@OPENDRONEID_DIR='$(OPENDRONEID)' MAVLINK_DIR='$(MAVLINK)' $(RUN) -m bench.image
else
appliance: base
	@$(RUN) -m bench.image --add-to '$(IMAGE)'
endif

# make image, source, legal, reproducible
include board/common/image.mk

# --- Bundles: updates to install ----------------------------------------------

# Who may sign them: a folder made by make-keys.sh, or a fleet's own (docs/keys.md).
KEYS ?= build/keys

# Of the image that make image has built for BOARD; SLOT=build/appliance/slot.img BOARD=qemu: of the bench's.
SLOT ?= $(IMAGE_OUT)/images/slot.img
BUNDLE = build/bundle/odid-$(BOARD)-$(IMAGE_VERSION).swu

.PHONY: bundle keys
keys:
	@board/common/make-keys.sh '$(KEYS)'

bundle: keys
	@[ -e '$(SLOT)' ] || { echo 'bundle: there is no $(SLOT); make image BOARD=$(BOARD) makes it' >&2; exit 1; }
	@board/common/make-bundle.sh '$(SLOT)' '$(BOARD)' '$(IMAGE_VERSION)' '$(KEYS)' '$(BUNDLE)'
	@echo '$(BUNDLE)'

# --- Showing and measuring --------------------------------------------------

.PHONY: demo demo-host bench soak
demo: appliance
	@$(RUN) tests/bench/demo.py

demo-host: daemon
	@$(RUN) tests/host/demo.py

bench: daemon debian-tests
	@$(RUN) tests/host/bench.py

soak: appliance
	@$(RUN) tests/bench/soak.py

# --- Testing ----------------------------------------------------------------

# Each level leaves a JUnit file in build/test, and its exit code when that isn't 0; the summary
# counts them, and fails where a level left none. So a level that fails doesn't keep the next one
# from running.
left = echo $$? >build/test/$(1).exit

.PHONY: test test-long
test: FUZZ_SECONDS = 20
test: LEVELS = check unit fuzz host system
test:
	@rm -rf build/test && mkdir -p build/test && date +%s >build/test/started
	@$(MAKE) --no-print-directory daemon unit fuzzers appliance
	$(test-levels)
	@$(RUN) tests/summary.py build/test $(LEVELS)

# FUZZ_SECONDS= makes it longer yet.
test-long: FUZZ_SECONDS = 600
test-long: LEVELS = check unit fuzz host system bench soak without
test-long: export TEST_LONG = 1
test-long:
	@rm -rf build/test && mkdir -p build/test && date +%s >build/test/started
	@$(MAKE) --no-print-directory daemon unit fuzzers appliance
	$(test-levels)
	@$(RUN) tests/levels/command.py build/test/bench.xml \
		$(RUN) tests/host/bench.py --long || $(call left,bench)
	@$(RUN) tests/levels/command.py build/test/soak.xml \
		$(RUN) tests/bench/soak.py || $(call left,soak)
	@$(RUN) tests/levels/command.py build/test/without.xml \
		$(RUN) tests/bench/without.py || $(call left,without)
	@$(RUN) tests/summary.py build/test $(LEVELS)

define test-levels
@$(RUN) tests/levels/check.py --junit build/test/check.xml || $(call left,check)
@UBSAN_OPTIONS=print_stacktrace=1 ctest --test-dir build/unit -j $(JOBS) \
	--no-tests=error --output-on-failure \
	--test-output-size-passed 1000000 --test-output-size-failed 1000000 \
	--output-junit $(CURDIR)/build/test/unit.xml || $(call left,unit)
@$(RUN) tests/levels/fuzz.py --seconds $(FUZZ_SECONDS) --jobs $(JOBS) \
	--junit build/test/fuzz.xml || $(call left,fuzz)
@$(RUN) -m pytest tests --ignore=tests/bench --ignore=tests/image --ignore=tests/update $(PYTEST) \
	--junit-xml=build/test/host.xml || \
	$(call left,host)
@$(RUN) -m pytest tests/bench tests/update $(PYTEST) --junit-xml=build/test/system.xml || $(call left,system)
endef

PYTEST = -o cache_dir=build/pytest -ra --continue-on-collection-errors

.PHONY: system faults-without
system: appliance debian-tests
	@$(RUN) -m pytest tests/bench tests/update $(PYTEST)

faults-without: appliance
	@$(RUN) tests/bench/without.py

# Bundles, refusals, trials, roll-backs.
.PHONY: update power-cuts
update: appliance
	@TEST_LONG=1 $(RUN) -m pytest tests/update --ignore=tests/update/test_power_cuts.py $(PYTEST)

# Goes on where it was broken off; CONTROL= takes a protection out, and has to fail.
COUNT ?= 300
SEED ?= 1
power-cuts: appliance
	@$(RUN) -m update.power_cuts --count $(COUNT) --seed $(SEED) $(if $(CONTROL),--control $(CONTROL))

.PHONY: check format
check: build/venv/stamp debian-tests
	@$(RUN) tests/levels/check.py

format: debian-tests
	@clang-format -i $(wildcard $(DAEMON)/src/*.[ch] $(DAEMON)/tests/*.[ch] $(DAEMON)/fuzz/*.[ch])

.PHONY: clean
clean:
	rm -rf build
