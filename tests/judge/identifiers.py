"""Structure of serial numbers and operator numbers.  Wrong ones are notes, not
violations: an identifier in the wrong format is still to be broadcast.

CTA-2063-A serial: four characters of manufacturer code, one length code (1-9,
A-F), then that many characters; digits and capital letters without O and I.
EU operator number: country code of three letters, 12 characters, one check
character; what follows is secret and must never be on the air.
"""

from __future__ import annotations

import re

_LENGTH_CODES = "0123456789ABCDEF"
_SERIAL_CHARACTERS = re.compile(r"[0-9A-HJ-NP-Z]+")


def serial_problem(serial: str) -> str | None:
    if len(serial) < 6:
        return f"serial {serial!r}: {len(serial)} characters, at least 6 are needed"
    if not _SERIAL_CHARACTERS.fullmatch(serial):
        return f"serial {serial!r}: only 0-9 and A-Z without O and I are allowed"
    length = _LENGTH_CODES.find(serial[4])
    if length < 1:
        return f"serial {serial!r}: {serial[4]!r} is no length code (1-9, A-F)"
    if len(serial) != 5 + length:
        return f"serial {serial!r}: length code {serial[4]} announces {length} characters, {len(serial) - 5} follow"
    return None


def operator_problem(operator: str) -> str | None:
    if not re.fullmatch(r"[A-Z]{3}[0-9a-z]{13}", operator):
        if re.fullmatch(r"[A-Z]{3}[0-9a-z]{13}-?[0-9a-z]{3}", operator):
            return "operator number: the three secret characters are on the air"
        return f"operator number {operator!r}: not three capital letters and 13 of 0-9, a-z"
    return None
