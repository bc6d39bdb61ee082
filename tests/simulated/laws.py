"""What holds in every world, whatever was done to the flight in it. A law says where it was broken; none: it held.

The judge knows nothing of faults: to it a channel that was taken away is silent. So its rules about time are asked
here, beside what was done; all its other rules hold as they are.
"""

import math
from bisect import bisect_left, bisect_right
from dataclasses import replace
from itertools import chain, pairwise

from judge.findings import ABOUT_TIME

from .faults import ALL
from .flight import WARM_UP_S
from .world import START_US

NEWER_S = 0.45  # on a machine that isn't late: the 4 Hz of the slots, and a chip's interval
NEWER_LATE_S = 1.0  # (2nd), on any
OTHERS_S = 1.5  # each other message; 3 s are allowed
OTHERS_LATE_S = 3.0
# What is said of itself, to the pilot and in the flight record, and how long it may take to find out.
GOOD_S = 3.6  # "good to arm" stands for so long after the last newer position that anybody heard, or just before one
BAD_S = 2.5  # and isn't said again for so long after all is well
SINCE_S = 1.0  # since when a channel is off the air
SLOWLY_S = 0.7
WAY_DEG = 6e-4  # 66 m
MADE_S = 0.3  # the status is made four times a second
NATIVE_S = 1.05  # from one native LOCATION to the next
GPS_RAW_INT = bytes((24, 0, 0))  # its number, in a frame
ROUNDED_S = 0.005  # its instants are
TOLD_S = 1.3  # it is told each second
FAILURE, FAILURE_S = 4, 3.9  # Location's status; the autopilot's last word may be a second old
DOUBT_S = 5.0
REPEATED_S = 0.25  # until the next payload a radio says the last one again
GAP_S = 3.0  # a silence that long is in the record, ...
RECORD_S = 2.5  # ... whose looks are a second apart
WRITTEN_S = 10.0  # and which is written so often
# What the daemon may cost.
WAKE_UPS_HZ, WAKE_UPS_A_FRAME = 30.0, 2.5  # for the slots; a newer position goes out on each channel, and is answered
MEMORY_KIB = 64


def broken_laws(flight, until_s):
    """Sentences."""
    return [sentence for sentences in judged_by_law(flight, until_s).values() for sentence in sentences]


def judged_by_law(flight, until_s):
    """{law: sentences}; what each of them sees is tried by tests/mutants/laws.py."""
    flight.windows = with_their_limits(flight.windows, 0.0 if tells_of_receivers(flight) else NATIVE_S)
    judgement = flight.judged()
    heard = {track.channel: Heard(track) for track in judgement.tracks}
    laws = {
        "as the judge has it": said_as_the_judge_has_it(flight, judgement),
        "failure": failure_is_said(flight, judgement),
        "newer position": all_waits(flight, heard, until_s, ["newer position"]),
        "other messages": all_waits(flight, heard, until_s, [name for name in NOTHING_HEARD if name != "newer position"]),
        "good": good_is_true(flight, heard),
        "bad": bad_is_true(flight),
        "status": status_is_true(flight, heard),
        "told": it_is_told(flight, until_s),
        "two sources": faults_are_told(flight, until_s),
        "costs": costs(flight, until_s)}
    if flight.kept:
        gaps = recorded_gaps(flight)
        laws |= {"gaps recorded": gaps_are_recorded(flight, heard, gaps, until_s),
                 "recorded gaps": recorded_gaps_were(flight, gaps),
                 "clock": clock_is_right(flight)}
    return {law: list(sentences) for law, sentences in laws.items()}


def tells_of_receivers(flight):
    return any(frame.octets[7:10] == GPS_RAW_INT for frame in flight.autopilot.frames)


def with_their_limits(windows, fix_s):
    """Where a daemon began meanwhile it may be another one; and what was done to a radio while none was there, or it hung,
    or shortly before, is noticed from then on. fix_s: until it is said again that there is a fix."""
    begun = [one for one in windows if one.fault.restarts]

    def limited(one):
        if one.fault.begun_s and any(other.lasts(one.begin_s, one.back_s) for other in begun):
            one = one._replace(fault=replace(one.fault, limit_s=one.fault.begun_s))
        if one.fault.no_position:
            one = one._replace(fault=replace(one.fault, limit_s=one.fault.limit_s + fix_s))
        if one.fault.part in ("chip", "hostapd"):
            until_s = one.back_s + one.fault.limit_s
            one = one._replace(back_s=max([one.back_s, *(other.back_s for other in begun if
                                                         other.begin_s <= until_s and one.begin_s <= other.back_s)]))
        return one
    return [limited(one) for one in windows]


def seconds(mono):
    return mono - START_US / 1e6


def lateness_s(flight):
    """What two late wake-ups may add: to what is heard, and to what is said of it."""
    return 2 * flight.world.late[1] / 1e6


class Heard:
    """When what was heard on a channel, in seconds of the flight."""

    def __init__(self, track):
        newer_ones = [(seconds(where.reception.mono), location) for where, location in track.newer_locations()]
        self.times = {name: [] for name in NOTHING_HEARD}
        self.times["newer position"] = [at_s for at_s, _ in newer_ones]
        self._places = [one for one in newer_ones if one[1].latitude_deg is not None]
        self._placed = [at_s for at_s, _ in self._places]
        for one in track.heard:
            for message in one.messages:
                if message.type_name in self.times:
                    self.times[message.type_name].append(seconds(one.reception.mono))

    def near(self, at_s):
        """The newer positions that were heard two seconds before and after: (second, Location)."""
        return self._places[bisect_left(self._placed, at_s - 2):bisect_right(self._placed, at_s + 2)]


def newer(heard, channel):
    return heard[channel].times["newer position"] if channel in heard else []


NOTHING_HEARD = {"newer position": [], "basic_id": [], "system": [], "operator_id": [], "self_id": []}


# Of the judge's rules about time: how old a position may be, and that the status says when there is none. Its intervals are
# asked by `waits`.
LATE_TOO = {"played.stale", "location.age"}  # where the machine is
HOW_OLD = ABOUT_TIME - {"interval.reception", "interval.content", "limit", "counter.lost", "set.unheard"}


def said_as_the_judge_has_it(flight, judgement):
    for one in judgement.findings.violations:
        at_s = seconds(one.mono) if one.mono else 0.0
        excused = (
            one.kind in ABOUT_TIME - HOW_OLD or
            one.kind in LATE_TOO and flight.world.late[0] or
            (one.kind in HOW_OLD or one.kind == "played.system_time") and was_away(flight, one.channel, at_s) or
            one.kind.startswith("played.") and fix_was_doubted(flight, at_s) or
            one.kind in KNOWN_SOON and just_restarted(flight, one.channel, at_s) or
            one.kind == "played.altitude" and one.found == "None" and autopilot_was_away(flight, at_s) or
            one.kind == "played.vertical_speed" and began_undecided(flight, at_s))
        if not excused:
            yield f"{one.kind} at {at_s:.3f} s on {one.channel}: {one.what}; expected {one.expected}, found {one.found}"


def failure_is_said(flight, judgement):
    """Remote ID system failure (status 4) from 3 s without a position on, until there is one; and never else."""
    late_s = lateness_s(flight)
    for track in judgement.tracks:
        there = [one for one in flight.windows if one.channel == track.channel]
        may = [(one.begin_s, heard_until_s(one, there, late_s)) for one in there if one.fault.channels == ALL]
        must = [(failure_due_s(flight, one, there) + late_s, one.back_s) for one in there if one.fault.no_position]
        for where, location in track.of_type("location"):
            at_s = seconds(where.reception.mono)
            if location.status == FAILURE:
                if not any(begin_s <= at_s <= end_s for begin_s, end_s in may):
                    yield f"{track.channel}: Remote ID system failure at {at_s:.3f} s, and nothing was wrong"
            elif any(begin_s < at_s < end_s for begin_s, end_s in must) and not is_taken_away(flight, track.channel, at_s):
                yield f"{track.channel}: status {location.status} at {at_s:.3f} s, where there was no position for long"


def failure_due_s(flight, lost, there):
    """A daemon that is killed before it has said so leaves none that knows: the next one waits for a position as long."""
    due_s = lost.begin_s + FAILURE_S + doubt_s(flight, lost)
    return max([due_s, *(one.back_s + one.fault.limit_s + FAILURE_S for one in there if
                         one.fault.restarts and one.lasts(lost.begin_s, due_s))])


def heard_until_s(one, there, late_s):
    """What a fault makes the daemon say; longer where the radio was away at its end, and begins with what it had before."""
    end_s = one.back_s + one.fault.limit_s + REPEATED_S + late_s
    for other in sorted(there, key=lambda window: window.begin_s):
        if other.begin_s <= end_s:
            end_s = max(end_s, other.back_s + other.fault.limit_s + REPEATED_S + late_s)
    return end_s


# A daemon that has just begun knows the geoid's separation with the autopilot's next GPS_RAW_INT, and that there is no fix any more,
# which went while the one before it hung; the time with its next SYSTEM_TIME: where the autopilot is there. Until then a way is reckoned from when a place was heard, which a radio may have
# had from before.
KNOWN_SOON = {"played.fix", "played.altitude", "played.system_time", "played.time", "played.time_unknown", "plausibility.jump"}
SECOND_S = 1.0


def just_restarted(flight, channel, at_s):
    """A radio that was away meanwhile begins with what the new one said first."""
    there = [one for one in flight.windows if one.channel == (channel or ALL[0])]
    return any(one.fault.restarts and one.begin_s <= at_s <= heard_until_s(one, there, lateness_s(flight)) + SECOND_S
               for one in there)


def doubt_s(flight, lost):
    """While two sources contradict each other the word for no fix counts when no other one comes for so long."""
    return DOUBT_S if any(forged.fault.told and forged.lasts(lost.begin_s) for forged in flight.windows) else 0.0


def fix_was_doubted(flight, at_s):
    """Then, to the judge, what is said is no position that there was."""
    return any(lost.fault.no_position and lost.lasts(at_s) and doubt_s(flight, lost) for lost in flight.windows)


# Which way is up is decided by three seconds of the first climb, which begins with the flight's 8th second. A daemon that is
# killed before that leaves none that knows.
DECIDED_S, DECIDING_S = 14.0, 6.0


def began_undecided(flight, at_s):
    return any(one.fault.restarts and one.begin_s < DECIDED_S and one.lasts(at_s, longer_s=DECIDING_S) for one in flight.windows)


def autopilot_was_away(flight, at_s):
    """What is left then of two sources that contradict each other may be the one that isn't believed."""
    return any(one.fault.no_position and one.lasts(at_s) for one in flight.windows)


def is_taken_away(flight, channel, at_s):
    """That channel by itself: whatever it had stays on the air."""
    return any(one.channel == channel and one.fault.channels != ALL and one.lasts(at_s, longer_s=lateness_s(flight))
               for one in flight.windows)


def was_away(flight, channel, at_s):
    """A radio that is there again begins with what it had before."""
    return any(one.channel == channel and one.lasts(at_s, longer_s=lateness_s(flight)) for one in flight.windows)


def normally_s(flight, what):
    if what == "newer position":
        return NEWER_LATE_S if flight.world.late[0] else NEWER_S
    return OTHERS_LATE_S if flight.world.late[0] else OTHERS_S


def all_waits(flight, heard, until_s, names):
    return chain.from_iterable(
        waits(flight, channel, name, (heard[channel].times if channel in heard else NOTHING_HEARD)[name], until_s)
        for channel in flight.channels for name in names)


def waits(flight, channel, what, times, until_s):
    """A newer position, and every other message, within its time; where it was taken away, within the fault's time from its
    end on."""
    late_s, ordinary_s = lateness_s(flight), normally_s(flight, what)
    windows = [one for one in flight.windows if one.channel == channel]
    for before, after in pairwise([WARM_UP_S, *times, until_s]):
        since_s, limit_s = before, ordinary_s
        for one in windows:
            # Until the next one after its end it is the fault's time that counts; of two, one after the other.
            if one.begin_s - ordinary_s < after and one.back_s + one.fault.limit_s > before:
                goes_on = one.fault.meanwhile_s < math.inf
                since_s = since_s if goes_on else max(since_s, min(one.back_s, after))
                limit_s += max(0.0, (one.fault.meanwhile_s if goes_on else one.fault.limit_s) - NEWER_S) + late_s
        if after - since_s > limit_s:
            yield f"{channel}: no {what} from {before:.3f} to {after:.3f} s, {limit_s:.2f} s allowed from {since_s:.3f} s on"


# --- what it says of itself ---------------------------------------------------------------


def what_was_told(flight):
    """(second, good, what else): the pilot, and the technician who asks."""
    for told in flight.autopilot.said:
        yield seconds(told.mono), told.good, "good to arm" if told.good else told.reason
    for answer in flight.technician.answers:
        yield seconds(answer["at_s"]), answer["reason"] is None, answer["reason"] or "nothing is wrong"


def began_anew(flight, until_s):
    """(from, to) of the times without a daemon. The one that comes then has to find out by itself what is wrong, as any
    that begins: a chip that says OK and sends nothing is on the air to it, at first."""
    return {(one.begin_s, one.back_s) for one in flight.windows if one.fault.kept and one.begin_s < until_s}


def not_heard_since(flight, times, channel, at_s):
    """The last newer position before that instant, where it is too long ago and none comes right after it; else None. On a
    channel that is taken away it could only be missed from when there was one to be said, and from when the daemon ran."""
    place = bisect_right(times, at_s)
    there = [one for one in flight.windows if one.channel == channel and one.begin_s < at_s]
    away = any(one.fault.channels != ALL and one.back_s + one.fault.limit_s > at_s for one in there)
    last_s = max([*times[:place][-1:], 0.0, *(one.back_s for one in there if away and one.fault.no_position and one.back_s < at_s),
                  *(back_s for _, back_s in began_anew(flight, at_s))])
    soon = times[place:place + 1] and times[place] - at_s < normally_s(flight, "newer position")
    return last_s if at_s - last_s > GOOD_S + lateness_s(flight) and not soon else None


def good_is_true(flight, heard):
    """Nobody is told that all is well where nobody has heard a newer position for long."""
    for at_s, good, what in what_was_told(flight):
        for channel in flight.channels if good and at_s >= WARM_UP_S + GOOD_S else ():
            last_s = not_heard_since(flight, newer(heard, channel), channel, at_s)
            if last_s is not None:
                yield f"{channel}: \"{what}\" at {at_s:.3f} s, the last newer position was heard at {last_s:.3f} s"


def something_was_wrong(flight, at_s, channel=None):
    """Then, or shortly before: with that channel, or at all."""
    return any(channel in (None, one.channel) and one.lasts(at_s, at_s + ROUNDED_S, longer_s=BAD_S + lateness_s(flight))
               for one in flight.windows)


def bad_is_true(flight):
    """Nor that something is wrong where nothing is."""
    for at_s, good, what in what_was_told(flight):
        if not good and at_s > WARM_UP_S and not something_was_wrong(flight, at_s):
            yield f"\"{what}\" at {at_s:.3f} s, and nothing was wrong"


# Words of what is wrong, by the part that something was done to.
NAMED = {"chip": ("Bluetooth",), "hostapd": ("Wi-Fi", "hostapd"), "autopilot": ("autopilot", "GNSS", "position", "MAVLink")}


def status_is_true(flight, heard):
    """Each channel's state, since when, and where it is said to be: as it was heard."""
    for answer in flight.technician.answers:
        at_s = seconds(answer["at_s"])
        if at_s < WARM_UP_S + GOOD_S:
            continue
        for channel in flight.channels:
            yield from channel_is_true(flight, newer(heard, channel), channel, answer["channels"][channel], at_s)
        off = [channel for channel, said in answer["channels"].items() if said["required"] and said["state"] != "on air"]
        if answer["on_air"] and off:
            yield f"\"on air\" at {at_s:.3f} s, and {', '.join(off)} isn't"
        anew_s = max((back_s for _, back_s in began_anew(flight, at_s)), default=0.0)
        lasting = {one.fault.part for one in flight.windows if one.begin_s < at_s < one.back_s and
                   one.fault.meanwhile_s == math.inf and
                   max(one.begin_s + doubt_s(flight, one), anew_s) + GOOD_S + lateness_s(flight) < at_s}
        reasons = [one["reason"] for one in answer["problems"]]
        for part in lasting & NAMED.keys():
            if not any(word in reason for word in NAMED[part] for reason in reasons):
                yield f"{part} at {at_s:.3f} s, and the status names {', '.join(reasons) or 'nothing'}"
        if not something_was_wrong(flight, at_s) and not is_where_it_was_heard(heard, answer["position"], at_s):
            yield f"the status at {at_s:.3f} s has another position than was heard: {answer['position']}"


def channel_is_true(flight, times, channel, said, at_s):
    silent_s = not_heard_since(flight, times, channel, at_s)
    if said["state"] == "on air":
        # Without a position it is on the air, and says that there is none.
        none = any(one.fault.no_position and one.channel == channel and one.lasts(at_s, longer_s=GOOD_S + lateness_s(flight))
                   for one in flight.windows)
        if silent_s is not None and not none:
            yield f"{channel}: \"on air\" at {at_s:.3f} s, the last newer position was heard at {silent_s:.3f} s"
    elif not something_was_wrong(flight, at_s, channel):
        yield f"{channel}: \"{said['state']}\" at {at_s:.3f} s, and nothing was wrong with it"
    elif (since_s := at_s - said["since_s"]) + SINCE_S + lateness_s(flight) < at_s:
        known_s = max((one.fault.known_s + lateness_s(flight) for one in flight.windows if
                       one.fault.known_s and one.channel == channel and one.lasts(at_s, longer_s=lateness_s(flight))), default=0.0)
        later = times[bisect_right(times, since_s + SINCE_S + lateness_s(flight)):bisect_right(times, at_s - MADE_S - known_s)]
        # A radio that takes too long for each is as good as lost.
        if any(after - before < SLOWLY_S for before, after in pairwise(later)):
            yield f"{channel}: \"{said['state']}\" since {since_s:.3f} s, and newer positions were heard from {later[0]:.3f} s on"


def is_where_it_was_heard(heard, position, at_s):
    """On some channel, two seconds before or after: an aircraft's way of that time apart at most."""
    def apart_deg(location):
        east_deg = (location.longitude_deg - position["longitude_deg"]) * math.cos(math.radians(location.latitude_deg))
        return math.hypot(location.latitude_deg - position["latitude_deg"], east_deg)
    if position["latitude_deg"] is None:
        return not any(track.near(at_s) for track in heard.values())
    return any(apart_deg(location) < WAY_DEG for track in heard.values() for _, location in track.near(at_s))


def faults_are_told(flight, until_s):
    """Those that take nothing away."""
    for one in flight.windows:
        ends_s = one.back_s + one.fault.limit_s
        if one.fault.told and ends_s < until_s and not any(
                not told.good and one.begin_s < seconds(told.mono) < ends_s for told in flight.autopilot.said):
            yield f"{one.fault.name} at {one.begin_s:.3f} s, and the pilot wasn't told"


def it_is_told(flight, until_s):
    """Every second; but where the autopilot can't hear it, or nobody is there to say it."""
    late_s = lateness_s(flight)
    nobody = [one for one in flight.windows if one.channel == ALL[0] and one.fault.channels == ALL]
    for before, after in pairwise([WARM_UP_S, *(seconds(told.mono) for told in flight.autopilot.said), until_s]):
        if after - before > TOLD_S + late_s and not any(one.lasts(before, after, longer_s=TOLD_S) for one in nobody):
            yield f"no ARM_STATUS from {before:.3f} to {after:.3f} s"


# --- the flight record -----------------------------------------------------------------------


def recorded_gaps(flight):
    """(channel, from, to) in seconds of the flight."""
    return [(one["channel"], seconds(one["t"]), seconds(one["t"] + one["seconds"]))
            for one in flight.record()["events"] if one["event"] == "gap"]


def between_daemons(flight, since_s, until_s):
    """Of a silence what was known to one daemon, and to the one after it."""
    for begin_s, back_s in sorted(began_anew(flight, until_s)):
        known_s = back_s + GOOD_S + lateness_s(flight)
        if known_s > since_s:
            yield since_s, max(since_s, begin_s)
            since_s = known_s
    if since_s < until_s:
        yield since_s, until_s


def gaps_are_recorded(flight, heard, found, until_s):
    """Where nobody heard anything newer for long, and it was taken away, the record has it: as soon as it has been written."""
    for channel, track in heard.items():
        for before, after in pairwise(track.times["newer position"]):
            # Without a position no channel is missed.
            before = max([before, *(min(one.back_s, after) for one in flight.windows if one.channel == channel and
                                    one.fault.no_position and one.begin_s < after and one.back_s > before)])
            taken = any(one.channel == channel and one.fault.channels != ALL and one.begin_s < after and one.back_s > before
                        for one in flight.windows)
            written = after < until_s - WRITTEN_S - RECORD_S
            for silent, heard_again in between_daemons(flight, before, after) if taken and written else ():
                if heard_again - silent > GAP_S + flight.world.late[1] / 1e6 and not any(
                        where == channel and begin < silent + RECORD_S and end > heard_again - RECORD_S for where, begin, end in found):
                    yield f"{channel}: silent from {silent:.3f} to {heard_again:.3f} s, and the flight record doesn't say so"


def recorded_gaps_were(flight, found):
    """And nothing else."""
    for channel, begin, end in found:
        if not any(one.channel == channel and one.lasts(begin, end, longer_s=RECORD_S) for one in flight.windows):
            yield f"{channel}: the flight record has a gap from {begin:.3f} to {end:.3f} s, and there was none"


def clock_is_right(flight):
    """Ten seconds after it was set by whom it may, the system's clock is the autopilot's again."""
    off_s = (flight.world.realtime_us + flight.world.now_us) / 1e6 - flight.world.unix_s
    if abs(off_s) > 1.5:
        yield f"the system's clock is {off_s:.1f} s off at the end"


# --- what it costs -----------------------------------------------------------------------------


def costs(flight, until_s):
    """Bounded wake-ups; no descriptor and no memory more than when all was on the air."""
    daemon = flight.world.called("odid-daemon")
    frames = sum(frame.at_s < until_s for frame in flight.autopilot.frames)
    if not flight.kept and daemon.wakeups > WAKE_UPS_HZ * until_s + WAKE_UPS_A_FRAME * frames:
        yield f"{daemon.wakeups} wake-ups in {until_s:.0f} s"
    files, kib = daemon.descriptors(), daemon.memory_kib()
    before = flight.costs_at_first
    if before and before[0] == daemon.pid:
        if files > before[1] + 1:
            yield f"{files} descriptors at the end, {before[1]} at {WARM_UP_S:g} s"
        if kib > before[2] + MEMORY_KIB:
            yield f"{kib} KiB of memory at the end, {before[2]} at {WARM_UP_S:g} s"
