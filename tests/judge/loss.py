"""Drops receptions on purpose, for the edge of range: seeded, so that a run can be repeated.

Independent losses, or bursts by Gilbert's model: a chain of two states, in one
of which everything is lost.  With share `p` and mean burst length `b` the chain
leaves the lossy state with 1/b and enters it with p / (b * (1 - p)).
"""

from __future__ import annotations

import random


class Loss:
    def __init__(self, probability: float = 0.0, mean_burst: float = 1.0, seed: int = 1):
        if not 0.0 <= probability < 1.0:
            raise ValueError(f"loss is {probability}, expected 0 <= P < 1")
        if mean_burst < 1.0:
            raise ValueError(f"mean burst is {mean_burst} receptions, expected 1 or more")
        self.probability = probability
        self.mean_burst = mean_burst
        self.seed = seed
        self._enter = min(1.0, probability / (mean_burst * (1.0 - probability)))
        if mean_burst > 1.0 and self._enter >= 1.0:
            raise ValueError(f"a loss of {probability} needs longer bursts than {mean_burst}")
        self._random = {}
        self._lossy = {}

    def drops(self, channel: str) -> bool:
        """Decides about the channel's next reception; channels fade independently."""
        if not self.probability:
            return False
        source = self._random.setdefault(channel, random.Random(f"{self.seed} {channel}"))
        if self.mean_burst == 1.0:
            return source.random() < self.probability
        lossy = self._lossy.get(channel, source.random() < self.probability)
        lossy = source.random() >= 1.0 / self.mean_burst if lossy else source.random() < self._enter
        self._lossy[channel] = lossy
        return lossy

    def __str__(self) -> str:
        if not self.probability:
            return "none"
        kind = f"bursts of {self.mean_burst:g} on average" if self.mean_burst > 1 else "independent"
        return f"{self.probability:.0%} of all receptions dropped on purpose ({kind}, seed {self.seed})"


def parse_loss(text: str) -> tuple[float, float]:
    """`0.5` or `0.5,burst=3`, as in the environment variable LOSS."""
    share, _, rest = text.partition(",")
    burst = 1.0
    if rest:
        name, _, value = rest.partition("=")
        if name.strip() != "burst":
            raise ValueError(f"LOSS={text}: expected P or P,burst=N")
        burst = float(value)
    return float(share), burst
