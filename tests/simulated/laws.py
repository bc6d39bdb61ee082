"""What holds in every world, whatever was done to the flight in it. A law says where it was broken; none: it held.

The judge knows nothing of faults: to it a channel that was taken away is silent. So its rules about time are asked
here, beside what was done; all its other rules hold as they are.
"""

from receiver.findings import ABOUT_TIME

from .flight import WARM_UP_S
from .world import START_US

NEWER_S = 0.45  # on a machine that isn't late: the 4 Hz of the slots, and a chip's interval
NEWER_LATE_S = 1.0  # (2nd), on any


def broken_laws(flight, until_s):
    """Sentences."""
    judgement = flight.judged()
    broken = [f"{violation.kind} at {violation.mono - START_US / 1e6 if violation.mono else 0:.3f} s on {violation.channel}: "
              f"{violation.what}; expected {violation.expected}, found {violation.found}"
              for violation in judgement.findings.violations if violation.kind not in ABOUT_TIME]
    heard = {track.channel: track for track in judgement.tracks}
    for channel in flight.channels:
        news = [where.reception.mono - START_US / 1e6 for where, _ in heard[channel].newer_locations()] \
            if channel in heard else []
        broken += waits(flight, channel, news, until_s)
    return broken


def waits(flight, channel, news, until_s):
    """A newer position within its time; where it was taken away, within the fault's time from its end on."""
    normally_s = NEWER_LATE_S if flight.world.late[0] else NEWER_S
    late_s = flight.world.late[1] / 1e6
    windows = [one for one in flight.windows if one.channel == channel]
    times = [WARM_UP_S, *news, until_s]
    for before, after in zip(times, times[1:]):
        since_s, limit_s = before, normally_s
        for one in windows:
            # Until the next newer position after its end it is the fault's time that counts.
            if one.begin_s - normally_s < after and one.back_s + one.limit_s > before:
                since_s, limit_s = max(since_s, min(one.back_s, after)), max(limit_s, one.limit_s + 2 * late_s)
        if after - since_s > limit_s:
            yield f"{channel}: no newer position from {before:.3f} to {after:.3f} s, {limit_s:.2f} s allowed from {since_s:.3f} s on"
