"""Content gaps: how long a receiver waited for a newer position, recomputed from the judge's receptions.

An interval is that between two receptions which each brought a newer Location: newer in the judge's
own sense, and another place or time (one that becomes unknown is no news). The last one, which has no
end yet when the window closes, counts with its length so far.
"""

from judge.findings import Findings
from judge.receptions import read_receptions
from judge.structure import check_structure
from judge.tracks import is_newer

CHANNELS = ("bt4", "bt5", "wifi")


class Contents:
    """When each channel brought something newer, and from which addresses."""

    def __init__(self, receptions_path):
        self.newer = {channel: [] for channel in CHANNELS}
        self.first = dict.fromkeys(CHANNELS)  # the first valid message of any kind
        self.addresses = {channel: [] for channel in CHANNELS}
        self.findings = Findings()
        last = {}
        for reception in read_receptions(receptions_path).receptions:
            heard = check_structure(reception, self.findings, any_version=False)
            if heard is None:
                continue
            channel = reception.channel
            if self.first[channel] is None:
                self.first[channel] = reception.mono
            if reception.address not in self.addresses[channel]:
                self.addresses[channel].append(reception.address)
            for message in heard.messages:
                if message.type_name == "location" and self._is_news(last.get(channel), message):
                    last[channel] = message
                    self.newer[channel].append(reception.mono)

    @staticmethod
    def _is_news(before, now):
        if now.latitude_deg is None:
            return False
        return before is None or is_newer(before, now) and (
            (before.latitude_deg, before.longitude_deg, before.timestamp_s)
            != (now.latitude_deg, now.longitude_deg, now.timestamp_s))

    def longest_gap_s(self, channel, from_mono, until_mono, clip=False):
        """The longest interval that reaches into the window. clip: counted from the window's
        beginning, for hardware that was away before."""
        times = [mono for mono in self.newer[channel] if mono < until_mono]
        before = [mono for mono in times if mono <= from_mono]
        start = from_mono if clip or not before else before[-1]
        edges = [start, *(mono for mono in times if mono > from_mono), until_mono]
        return max(later - earlier for earlier, later in zip(edges, edges[1:]))

    def worst_gap(self, channels, from_mono, until_mono, clip=False):
        """(seconds, channel)"""
        return max((self.longest_gap_s(channel, from_mono, until_mono, clip), channel) for channel in channels)
