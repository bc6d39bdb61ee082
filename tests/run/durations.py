"""The rule of the gate: no verdict of `make test` rests on how long something took. `make check` holds it.

    a wait is patience's           no literal limit in seconds, no loop around a clock of a test's own
    a promise about time is said   with patience.promise: an assertion doesn't read a clock
    nothing has happened by then   a sleep stands where something must *not* happen, and is named below

It reads every test and what tests are made of, but for functions marked `timed` and the files below; of the unit tests in C,
where loop_until.h waits, their sleeps.
"""

import ast
import re
import sys
from dataclasses import dataclass
from pathlib import Path

TESTS = Path("tests")
# Waiting and looking at the clock is what these are for.
PERMITTED_FILES = {
    "patience.py": "the waits themselves",
    "quiet.py": "watches the machine's own time",
    "conftest.py": "says when a test was late",
    **{f"run/{name}.py": "figures beside the verdict" for name in ("check", "command", "fuzz", "steady", "summary")},
    "judge/__main__.py": "the judge: its clock is the air's, and --without-time leaves it out",
    "release/test_raspi4b.py": "the release image's: make test-image",
    **{f"models/{name}.py": "a model: its time is the air's, or the autopilot's" for name in (
        "front", "hostapd", "player", "field_study", "noise", "air")},
    **{f"measure/{name}.py": "measures: make bench" for name in ("bench", "runs", "costs")},
    "daemon/demo.py": "measures: make demo-host",
    **{f"bench/{name}.py": "measures: make demo, make soak, make test-all" for name in (
        "demo", "soak", "runs", "faults", "boot_chart", "without", "tap")},
    "bench/image/__main__.py": "builds, and says how long it took",
    "update/server.py": "a model: so many octets a second",
    "update/hawkbit.py": "a model: an interval of polls",
    "update/power_cuts.py": "cuts the power at chosen instants",
    "web/updater.py": "a model: so many octets a second",
}
# Until something has *not* happened, or as long as a test gives to what it harms.
PERMITTED_SLEEPS = {
    "debian/test_system.py::companion": "what is measured in flight begins when it has settled",
    "debian/test_system.py::test_it_is_on_the_air_after_a_restart": "what is measured in flight begins when it has settled",
    "debian/test_system.py::content_gap": "as long as a test gives to what it harms",
    "bench/conftest.py::flying": "what is measured in flight begins when it has settled",
    "bench/test_air.py::test_the_answer_to_a_probe_carries_the_beacon_s_pack": "so long beacons are collected",
    "bench/attacker.py::keep_sending": "so many frames in so much time",
    "bench/rights.py::running": "what doesn't last is gone by then",
    "bench/test_attacks.py::disarmed": "so long it is pretended",
    "bench/test_attacks.py::flown": "what is measured begins when it has settled, and ends a moment after the attack",
    "bench/test_attacks.py::test_without_the_router_s_rules_it_would_be_seen": "what is attacked has settled",
    "update/test_refused.py::test_a_dry_run_is_no_update": "it must not restart",
    "bench/test_boot.py::power_on_again": "so long receptions are collected",
    "bench/test_page.py::test_the_page_is_there_in_maintenance_and_gone_when_armed": "it must not be there again",
    "bench/test_parts.py::listen": "a model: so long every word takes",
    "bench/test_power_cut.py::test_power_cuts": "the power is cut at a chosen instant",
    "bench/test_release.py::test_memory_in_use": "what is measured begins when it has settled",
    "bench/test_services.py::test_ssh_is_for_an_installed_key_only": "nothing may listen",
    "bench/test_services.py::test_the_flight_record_says_whether_it_was_on_the_air": "so long a flight goes on",
    "bench/test_services.py::test_a_board_without_radios_boots_and_says_so": "nothing may end, nor be on the air",
    "bench/test_services.py::test_a_daemon_that_never_comes_back_is_taken_off_the_air": "nothing may be heard",
    "bench/guest/test_relay.py::test_a_peer_that_is_not_there_costs_nothing": "it must not end",
    "bench/test_services.py::test_what_the_machine_says_is_heard_however_late": "nobody listens meanwhile",
    "daemon/test_flight_record.py::test_a_flight_with_a_killed_daemon_a_lost_hostapd_and_a_killed_recorder":
        "so long a flight goes on, and so long something is away",
    "models/test_models.py::test_what_a_chip_had_before_it_refused_stays_in_it": "it must not be in them",
    "models/test_models.py::test_an_element_is_in_the_beacons_from_the_update_on": "it must not be in them",
    "scripts/test_scripts.py::test_each_adapter_that_is_plugged_in_gets_an_address": "no other one may get any",
    "scripts/test_scripts.py::test_another_hawkbit_counts_when_no_update_is_going_on": "it must not be told again",
    "scripts/test_scripts.py::test_an_orphan_is_taken_over_and_a_stranger_with_its_number_is_not": "neither may end",
    "judge/test_sources.py::test_follow_a_growing_file": "half a record lies there",
    "update/test_air.py::test_the_broadcast_goes_on": "what is measured begins when it has settled",
    "update/test_armed.py::test_writing_stops": "nothing may be written; so long it is disarmed",
    "update/test_hawkbit.py::test_switched_off_and_on_by_the_technician": "nobody may ask",
    "update/test_hawkbit.py::assert_left_alone": "nobody may ask",
    "update/test_refused.py::armed": "so long it is disarmed before the next one",
    "update/test_tls.py::test_a_clock_that_is_wrong_until_the_autopilot_sets_it_back": "nobody may ask",
    "update/test_tls.py::test_another_authority_is_not_believed": "nobody may ask",
    "update/test_trial.py::test_switched_off_ten_times_on_trial": "the power is cut at a chosen instant",
    "web/test_api.py::test_the_page_answers_while_a_slow_updater_takes_a_bundle": "a pause between questions",
    "web/test_api.py::test_the_same_result_twice_is_two_results": "a file's time goes on in steps",
    "web/test_page.py::picture": "pictures for docs/page.md",
}
PERMITTED_SLEEPS_IN_C = {
    "test_autopilot_find.c::play": "a model: so often an autopilot speaks",
    "test_clock_set_program.c::until_it_serves": "a wait",
    "test_clock_set_program.c::without_a_daemon_it_waits": "it must not end",
    "test_keeper_process.c::beat": "a model: so often a daemon shows that it lives",
    "test_keeper_process.c::the_port_stays_taken_between_two_daemons": "it must not be free; then a wait",
    "test_update_gate.c::is_done": "a wait",
    "test_recorder_snapshot.c::answer_slowly": "a model: a slow daemon",
}
CLOCKS = {"monotonic", "time", "perf_counter"}
WAITS = {"settimeout", "wait", "communicate", "select", "join", "create_connection"}


@dataclass
class Breach:
    path: Path
    line: int
    what: str

    def __str__(self):
        return f"{self.path}:{self.line}: {self.what}"


def is_timed(function):
    return any("timed" in ast.unparse(one) for one in function.decorator_list)


def is_clock(node):
    return (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CLOCKS
            and isinstance(node.func.value, ast.Name) and node.func.value.id == "time")


def reads_clock(node, names):
    """Whether its value is a time or a duration; what a function made of one isn't."""
    if is_clock(node):
        return True
    if isinstance(node, ast.Name):
        return node.id in names
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") not in ("abs", "max", "min", "round", "sum", "sorted"):
        return False
    return any(reads_clock(one, names) for one in ast.iter_child_nodes(node))


def judges_time(compare, names):
    """Against a number, literal or named; that one clock's value comes after another's is no duration."""
    sides = compare.left, *compare.comparators
    return any(map(amount, sides)) and any(reads_clock(one, names) for one in sides)


def amount(node):
    """A number, or something reckoned with one."""
    if isinstance(node, ast.BinOp):
        return amount(node.left) or amount(node.right)
    return number(node) or isinstance(node, ast.Name) and node.id.isupper()


def clock_names(function):
    """Variables whose value comes from a clock."""
    names = set()
    while True:
        found = {target.id for node in ast.walk(function) if isinstance(node, ast.Assign) and reads_clock(node.value, names)
                 for target in ast.walk(node.targets[0]) if isinstance(target, ast.Name)}
        if found <= names:
            return names
        names |= found


def number(node):
    """A literal that is no zero."""
    return isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and bool(node.value)


def literal_limit(call):
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    given = [one.value for one in call.keywords if one.arg in ("timeout", "timeout_s", "limit_s")]
    if name in WAITS:
        given += call.args[-1:] if name != "select" else call.args[3:]
    return any(map(number, given))


def breaches(path, lines, function):
    names = clock_names(function)
    for node in ast.walk(function):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Assert) and any(
                isinstance(one, ast.Compare) and judges_time(one, names) for one in ast.walk(node.test)):
            yield Breach(path, line, "an assertion about real time: patience.promise")
        elif isinstance(node, ast.While) and reads_clock(node.test, names):
            yield Breach(path, line, "a wait of its own: patience.wait_for")
        elif isinstance(node, ast.Call) and literal_limit(node) and "# nothing comes" not in lines[line - 1]:
            yield Breach(path, line, "a limit of its own: patience.LIMIT_S (or, to look that nothing comes: # nothing comes)")
        elif (isinstance(node, ast.Call) and ast.unparse(node.func) == "time.sleep"
              and f"{path.relative_to(TESTS)}::{function.name}" not in PERMITTED_SLEEPS):
            yield Breach(path, line, f"a sleep: wait for what it is for, or name it in {Path(__file__).name}")


def breaches_in_c(path, lines):
    function = ""
    for number, line in enumerate(lines, 1):
        if begins := re.match(r"(?:\w[\w *]*?[ *])?(\w+)\(", line):
            function = begins[1]
        if re.search(r"\b\w*sleep\(", line) and f"{path.name}::{function}" not in PERMITTED_SLEEPS_IN_C:
            yield Breach(path, number, f"a sleep: loop_until, or name it in {Path(__file__).name}")
        # That something took as long as it had to is no machine's doing: >= may stand.
        if re.search(r"assert_\w+\(loop_now_us\(\) - \w+(,| <)", line):
            yield Breach(path, number, "a duration: in_time (loop_until.h), which judges it where that is wanted")


def functions(tree):
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node


def check(path):
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".c", ".h"):
        return list(breaches_in_c(path, text.splitlines()))
    tree, found = ast.parse(text), {}
    timed = [one for one in functions(tree) if is_timed(one)]
    inside = {id(node) for one in timed for node in ast.walk(one)}
    for function in functions(tree):
        if id(function) not in inside:
            for one in breaches(path, text.splitlines(), function):
                found[one.line, one.what] = one  # nested functions are met twice
    return [found[key] for key in sorted(found)]


def main():
    paths = [path for path in map(Path, sys.argv[1:])
             if not any(path.is_relative_to(TESTS / one) for one in PERMITTED_FILES)]
    found = [one for path in paths for one in check(path)]
    for one in found:
        print(one)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
