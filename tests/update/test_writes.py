"""The record of writes and the disks made of it, without a machine."""

import random

from . import writes
from .writes import SECTOR


def record(path, *requests):
    """(sector, octets, flags), written as QEMU does."""
    with open(path, "wb") as file:
        file.write(writes.HEAD.pack(writes.MAGIC, writes.VERSION, len(requests), SECTOR).ljust(SECTOR, b"\0"))
        for sector, data, flags in requests:
            file.write(writes.ENTRY.pack(sector, len(data) // SECTOR, flags, 0).ljust(SECTOR, b"\0"))
            file.write(data)
    return path


def sectors(letters):
    return b"".join(letter.encode() * SECTOR for letter in letters)


def content(path):
    data = path.read_bytes()
    return "".join(chr(data[at]) for at in range(0, len(data), SECTOR))


def example(folder):
    base = folder / "base"
    base.write_bytes(sectors("........"))
    log = record(folder / "log", (0, sectors("ab"), 0), (4, sectors("c"), 0), (0, b"", writes.FLUSH),
                 (1, sectors("XYZ"), 0), (6, sectors("d"), 0), (0, b"", writes.FLUSH))
    return base, log, writes.read(log)


def test_a_record_is_read_back(tmp_path):
    _, log, requests = example(tmp_path)
    assert writes.count(log) == len(requests) == 6
    assert [(one.sector, one.sectors) for one in requests] == [(0, 2), (4, 1), (0, 0), (1, 3), (6, 1), (0, 0)]
    assert writes.boundaries(requests) == [3, 6]


def test_all_before_the_boundary_and_what_was_chosen(tmp_path):
    base, log, requests = example(tmp_path)
    out = tmp_path / "out"
    writes.disk(base, log, requests, 3, [], out)
    assert content(out) == "ab..c..."
    writes.disk(base, log, requests, 3, [requests[4]], out)
    assert content(out) == "ab..c.d."
    writes.disk(base, log, requests, 6, [], out)
    assert content(out) == "aXYZc.d."


def test_what_a_cut_may_leave(tmp_path):
    """None, all, each alone, and torn ones; never a sector of both."""
    base, log, requests = example(tmp_path)
    out, seen = tmp_path / "out", set()
    for seed in range(300):
        _, extra = writes.left(requests, 3, random.Random(seed))
        writes.disk(base, log, requests, 3, extra, out)
        seen.add(content(out))
        assert set(content(out)) <= set("abcXYZd.")
    assert {"ab..c...", "aXYZc.d.", "ab..c.d.", "aXYZc..."} <= seen
    assert any("X" in one and "Z" not in one for one in seen)       # torn at 512 octets
    assert "ab..c..." in seen


def test_a_cut_falls_on_every_boundary_that_counts(tmp_path):
    _, _, requests = example(tmp_path)
    cuts = writes.choose(requests, 5, 1, [(0, 1)])
    assert len(cuts) == 5
    assert cuts[0].boundary == 3
    assert {cut.boundary for cut in cuts} <= {3, 6}
    assert writes.choose(requests, 5, 1, [(0, 1)]) == cuts
    assert writes.choose(requests, 5, 2, [(0, 1)]) != cuts
    assert len(writes.choose(requests, 1, 1, [(0, 8)])) == 1


def test_a_cut_falls_before_what_counts_is_on_the_disk(tmp_path):
    """Only then it can be torn."""
    _, _, requests = example(tmp_path)
    assert {cut.boundary for cut in writes.choose(requests, 2, 1, [(6, 1)])} == {3, 6}
    assert writes.during(requests, (6, 1)) == [3]
    assert [cut.boundary for cut in writes.choose_from([3, 6], 3, 1)] == [3, 6, 3]
