# The front door. Everything that is built or measured goes into build/.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

# Not DAEMON: that says which one the tests take, and make would hand on what it makes of it.
DAEMON_SOURCE := package/odid-daemon
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
RUN = env $(OPTIONS) MAVLINK_DIR='$(MAVLINK)' PYTHONPATH=tests PYTHONPYCACHEPREFIX=build/pycache \
	build/venv/bin/python3

CONFIGURE = cmake -S $(DAEMON_SOURCE) -G 'Unix Makefiles' -DODID_WERROR=ON \
	-DOPENDRONEID_DIR='$(OPENDRONEID)' -DMAVLINK_DIR='$(MAVLINK)'

# cmake is asked every time (it finds new files and changed paths) and is silent unless it fails.
define cmake-build
@mkdir -p build/setup
@$(CONFIGURE) -B build/$(1) $(2) >build/setup/cmake-$(1).log 2>&1 || \
	{ cat build/setup/cmake-$(1).log; exit 1; }
@env -u MAKEFLAGS cmake --build build/$(1) -j $(JOBS) -- --no-print-directory -s
endef

.PHONY: help
help:
	@echo 'make demo       boots the appliance in QEMU and flies it past an independent listener'
	@echo '                BOARD=cm4: on an emulated Compute Module, with its own radio drivers'
	@echo 'make demo-host  the same flight through the daemon alone, on this machine'
	@echo 'make test       the gate: every part, and an appliance booted, updated and flown; minutes'
	@echo 'make test-all   real time included, with all faults, the benchmark and a short soak (two hours)'
	@echo 'make steady     runs make test again and again: COUNT=10, STRESS=4 (busy processes beside it)'
	@echo 'make simulate   flights through random faults in simulated time: SEEDS=1-20 MINUTES=10, or HOURS=10;'
	@echo '                PYPY=pypy3: for many hours'
	@echo 'make mutants    faults put into the daemon: the gate has to see each (an hour; RANDOM=200 SEED=1, ONLY=)'
	@echo 'make laws       whether each law of the simulated flights sees the fault that breaks it'
	@echo 'make system     only the tests that boot the appliance and do it harm'
	@echo 'make update     updates the appliance, well and badly'
	@echo 'make power-cuts 300 power cuts in the middle of updates (an hour; SEED=, COUNT=, CONTROL=)'
	@echo 'make faults-without  faults done to an appliance that lacks what is there against them'
	@echo 'make smoke-without   the smoke of make test without what each of its tests proves: all have to fail'
	@echo 'make soak       the appliance in flight for half an hour: nothing may go wrong or grow'
	@echo 'make fuzz       the fuzzers: FUZZ_SECONDS=3600 each, FUZZERS="hci web" only these'
	@echo 'make bench      measures the daemon beside the field study'\''s figures'
	@echo 'make daemon     only builds the daemon: build/daemon'
	@echo 'make appliance  only builds the disk that the bench boots: build/appliance/disk.img'
	@echo 'make image      the release image: build/image/cm4/release (docs/building.md)'
	@echo 'make source     fetches all that building it needs, to build without a network'
	@echo 'make legal      licences and sources as they have to be passed on with an image'
	@echo 'make test-image tests what make image has built, and boots the CM4'\''s in QEMU'
	@echo 'make deb        Debian'\''s package for companion computers, in build/companion: ARCHITECTURES=amd64'
	@echo 'make container  the same as a container'\''s image (docs/debian.md)'
	@echo 'make bundle     a signed update to the built image: build/bundle (docs/keys.md)'
	@echo 'make reproducible  builds the image twice and compares every file (needs the disk for both)'
	@echo 'make buildroot GOALS=<goal>  what else Buildroot can: menuconfig, hostapd-odid-rebuild, graph-size'
	@echo 'make check      formatting, shell scripts, man pages, Python'
	@echo 'make format     formats the C sources'
	@echo 'make setup      only installs and fetches what the others need'
	@echo 'make clean      removes build/'
	@echo
	@echo 'FLIGHT=<log>    the flight to play (default: a generated one)'
	@echo 'SECONDS=<n>     how much of it the demo plays'
	@echo 'TEST_DATA=<dir> where recorded flights and captures are (default: ../shared/data)'
	@echo 'IMAGE=<disk>    a release image instead of the bench'\''s: build/image/qemu/images/disk.img, or cm4'\''s'
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

# The release's SWUpdate, for this machine: tests/update/test_client.py.
build/swupdate/swupdate: tests/setup/swupdate.sh tests/setup/own-apt.sh board/common/swupdate.fragment \
		$(wildcard br2-external/patches/swupdate/*.patch) | debian-tests
	@tests/setup/swupdate.sh

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
appliance: base keys-named
	@OPENDRONEID_DIR='$(OPENDRONEID)' $(RUN) -m bench.image
else
appliance: base
	@$(RUN) -m bench.image --add-to '$(IMAGE)'
endif

# A QEMU that has the Compute Module's processor and its peripherals.
.PHONY: qemu-raspi
qemu-raspi: debian
	@tests/setup/qemu-raspi.sh

# make image, source, legal, reproducible
include board/common/image.mk

# --- Companion computers: docs/debian.md -----------------------------------------

ARCHITECTURES ?= amd64 arm64
COMPANION = env OPENDRONEID='$(OPENDRONEID)' MAVLINK='$(MAVLINK)'

.PHONY: deb container companion-tools
companion-tools: base
	@tests/setup/debian.sh debhelper

# A package each, and an image each of it alone.
deb: $(ARCHITECTURES:%=deb-%)
deb-%: companion-tools
	@$(COMPANION) board/companion/make-deb.sh $* build/companion

container: $(ARCHITECTURES:%=container-%)
container-%: deb-%
	@$(RUN) board/companion/make_container.py $* build/companion

# A Debian 12 to install it in; made once, of the packages of that day.
.PHONY: companion-system
companion-system: build/companion/system/disk.img
build/companion/system/disk.img: tests/debian/system.py $(wildcard tests/debian/guest/*) tests/bench/guest/hci-attach.c | debian-tests
	@tests/setup/debian.sh debian-companion.txt
	@$(RUN) -m debian.system

.PHONY: container-here
container-here: container-$(shell dpkg --print-architecture 2>/dev/null)

# --- Bundles: updates to install ----------------------------------------------

# Who may sign them: a folder made by make-keys.sh, or a fleet's own (docs/keys.md).
KEYS ?= build/keys

# Of the image that make image has built for BOARD; SLOT=build/appliance/slot.img BOARD=qemu: of the bench's.
SLOT ?= $(IMAGE_OUT)/images/slot.img
BUNDLE = build/bundle/odid-$(BOARD)-$(IMAGE_VERSION).swu

.PHONY: bundle keys keys-named
keys: keys-named
	@board/common/make-keys.sh '$(KEYS)'

# A pair is made in the default folder only: in one that was named and isn't there, somebody meant other keys.
keys-named:
	@[ '$(KEYS)' = build/keys ] || [ -s '$(KEYS)/trusted.pem' ] || { echo 'keys: there is no $(KEYS)/trusted.pem:' \
		'KEYS=<dir> names a folder that has one; board/common/make-keys.sh <dir> makes a new one' >&2; exit 1; }

bundle: keys
	@[ -e '$(SLOT)' ] || { echo 'bundle: there is no $(SLOT); make image BOARD=$(BOARD) makes it' >&2; exit 1; }
	@inside=$$(PATH="$(abspath $(IMAGE_OUT))/host/bin:$$PATH" unsquashfs -cat '$(SLOT)' etc/odid/version) && \
		[ "$$inside" = '$(IMAGE_VERSION)' ] || { echo "bundle: $(SLOT) is version $$inside, and this is" \
		"$(IMAGE_VERSION): make image, else a stick would bring it again at each start" >&2; exit 1; }
	@PATH="$(abspath $(IMAGE_OUT))/host/bin:$$PATH" unsquashfs -cat '$(SLOT)' etc/swupdate/trusted.pem | \
		openssl verify -no-CApath -no-CAstore -CAfile /dev/stdin '$(KEYS)/signing.crt' >/dev/null 2>&1 || { \
		echo 'bundle: $(SLOT) does not trust $(KEYS)/signing.crt: an aircraft that installed it would take no' \
		'further bundle of that key. Name the KEYS=<dir> that the image was made with, or make image KEYS=$(KEYS)' >&2; exit 1; }
	@board/common/make-bundle.sh '$(SLOT)' '$(BOARD)' '$(IMAGE_VERSION)' '$(KEYS)' '$(BUNDLE)'
	@echo '$(BUNDLE)'

# --- Showing and measuring --------------------------------------------------

.PHONY: demo demo-host bench soak
# The board that was asked for; the release image's default is none of the demo's.
DEMO_BOARD = $(if $(filter-out file,$(origin BOARD)),$(BOARD))
demo: appliance $(if $(filter cm4,$(DEMO_BOARD)),qemu-raspi)
	@$(RUN) tests/bench/demo.py $(filter cm4,$(DEMO_BOARD))

demo-host: daemon
	@$(RUN) tests/daemon/demo.py

bench: daemon debian-tests
	@$(RUN) tests/measure/bench.py

soak: appliance
	@$(RUN) tests/bench/soak.py

# --- Testing ----------------------------------------------------------------

# `make test` is the gate: parts and rules, the same verdict on any machine. `make test-all` has real time besides, and all
# but what is marked long: installs, roll-backs and servers (make update), 300 power cuts, long flights. Each level
# leaves a JUnit file in build/test; the summary counts them, and fails where one left none.
LEVEL = @tests/run/level.sh
PYTEST = -ra --continue-on-collection-errors -o cache_dir=build/pytest
TESTS = tests --ignore=tests/release
PARTS = not booted and not timed and not long
# `make system SYSTEM=booted`: with those that take minutes each.
SYSTEM ?= booted and not long
SPREAD = -n 4 --dist worksteal

.PHONY: test test-begin
test: LEVELS = check unit fuzz parts smoke
test: test-begin
	@$(MAKE) --no-print-directory --keep-going -j 4 $(LEVELS:%=level-%) || true
	@$(RUN) tests/run/summary.py build/test $(LEVELS)

# One level after the other, and nothing beside them: what is about time is judged here, where the machine was quiet.
.PHONY: test-all
test-all: export ODID_TIMED = 1
test-all: LEVELS = check unit fuzz parts system bench soak without
test-all: test-begin
	@$(MAKE) --no-print-directory --keep-going -j 1 $(LEVELS:%=level-%) FUZZ_SECONDS=60 SPREAD= \
		PARTS='not booted and not long' || true
	@$(RUN) tests/run/summary.py build/test $(LEVELS) --keep build/test-all

test-begin:
	@rm -rf build/test && mkdir -p build/test && date +%s >build/test/started
	@$(MAKE) --no-print-directory setup

# Each can be had alone: make test-begin level-unit.
FUZZ_SECONDS ?= 5
.PHONY: level-check level-unit level-fuzz level-parts level-smoke
level-check:
	$(LEVEL) check $(RUN) tests/run/check.py --junit build/test/check.xml

level-unit: unit
	$(LEVEL) unit env UBSAN_OPTIONS=print_stacktrace=1 ctest --test-dir build/unit -j $(if $(ODID_TIMED),1,4) \
		--no-tests=error --output-on-failure \
		--test-output-size-passed 1000000 --test-output-size-failed 1000000 \
		--output-junit $(CURDIR)/build/test/unit.xml

# Some of them, or longer: FUZZERS="hci web" FUZZ_SECONDS=3600.
.PHONY: fuzz
fuzz: fuzzers
	@$(RUN) tests/run/fuzz.py --seconds $(FUZZ_SECONDS) --jobs $(JOBS) $(FUZZERS)

level-fuzz: fuzzers
	$(LEVEL) fuzz $(RUN) tests/run/fuzz.py --seconds $(FUZZ_SECONDS) --jobs $(JOBS) \
		--junit build/test/fuzz.xml

# Most of them wait for something, and not for a processor.
level-parts: daemon appliance build/swupdate/swupdate container-here
	$(LEVEL) parts $(RUN) -m pytest $(TESTS) -m '$(PARTS)' $(SPREAD) $(PYTEST) \
		--junit-xml=build/test/parts.xml

level-smoke: appliance
	$(LEVEL) smoke $(RUN) -m pytest tests/smoke $(PYTEST)-smoke --junit-xml=build/test/smoke.xml

.PHONY: level-system level-bench level-soak level-without
level-system: appliance qemu-raspi deb container companion-system
	$(LEVEL) system $(RUN) -m pytest $(TESTS) -m '$(SYSTEM)' $(PYTEST) --junit-xml=build/test/system.xml

COMMAND = $(RUN) tests/run/command.py build/test/$(1).xml $(RUN)
level-bench: daemon
	$(LEVEL) bench $(call COMMAND,bench) tests/measure/bench.py

level-soak: appliance
	$(LEVEL) soak env SECONDS=600 $(call COMMAND,soak) tests/bench/soak.py

level-without: appliance
	$(LEVEL) without $(call COMMAND,without) tests/bench/without.py

# Whether the gate says the same thing each time; STRESS= beside so many busy processes.
.PHONY: steady
steady: setup
	@COUNT='$(or $(COUNT),10)' STRESS='$(or $(STRESS),0)' $(RUN) tests/run/steady.py

# PyPy needs a minute to get going, and then takes two thirds of the time; a larger nursery keeps a flight's objects young.
WITH_PYPY = PYPY_GC_NURSERY=16M PYTHONPATH="tests:tests/simulated/pypy:$$(echo build/venv/lib/python3*/site-packages)" \
	PYTHONDONTWRITEBYTECODE=1 $(PYPY)

# Random faults, by seed: tests/simulated. PYPY=pypy3: flown by that.
.PHONY: simulate
simulate: daemon
	@SEEDS='$(SEEDS)' MINUTES='$(MINUTES)' HOURS='$(HOURS)' JOBS='$(JOBS)' $(if $(PYPY),$(WITH_PYPY),$(RUN)) \
		tests/simulated/random_flights.py

# Does the gate see a fault that is put in? tests/mutants.
.PHONY: mutants laws
laws: daemon
	@env ONLY='$(ONLY)' OPENDRONEID_DIR='$(OPENDRONEID)' $(RUN) tests/mutants/laws.py

mutants: daemon debian-tests
	@env RANDOM='$(RANDOM)' SEED='$(SEED)' ONLY='$(ONLY)' OPENDRONEID_DIR='$(OPENDRONEID)' \
		$(RUN) tests/mutants/run.py

.PHONY: system faults-without smoke-without
system: appliance debian-tests qemu-raspi
	@$(RUN) -m pytest $(TESTS) -m '$(SYSTEM)' $(PYTEST)

faults-without: appliance
	@$(RUN) tests/bench/without.py

smoke-without: appliance
	@$(RUN) tests/smoke/without.py

# Bundles, refusals, trials, roll-backs.
.PHONY: update power-cuts
update: appliance
	@$(RUN) -m pytest tests/update --ignore=tests/update/test_power_cuts.py $(PYTEST)

# Goes on where it was broken off; CONTROL= takes a protection out, and has to fail.
SEED ?= 1
power-cuts: appliance
	@$(RUN) -m update.power_cuts --count $(or $(COUNT),300) --seed $(SEED) $(if $(CONTROL),--control $(CONTROL))

.PHONY: check format
check: build/venv/stamp debian-tests
	@$(RUN) tests/run/check.py

format: debian-tests
	@clang-format -i $(wildcard $(DAEMON_SOURCE)/src/*/*.[ch] $(DAEMON_SOURCE)/tests/*.[ch] $(DAEMON_SOURCE)/tests/*/*.[ch] $(DAEMON_SOURCE)/fuzz/*.[ch] \
		$(DAEMON_SOURCE)/fuzz/*/*.[ch])

.PHONY: clean
clean:
	rm -rf build
