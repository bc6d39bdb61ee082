"""A MODEL of the BCM43455's Wi-Fi half, firmware running, as the driver brcmfmac sees it, on USB.

QEMU has no SDIO bus to put a chip on; brcmfmac's USB bus speaks the same control protocol (BCDC) and leads to the same
code of the driver's. So what is real is everything from hostapd to the driver's bus; the bus, the loading of the firmware
and what the firmware makes of it are ours. Each connection of QEMU's (--listen SOCKET, its `usb-redir`) is a power-on:
the driver meets a boot loader, whose chip it has no firmware for on this bus, and a moment later the chip is back with one
that runs. By then the driver's module has started: with a firmware that runs from the outset it would ask for its second
module (brcmfmac-wcc, since 6.2) within its own start, and wait for ever, as it never has to with the board's chip.
Beacons, and answers to whom an order sends, go into the pcap that the judge hears (--out).

The requests, events and structures are those of Linux' brcmfmac (fwil.h, fwil_types.h, fweh.h, bcdc.c, usb.c,
cfg80211.c) as its versions 6.1 and 6.12 use them; the counters' layout is that of Broadcom's public driver's wl_cnt_t,
version 10. What the answers say of the chip (version, features, channels) is modelled on logs of Raspberry Pi's
7.45.265. That a "del" of an element that the firmware hasn't got fails is a guess to the worse.

Orders, one a line on standard input, each answered by "done" or "error: ...":
  refuse NAME STATUS [COUNT]   the next COUNT (1; 0: all) settings of this variable end with this status, as -30
  limit OCTETS       longer vendor elements are refused; 0: none is
  silence | speak    the firmware says OK to everything, and sends no beacon
  crash [SECONDS]    the firmware has crashed: the chip falls off the bus, and is back after so long (1) with a fresh one
  hang               each request fails, after a second, until the driver is bound anew, which switches the chip's power
  unplug | plug      the chip is gone, and there again; before a power-on: there is none
  late SECONDS       the next power-ons have the firmware running so late; 0: at once
  probe ADDRESS      a station asks who is there
  associate ADDRESS  a station comes in as far as the firmware lets it, and hostapd is told
"""

import argparse
import asyncio
import functools
import struct
import sys
import time

from . import usbredir

# The firmware's commands, of which two read and write variables by name.
GET_VERSION, UP, DOWN, SET_SSID, GET_REGULATORY, SET_REGULATORY = 1, 2, 3, 26, 46, 47
SET_BEACON_PERIOD, SET_DTIM_PERIOD, GET_REVISION, SET_AP, GET_BANDS = 76, 78, 98, 118, 140
GET_ASSOCIATED, DEAUTHENTICATE, GET_VARIABLE, SET_VARIABLE = 159, 201, 262, 263
UNSUPPORTED, TOO_SHORT, NOT_FOUND = -23, -14, -30
ERROR, SET = 1 << 0, 1 << 1  # of a request's flags

# The boot loader's requests, which a running firmware answers, too.
IN_VENDOR, OUT_CLASS, IN_CLASS = 0xC1, 0x21, 0xA1
GET_BOOT_VERSION, RESET_CONFIGURATION = 5, 8
BOOT_LOADER, RUNNING = 0x4345, 0xA123  # what says so
LOADED_S = 1.0
ASKED_S = 2.0  # within which a driver that is there asks something
HUNG_S = 1.0  # the driver waits for 2 s; what it gives up by itself would end QEMU (usbredir.py)

ASSOCIATION, DISASSOCIATED, INTERFACE = 8, 12, 54  # events
EVENT_ETHERTYPE, BROADCOM = 0x886C, bytes([0x00, 0x10, 0x18])
BEACON, PROBE_RESPONSE = 1 << 0, 1 << 1  # where an element goes
WPA2_PSK = 0x80

MAC = bytes.fromhex("b827eb455001")
VERSION = b"BCM4345/6 wl0: Aug 29 2023 01:47:08 version 7.45.265 (model) FWID 01-b677b91b\n"
CAPABILITIES = b"ap sta wme 802.11d 802.11h rm cqa cac dualband ampdu radio_pwrsave p2p mchan wnm bsstrans mfp "
CHANNELS = [0x1000 | channel for channel in range(1, 14)] + [0xD000 | channel for channel in (36, 40, 44, 48)]
REVISION = (0x14E4, 0x43AB, 0, 6, 0x2F, 0x6E4, 0x14E4, 0x1304, 0x72D0000, 0, 0, 0x4345, 11, 20, 0, 2, 0)
COUNTERS_VERSION, COUNTERS, TBTT, FRAMES_SENT, BEACONS_SENT = 10, 64, 45, 48, 53  # places in 32-bit words
TIME_UNIT_S = 1.024e-3

PCAP = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 127)  # 127: radiotap
RATES = bytes.fromhex("010882848b960c121824")
RSN = bytes.fromhex("30140100000fac040100000fac040100000fac020000")
AFTER = bytes.fromhex("2a0100" "32043048606c")  # ERP, the other rates


def words(*values):
    return struct.pack(f"<{len(values)}I", *(value & 0xFFFFFFFF for value in values))


def word(data):
    return int.from_bytes(data[:4], "little")


class Bss:
    """A network of the firmware's: the first one is wlan0's."""

    def __init__(self, mac):
        self.mac, self.ssid, self.is_ap, self.elements = mac, b"", False, []

    def elements_for(self, where):
        return b"".join(element for flags, element in self.elements if flags & where)

    def change_elements(self, data, limit):
        """The variable vndr_ie: {verb, count, {where, element} ...}, once or more. Returns the firmware's status."""
        while len(data) >= 12:
            verb, count, data = data[:4].rstrip(b"\0"), word(data[4:]), data[8:]
            for _ in range(count):
                length = data[5] + 2
                one, data = (word(data), data[4:4 + length]), data[4 + length:]
                if len(one[1]) != length or verb == b"add" and limit and length > limit:
                    return TOO_SHORT
                if verb == b"add":
                    self.elements.append(one)
                elif one in self.elements:
                    self.elements.remove(one)
                else:
                    return NOT_FOUND
        return 0


class Firmware:
    """What runs on the chip, from power-on: requests in, answers out; `tell` takes events, `send` frames for the air."""

    def __init__(self, tell, send, faults):
        self.tell, self.send, self.faults = tell, send, faults
        self.networks = {0: Bss(MAC)}
        self.variables = {"chanspec": words(CHANNELS[0]), "country": b"XX\0\0" + words(0) + b"XX\0\0"}
        self.is_up, self.regulatory = False, 0
        self.period, self.dtim, self.sequence, self.counters = 100, 1, 0, [0] * COUNTERS

    # --- requests -----------------------------------------------------------

    def request(self, message):
        """The answer to a BCDC request, both {command, length, flags, status} and the data."""
        command, length, flags, _ = struct.unpack_from("<IIII", message)
        result = self._command(command, message[16:], flags & SET, flags >> 12 & 15)
        status, body = (result, b"") if isinstance(result, int) else (0, result)
        flags = flags & ~ERROR | (ERROR if status else 0)
        return words(command, length, flags, status) + body.ljust(length, b"\0")[:length]

    def _command(self, command, data, is_set, interface):
        if command in (GET_VARIABLE, SET_VARIABLE):
            name, _, data = data.partition(b"\0")
            if name.startswith(b"bsscfg:"):
                name, interface, data = name.removeprefix(b"bsscfg:"), word(data), data[4:]
            reached = self._set if command == SET_VARIABLE else self._get
            return reached(name.decode(), data, interface)
        answers = {GET_VERSION: words(2), GET_REVISION: words(*REVISION), GET_BANDS: words(2, 2, 1),
                   GET_ASSOCIATED: words(0), GET_REGULATORY: words(self.regulatory)}
        if command in answers:
            return answers[command]
        network = self.networks.get(interface, self.networks[0])
        if command in (UP, DOWN):
            self.is_up = command == UP
        elif command == SET_AP:
            network.is_ap = bool(word(data))
        elif command == SET_SSID:
            network.ssid = data[4:4 + word(data)]
        elif command == SET_BEACON_PERIOD:
            self.period = word(data)
        elif command == SET_DTIM_PERIOD:
            self.dtim = word(data)
        elif command == SET_REGULATORY:
            self.regulatory = word(data)
        elif command == DEAUTHENTICATE:
            self._deauthenticate(network, data[4:10], word(data))
        elif not is_set:
            return UNSUPPORTED
        return b""

    def _get(self, name, data, _interface):
        fixed = {"cur_etheraddr": MAC, "ver": VERSION, "clmver": b"API: 12.2\n", "cap": CAPABILITIES, "nmode": words(1),
                 "vhtmode": words(1), "rxchain": words(1), "txstreams": words(1), "per_chan_info": words(3),
                 "event_msgs": bytes(18), "sup_wpa": words(0), "mfp": words(0), "pfn": words(0), "p2p_dev": words(1)}
        if name == "chanspecs":
            wanted = [] if int.from_bytes(data[:2], "little") else CHANNELS
            return words(len(wanted), *wanted)
        if name == "bw_cap":  # of 5 GHz: 20, 40 and 80 MHz
            return words(7 if word(data) == 1 else 1)
        if name == "counters":
            return struct.pack("<HH", COUNTERS_VERSION, 4 + 4 * COUNTERS) + words(*self.counters)
        return self.variables.get(name, fixed.get(name, UNSUPPORTED))

    def _set(self, name, data, interface):
        status = self.faults.refused(name)
        if status:
            return status
        if name == "vndr_ie":
            return self.networks.get(interface, self.networks[0]).change_elements(data, self.faults.limit) or b""
        if name == "ssid" and interface and interface not in self.networks:
            self._add_network(interface)
        elif name == "interface_remove":
            self.networks.pop(interface, None)
        self.variables[name] = bytes(data)
        return b""

    def _add_network(self, number):
        """A second interface: the firmware says when it is there."""
        mac = bytes([MAC[0] | 2, *MAC[1:5], MAC[5] ^ number])
        self.networks[number] = Bss(mac)
        self.tell(self.event(INTERFACE, mac, bytes([number, 1, 0, number, 1]), interface=number))

    # --- events -------------------------------------------------------------

    @staticmethod
    def event(code, address, data=b"", status=0, reason=0, interface=0):
        """As an Ethernet frame of Broadcom's own type, behind BCDC's head of four octets."""
        message = struct.pack(">HHIIIII", 2, 0, code, status, reason, 0, len(data)) + address
        message += b"wl0".ljust(16, b"\0") + bytes([interface, interface]) + data
        head = struct.pack(">HHB3sH", 0x8001, len(message) + 10, 0, BROADCOM, 1)
        ethernet = MAC + bytes([MAC[0] | 2]) + MAC[1:] + EVENT_ETHERTYPE.to_bytes(2, "big")
        return bytes([0x20, 0, interface, 0]) + ethernet + head + message

    # --- the air ------------------------------------------------------------

    def on_air(self):
        return [network for network in self.networks.values() if self.is_up and network.is_ap and network.ssid]

    @property
    def channel(self):
        return word(self.variables["chanspec"]) & 0xFF

    def _elements(self, network, where):
        tim = bytes([5, 4, 0, self.dtim, 0, 0]) if where == BEACON else b""
        rsn = RSN if word(self.variables.get("wpa_auth", b"")) & WPA2_PSK else b""
        return (bytes([0, len(network.ssid)]) + network.ssid + RATES + bytes([3, 1, self.channel]) + tim + rsn + AFTER
                + network.elements_for(where))

    def _frame(self, kind, network, to, body):
        self.sequence = (self.sequence + 1) & 0xFFF
        self.counters[FRAMES_SENT] += 1
        self.send(self.channel, struct.pack("<HH", kind, 0) + to + network.mac * 2
                  + struct.pack("<H", self.sequence << 4) + body)

    def _fixed(self):
        privacy = 0x10 if word(self.variables.get("wsec", b"")) else 0
        return struct.pack("<QHH", time.monotonic_ns() // 1000, self.period, 0x401 | privacy)

    def beacon(self):
        """The moment for one has come."""
        for network in self.on_air():
            self.counters[TBTT] += 1
            if not self.faults.silent:
                self.counters[BEACONS_SENT] += 1
                self._frame(0x80, network, b"\xff" * 6, self._fixed() + self._elements(network, BEACON))

    def probe(self, station):
        for network in self.on_air():
            self._frame(0x50, network, station, self._fixed() + self._elements(network, PROBE_RESPONSE))

    def associate(self, station):
        """Authentication and association are the firmware's; what comes of it is hostapd's to say."""
        for network in self.on_air():
            self._frame(0xB0, network, station, struct.pack("<HHH", 0, 2, 0))
            self._frame(0x10, network, station, struct.pack("<HHH", 0x431, 0, 0xC001) + RATES)
            number = next(key for key, value in self.networks.items() if value is network)
            elements = bytes([0, len(network.ssid)]) + network.ssid + RATES + RSN
            self.tell(self.event(ASSOCIATION, station, elements, interface=number))

    def _deauthenticate(self, network, station, reason):
        self._frame(0xC0, network, station, struct.pack("<H", reason))


class Faults:
    """What orders have made wrong; it outlasts the firmware."""

    def __init__(self):
        self.silent, self.limit, self._refusals = False, 0, {}

    def refuse(self, name, status, count):
        self._refusals[name] = [status, count]

    def refused(self, name):
        """The status that this setting ends with; 0: it is taken."""
        status, left = self._refusals.get(name, (0, 0))
        if left == 1:
            del self._refusals[name]
        elif left:
            self._refusals[name][1] -= 1
        return status


class WifiChip(usbredir.UsbDevice):
    """The chip on the bus; `send` takes frames for the air, `later` calls something after so many seconds."""

    speed = usbredir.FULL  # raspi4b's host controller has no other
    device = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0200, 0xFF, 0, 0, 64, 0x0A5C, 0x0BDC, 1, 1, 2, 3, 1)
    _interface = struct.pack("<9B", 9, 4, 0, 0, 2, 0xFF, 2, 0xFF, 0) + b"".join(
        struct.pack("<BBBBHB", 7, 5, address, 2, 64, 0) for address in (0x82, 0x03))
    configuration = struct.pack("<BBHBBBBB", 9, 2, 9 + len(_interface), 1, 1, 0, 0x80, 250) + _interface
    strings = {1: "Broadcom", 2: "BCM43455 (model)", 3: "1"}

    def __init__(self, send, later):
        super().__init__()
        self._send_frame, self._later = send, later
        self.faults, self.firmware = Faults(), None
        self.present, self.late_s, self.loaded = True, 0.0, False
        self._answer, self._hung, self._fallen = b"", False, None

    # --- power --------------------------------------------------------------

    def _start_firmware(self):
        self._hung, self._answer = False, b""
        self.firmware = Firmware(self.bulk_in, self._send_frame, self.faults)

    def connected(self, write):
        super().connected(write)
        self.loaded, self._fallen = False, None

    def ready(self):
        if self.present:
            self._later(self.late_s, self.plug)

    def plug(self):
        if self.present and self.write is not None and not self.plugged:
            if self.loaded:
                self._start_firmware()
            super().plug()

    def _load(self):
        if not self.loaded:
            self.unplug()
            self.loaded = True
            self.plug()

    def unplug(self, last=b""):
        super().unplug(last)
        self.firmware = None

    def _fall(self, then):
        """Off the bus: right behind its next answer, when no request is under way (usbredir.py)."""
        def fallen(last=b""):
            if self._fallen is fallen:
                self._fallen = None
                self.unplug(last)
                then()
        self._fallen = fallen
        self._later(ASKED_S, fallen)

    def disconnected(self):
        super().disconnected()
        self.firmware = None

    # --- USB ----------------------------------------------------------------

    def _control(self, ident, body):
        kind, request = body[2], body[1]
        if kind == IN_VENDOR and request in (GET_BOOT_VERSION, RESET_CONFIGURATION):
            # A driver begins. On the board it has just switched the chip's power.
            if self.loaded and (self._hung or request == RESET_CONFIGURATION):
                self._start_firmware()
            elif not self.loaded:
                self._later(LOADED_S, self._load)
        if self._hung and kind in (OUT_CLASS, IN_CLASS):
            self._later(HUNG_S, lambda: self.plugged and self.answer_control(ident, body, None))
        elif self._fallen:
            self._fallen(self.control_answer(ident, body, None))
        else:
            super()._control(ident, body)

    def control(self, kind, request, value, index, data):
        if kind == IN_VENDOR:
            return words(RUNNING if self.loaded else BOOT_LOADER, 0, 0, 0, 0, 0)
        if self.firmware is None:
            return None
        if (kind, request) == (OUT_CLASS, 0):
            self._answer = self.firmware.request(data)
            return b""
        return self._answer if (kind, request) == (IN_CLASS, 1) else None

    # --- orders -------------------------------------------------------------

    def obey(self, order):
        name, *values = order or [""]
        one = {"refuse": self._refuse, "limit": self._limit, "silence": self._silence, "speak": self._silence,
               "crash": self._crash, "hang": self._hang, "unplug": self._take, "plug": self._put, "late": self._late,
               "probe": self._station, "associate": self._station}.get(name)
        if one is None:
            raise ValueError(f"unknown order {' '.join(order)!r}")
        try:
            one(name, *values)
        except TypeError:
            raise ValueError(f"{name}: not so many values") from None

    def _refuse(self, _, variable, status, count="1"):
        self.faults.refuse(variable, int(status), int(count))

    def _limit(self, _, octets):
        self.faults.limit = int(octets)

    def _silence(self, name):
        self.faults.silent = name == "silence"

    def _crash(self, _, seconds="1"):
        if self.firmware is None:
            raise ValueError("there is no firmware that runs")
        seconds = float(seconds)
        self._fall(lambda: self._later(seconds, self.plug))

    def asked(self):
        if self._hung:
            self.end_bulk_in()

    def _hang(self, _):
        self._hung = True
        self.asked()

    def _take(self, _):
        self.present = False
        self._fall(lambda: None)

    def _put(self, _):
        self.present = True
        self.plug()

    def _late(self, _, seconds):
        self.late_s = float(seconds)

    def _station(self, name, address):
        if self.firmware is None or not self.firmware.on_air():
            raise ValueError("nobody is on the air")
        station = bytes.fromhex(address.replace(":", ""))
        (self.firmware.probe if name == "probe" else self.firmware.associate)(station)


class AirFile:
    """The pcap that the judge follows: whole records only."""

    def __init__(self, path):
        self._file = open(path, "ab", buffering=0)
        if not self._file.tell():
            self._file.write(PCAP)

    def send(self, channel, frame):
        radiotap = struct.pack("<BBHIBBHH", 0, 0, 14, 1 << 2 | 1 << 3, 2, 0, 2407 + 5 * channel, 0xA0)
        seconds, micros = divmod(time.time_ns() // 1000, 1_000_000)
        size = len(radiotap) + len(frame)
        self._file.write(struct.pack("<IIII", seconds, micros, size, size) + radiotap + frame)


async def beacons(chip):
    """At each beacon's moment, whoever was late before."""
    due = time.monotonic()
    while True:
        due = max(due + (chip.firmware.period if chip.firmware else 100) * TIME_UNIT_S, time.monotonic())
        await asyncio.sleep(due - time.monotonic())
        if chip.firmware:
            chip.firmware.beacon()


async def run(listen, out):
    chip = WifiChip(AirFile(out).send, asyncio.get_running_loop().call_later)
    await usbredir.listen(listen, functools.partial(usbredir.serve, chip))
    ticking = asyncio.create_task(beacons(chip))
    await usbredir.until_orders_end(chip.obey)
    ticking.cancel()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", required=True, metavar="SOCKET", help="UNIX socket for QEMU's usb-redir")
    parser.add_argument("--out", required=True, metavar="PCAP", help="what is on the air")
    arguments = parser.parse_args()
    try:
        asyncio.run(run(arguments.listen, arguments.out))
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
