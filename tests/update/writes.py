"""What a machine wrote to its disk and when it flushed, recorded by QEMU's blklogwrites; and the disks
that a power cut could leave: all that was flushed, and of what came later anything, torn anywhere.

The record's format is that of Linux's dm-log-writes: a head, then for each request a sector that
describes it, followed by its data.
"""

import random
import struct
import subprocess
from collections import namedtuple

SECTOR = 512
MAGIC, VERSION = 0x6A736677736872, 1
FLUSH, FUA, DISCARD, MARK = 1, 2, 4, 8
HEAD = struct.Struct("<QQQI")
ENTRY = struct.Struct("<QQQQ")

# at: where in the record the data are; sector, sectors: where on the disk.
Request = namedtuple("Request", "sector sectors flags at")


def drive(base, log):
    """QEMU's words for a disk whose requests are recorded."""
    return ("driver=blklogwrites,node-name=disk,log-sector-size=512,"
            f"file.driver=raw,file.file.driver=file,file.file.filename={base},"
            f"log.driver=file,log.filename={log}")


def count(log):
    """How many requests are in a record that is being written; at least so many are there."""
    with open(log, "rb") as file:
        head = file.read(HEAD.size)
    return HEAD.unpack(head)[2] if len(head) == HEAD.size else 0


def read(log):
    """The requests of a record, in order."""
    found = []
    with open(log, "rb") as file:
        magic, version, entries, size = HEAD.unpack(file.read(HEAD.size))
        if (magic, version, size) != (MAGIC, VERSION, SECTOR):
            raise ValueError(f"{log}: no record of blklogwrites with sectors of {SECTOR} octets")
        at = SECTOR
        for _ in range(entries):
            file.seek(at)
            sector, sectors, flags, _ = ENTRY.unpack(file.read(ENTRY.size))
            at += SECTOR
            found.append(Request(sector, sectors, flags, at))
            if not flags & DISCARD:
                at += sectors * SECTOR
    return found


def boundaries(requests):
    """Indexes after which everything before is on the disk for good."""
    return [index + 1 for index, request in enumerate(requests) if request.flags & (FLUSH | FUA)]


def touches(request, partition):
    """partition: (first sector, number of sectors)."""
    first, number = partition
    return request.sectors and request.sector < first + number and request.sector + request.sectors > first


# --- what a cut leaves ---------------------------------------------------------


def after(requests, boundary):
    """The requests that were under way: up to the next flush, which didn't end."""
    for end in range(boundary, len(requests)):
        if requests[end].flags & (FLUSH | FUA):
            return requests[boundary:end + 1]
    return requests[boundary:]


def pieces(request, chance):
    """A request torn at 512 octets or 4 KiB: those of its pieces that reached the disk."""
    step = chance.choice((1, 8))
    begin = request.sector
    while begin < request.sector + request.sectors:
        end = min(begin // step * step + step, request.sector + request.sectors)
        if chance.random() < 0.5:
            yield Request(begin, end - begin, 0, request.at + (begin - request.sector) * SECTOR)
        begin = end


def left(requests, boundary, chance, kind=None):
    """Of the requests under way: none, all, any ("some"), or any with one torn; by default one of these."""
    pending = [one for one in after(requests, boundary) if one.sectors and not one.flags & DISCARD]
    kind = kind or chance.choice(("none", "all", "some", "torn", "torn"))
    if kind == "none" or not pending:
        return "none", []
    if kind == "all":
        return kind, pending
    torn = chance.randrange(len(pending)) if kind == "torn" else None
    kept = []
    for index, request in enumerate(pending):
        if index == torn:
            kept += pieces(request, chance)
        elif chance.random() < 0.5:
            kept.append(request)
    return kind, kept


def disk(base, log, requests, boundary, extra, out):
    """Makes the disk: base, all requests before the boundary, and those of `extra`."""
    subprocess.run(["cp", "--sparse=always", base, out], check=True)
    with open(log, "rb") as record, open(out, "r+b") as image:
        for request in (*requests[:boundary], *extra):
            if not request.sectors:
                continue
            image.seek(request.sector * SECTOR)
            if request.flags & DISCARD:
                image.write(bytes(request.sectors * SECTOR))
                continue
            record.seek(request.at)
            image.write(record.read(request.sectors * SECTOR))


# --- which cuts -----------------------------------------------------------------

Cut = namedtuple("Cut", "number boundary seed kind", defaults=(None,))


def choose(requests, total, seed, covered):
    """`total` cuts: each boundary after a request that touches one of the partitions `covered` (first
    sector, sectors), and each before one, as far as there are not more than total, the rest at random."""
    chance = random.Random(seed)
    everywhere = boundaries(requests)
    before, wanted = 0, []
    for boundary in everywhere:
        if any(touches(request, place) for place in covered
               for request in (*requests[before:boundary], *after(requests, boundary))):
            wanted.append(boundary)
        before = boundary
    if len(wanted) > total:
        wanted = sorted(chance.sample(wanted, total))
    points = wanted + [chance.choice(everywhere) for _ in range(total - len(wanted))]
    return [Cut(number, boundary, chance.randrange(1 << 32)) for number, boundary in enumerate(points)]


def during(requests, partition):
    """The boundaries after which the partition is written to."""
    return [one for one in boundaries(requests) if any(touches(each, partition) for each in after(requests, one))]


def choose_from(points, total, seed, kind=None):
    """`total` cuts, as many as possible at each of these boundaries."""
    chance = random.Random(seed)
    return [Cut(number, points[number % len(points)], chance.randrange(1 << 32), kind) for number in range(total)]
