"""Where receptions come from: live radios, growing files, finished files.

Every source hands its receptions to one `Ear`, which filters by address and
drops some on purpose when asked to (loss.py).  Live sources stamp an event with
both clocks when it arrives; a file has the one clock its writer used.
"""

from __future__ import annotations

import asyncio
import socket
import time
from pathlib import Path

from . import carriers
from .capture_files import open_btsnoop, open_capture
from .hci_reports import HciReportError, ReportParser, is_advertising_event
from .loss import Loss
from .receptions import InputError, Reception, Run, from_advertisement, from_beacon

DLT_80211, DLT_RADIOTAP = 105, 127
DLT_BLE, DLT_BLE_PHDR, DLT_NORDIC_BLE = 251, 256, 272
_BEACON_DECODERS = {DLT_80211: carriers.beacon_in_80211, DLT_RADIOTAP: carriers.beacon_in_radiotap}
_ADVERTISEMENT_DECODERS = {
    DLT_BLE: lambda packet: carriers.advertisement_in_link_layer(packet, "1M"),
    DLT_BLE_PHDR: carriers.advertisement_in_phdr,
    DLT_NORDIC_BLE: carriers.advertisement_in_nordic_sniffer}
FOLLOW_POLL_S = 0.02
READY_S = 60  # so long a controller may take to answer


class Ear:
    """Collects what all sources hear."""

    def __init__(self, addresses: set[str], loss: Loss):
        self.run = Run()
        self.addresses = addresses
        self.loss = loss
        self.dropped = 0
        self._aircraft: set[str] = set()  # addresses from which Remote ID came

    def advertisement(self, time_s: float, mono_s: float, heard: carriers.Advertisement) -> None:
        if not self.addresses or heard.address in self.addresses:
            keep = bool(self.addresses) or (heard.damaged and heard.address in self._aircraft)
            self.add(from_advertisement(time_s, mono_s, heard, keep))

    def beacon(self, time_s: float, mono_s: float, heard: carriers.Beacon) -> None:
        if not self.addresses or heard.bssid in self.addresses:
            self.add(from_beacon(time_s, mono_s, heard, keep=bool(self.addresses)))

    def add(self, reception: Reception | None) -> None:
        if reception is None:
            return
        if reception.payload is not None:
            self._aircraft.add(reception.address)
        if self.loss.drops(reception.channel):
            self.dropped += 1
        else:
            self.run.receptions.append(reception)

    def saw(self, mono_s: float) -> None:
        """The source was listening at this moment, whatever it heard."""
        if self.run.start_mono is None or mono_s < self.run.start_mono:
            self.run.start_mono = mono_s
        if self.run.end_mono is None or mono_s > self.run.end_mono:
            self.run.end_mono = mono_s


def take_packet(ear: Ear, path: Path, packet, mono_s: float) -> None:
    """One packet of a capture file, 802.11 or Bluetooth."""
    if packet.link_type in _BEACON_DECODERS:
        beacon = _BEACON_DECODERS[packet.link_type](packet.data)
        if beacon:
            ear.beacon(packet.time, mono_s, beacon)
    elif packet.link_type in _ADVERTISEMENT_DECODERS:
        heard = _ADVERTISEMENT_DECODERS[packet.link_type](packet.data)
        if heard:
            ear.advertisement(packet.time, mono_s, heard)
    else:
        known = ", ".join(str(number) for number in (*_BEACON_DECODERS, *_ADVERTISEMENT_DECODERS))
        raise InputError(f"{path}: link type {packet.link_type} is none of {known}")


def read_pcap(ear: Ear, path: Path) -> None:
    """A finished pcap or pcapng file."""
    reader = open_capture(path)
    for packet in reader.packets():
        ear.saw(packet.time)
        take_packet(ear, path, packet, packet.time)
    _note_incomplete(ear, reader)


def read_btsnoop(ear: Ear, path: Path) -> None:
    """The advertising reports of a finished HCI dump."""
    reader, parser = open_btsnoop(path), ReportParser()
    for packet in reader.packets():
        ear.saw(packet.time)
        if is_advertising_event(packet.data):
            try:
                for heard in parser.parse(packet.data):
                    ear.advertisement(packet.time, packet.time, heard)
            except HciReportError as error:
                raise InputError(f"{path}: before octet {reader.offset}: {error}") from error
    _note_incomplete(ear, reader)


def _note_incomplete(ear: Ear, reader) -> None:
    reader.close()
    if not reader.started:
        raise InputError(f"{reader.path}: octet 0: the {reader.what} header is cut short")
    if reader.incomplete_octets():
        ear.run.notes.append(f"{reader.path.name}: the last {reader.incomplete_octets()} octets are no "
                             "complete record (its writer was interrupted); ignored")


async def follow_pcap(ear: Ear, path: Path) -> None:
    """A pcap that another program on this machine appends to, until cancelled.  Its
    time stamps are this machine's real-time clock.  It may not exist yet."""
    reader = None

    def take() -> None:
        nonlocal reader
        if reader is None and path.exists() and path.stat().st_size >= 24:
            reader = open_capture(path)
        if reader is not None:
            to_mono_s = time.monotonic() - time.time()
            for packet in reader.packets():
                take_packet(ear, path, packet, packet.time + to_mono_s)

    try:
        while True:
            take()
            await asyncio.sleep(FOLLOW_POLL_S)
    finally:
        take()  # what was sent before the end counts, however late this listener is
        if reader is None:
            ear.run.notes.append(f"{path.name}: never appeared while it was waited for")
        else:
            reader.close()


class _Scanner:
    """Stands between Bumble's transport and its host: takes advertising reports
    out as they arrive, before anything parses, merges or filters them."""

    def __init__(self, ear: Ear, host):
        self.ear = ear
        self.host = host
        self.parser = ReportParser()
        self.lost = asyncio.get_running_loop().create_future()

    def on_packet(self, packet: bytes) -> None:
        mono_s, time_s = time.monotonic(), time.time()
        if not is_advertising_event(packet):
            self.host.on_packet(packet)
            return
        try:
            for heard in self.parser.parse(packet):
                self.ear.advertisement(time_s, mono_s, heard)
        except HciReportError as error:
            if not self.lost.done():
                self.lost.set_result(str(error))

    def on_transport_lost(self) -> None:
        if not self.lost.done():
            self.lost.set_result("the connection to the controller is lost")
        self.host.on_transport_lost()


async def scan_hci(ear: Ear, transport_name: str, ready: asyncio.Event) -> None:
    """Scans through an HCI controller until cancelled.

    Passive, both PHYs that Remote ID uses, window equal to interval (all the
    time), no duplicate filter.  Extended scanning where the controller lists it
    among its supported commands, else legacy scanning: Bluetooth 4 only.
    """
    try:
        from bumble import hci
        from bumble.host import Host
        from bumble.transport import open_transport
    except ImportError as error:
        raise InputError(f"--hci needs the Python package bumble: {error}") from error
    try:
        transport = await open_transport(transport_name)
    except Exception as error:  # Bumble passes on whatever the transport raised
        raise InputError(f"--hci {transport_name}: {type(error).__name__}: {error}") from error
    async with transport:
        host = Host(transport.source, transport.sink)
        scanner = _Scanner(ear, host)
        transport.source.set_packet_sink(scanner)
        try:
            await asyncio.wait_for(host.reset(), READY_S)
            extended = host.supports_command(hci.HCI_LE_SET_EXTENDED_SCAN_ENABLE_COMMAND)
            coded = extended and host.supports_le_features(hci.LeFeatureMask.LE_CODED_PHY)
            await asyncio.wait_for(_start_scanning(host, hci, extended, coded), READY_S)
        except Exception as error:
            raise InputError(f"--hci {transport_name}: the controller doesn't scan: "
                             f"{type(error).__name__}: {error}") from error
        mode = "extended scan, 1M and Coded PHY" if coded else "extended scan, 1M PHY" if extended else "legacy scan"
        ear.run.sources.append(f"HCI {transport_name} ({mode}, passive, window = interval)")
        if not coded:
            ear.run.notes.append(f"HCI {transport_name}: no Coded PHY, Bluetooth 5 Long Range can't be heard here")
        ready.set()
        raise InputError(f"--hci {transport_name}: {await scanner.lost}")


async def _start_scanning(host, hci, extended: bool, coded: bool) -> None:
    interval = 0x0010  # 10 ms, in units of 0.625 ms
    if extended:
        phys = 0x05 if coded else 0x01
        count = 2 if coded else 1
        await host.send_sync_command(hci.HCI_LE_Set_Extended_Scan_Parameters_Command(
            own_address_type=0, scanning_filter_policy=0, scanning_phys=phys, scan_types=[0] * count,
            scan_intervals=[interval] * count, scan_windows=[interval] * count))
        await host.send_sync_command(hci.HCI_LE_Set_Extended_Scan_Enable_Command(
            enable=1, filter_duplicates=0, duration=0, period=0))
    else:
        await host.send_sync_command(hci.HCI_LE_Set_Scan_Parameters_Command(
            le_scan_type=0, le_scan_interval=interval, le_scan_window=interval,
            own_address_type=0, scanning_filter_policy=0))
        await host.send_sync_command(hci.HCI_LE_Set_Scan_Enable_Command(le_scan_enable=1, filter_duplicates=0))


async def listen_monitor(ear: Ear, interface: str, ready: asyncio.Event) -> None:
    """A Wi-Fi interface in monitor mode, until cancelled."""
    decoders = {801: carriers.beacon_in_80211, 803: carriers.beacon_in_radiotap}  # ARPHRD_IEEE80211(_RADIOTAP)
    try:
        kind = int(Path(f"/sys/class/net/{interface}/type").read_text())
        if kind not in decoders:
            raise InputError(f"--monitor {interface}: the interface isn't in monitor mode (type {kind}, "
                             "expected 801 or 803)")
        everything = 3  # ETH_P_ALL
        raw = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(everything))
        raw.bind((interface, everything))
        raw.setblocking(False)
    except OSError as error:
        hint = " (root or CAP_NET_RAW is needed)" if isinstance(error, PermissionError) else ""
        raise InputError(f"--monitor {interface}: {error.strerror}{hint}") from error
    ear.run.sources.append(f"monitor interface {interface}")
    ready.set()
    loop = asyncio.get_running_loop()
    with raw:
        while True:
            try:
                frame = await loop.sock_recv(raw, 65535)
            except OSError as error:
                raise InputError(f"--monitor {interface}: {error.strerror}") from error
            mono_s, time_s = time.monotonic(), time.time()
            beacon = decoders[kind](frame)
            if beacon:
                ear.beacon(time_s, mono_s, beacon)
