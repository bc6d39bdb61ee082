"""Rules about the message counter.

One per message type on Bluetooth 4 (both Basic IDs share one, all pages of an
Authentication message carry the same value), one per pack elsewhere.  It must
step when the content changes, may step on a repetition, and wraps 255 -> 0.
From a lossless air it can be told which payloads were set and never sent.
"""

from __future__ import annotations

from .findings import Findings
from .messages import is_pack
from .tracks import Heard, Track

_FORGET_S = 12.0  # ten payloads a second: after so long a silence they may have been half of the 256


def check_counters(track: Track, findings: Findings, judge_lost: bool, lost_margin: int) -> int:
    """Checks one track; returns how many payloads were set and never heard.

    `judge_lost`: a lost payload is a violation (Bluetooth 4 on a lossless air)
    once there are more than `lost_margin` of them.
    """
    lost_total = 0
    before: dict[int, Heard] = {}  # by message type
    contents: dict[tuple, bytes] = {}  # newest by message type and kind
    for heard in track.heard:
        first = heard.messages[0]
        key, name, content_key = (0xF, "pack", 0xF) if is_pack(heard.body) else (
            first.type_number, first.type_name, first.content_key)
        last = before.get(key)
        changed = contents.get(content_key, heard.body) != heard.body
        contents[content_key] = heard.body
        before[key] = heard
        if last is None or heard.reception.mono - last.reception.mono > _FORGET_S:
            continue
        step = (heard.counter - last.counter) % 256
        if step == 0 and changed:
            findings.violation("counter.stuck", heard.reception, f"{name}: the content changed and the counter didn't",
                               f"{(last.counter + 1) % 256}", heard.counter)
        elif step >= 128:
            findings.violation("counter.backward", heard.reception, f"{name}: the counter went backward",
                               f"{last.counter} or {(last.counter + 1) % 256}", heard.counter)
        elif step > 1:
            lost_total += step - 1
            if judge_lost and lost_total > lost_margin:
                findings.violation(
                    "counter.lost", heard.reception,
                    f"{name}: {step - 1} payload{'s' if step > 2 else ''} lost: set by the transmitter, never sent",
                    f"counter {(last.counter + 1) % 256}", f"counter {heard.counter}")
    return lost_total
