"""The models of the Compute Module's chips, asked as their drivers ask, octet by octet; no QEMU, no kernel."""

import select
import socket
import struct

import parts
import patience
import pytest

from . import air, bluetooth_chip, usb_serial, usbredir, wifi_chip
from .bluetooth_chip import DEFAULT_ADDRESS
from .controller import free_ports
from .front import Packets

# --- Bluetooth -----------------------------------------------------------------------

SET_PARAMETERS, SET_DATA, SET_ENABLE, READ_FEATURES = 0x2006, 0x2008, 0x200A, 0x2003
SET_EXTENDED_PARAMETERS = 0x2036
PAYLOAD = bytes([0x1E, 0x16, 0xFA, 0xFF, 0x0D, 7]) + b"a message".ljust(25, b"\0")


class Uart:
    """The driver's end of the line."""

    def __init__(self, port):
        self._socket, self._packets, self._events = socket.create_connection(("127.0.0.1", port)), Packets(), []

    def send(self, opcode, parameters=b""):
        self._socket.sendall(struct.pack("<BHB", 1, opcode, len(parameters)) + parameters)

    def event(self):
        """The next one's opcode, status and what follows."""
        self._socket.settimeout(patience.LIMIT_S)
        while not self._events:
            self._events += self._packets.feed(self._socket.recv(4096))
        packet = self._events.pop(0)
        if packet[1] == 0x0F:
            return packet[5] | packet[6] << 8, packet[3], b""
        return packet[4] | packet[5] << 8, packet[6], packet[7:]

    def command(self, opcode, parameters=b""):
        self.send(opcode, parameters)
        answered, status, rest = self.event()
        assert answered == opcode
        return status, rest

    def is_quiet(self):
        return not self._events and not select.select([self._socket], [], [], 0.2)[0]  # nothing comes

    def close(self):
        self._socket.close()


@pytest.fixture
def bluetooth(short_folder, rootcanal):
    """Starts the chip in a mode; gives the part and the driver's end of its line."""
    started = []

    def start(mode="bcm43455"):
        (port,) = free_ports(1)
        part = parts.Part(parts.python("models.bluetooth_chip", "--listen", port, "--hci-port", rootcanal.hci_port,
                                       "--mode", mode), short_folder / "chip.log", orders=True)
        assert part.process.stdout.readline() == "done\n", part.log()
        started.append((part, Uart(port)))
        return started[-1]

    yield start
    for part, uart in started:
        uart.close()
        part.stop()


def load_patch(uart):
    """As btbcm does; the answers' statuses."""
    data, statuses = bluetooth_chip.patch_file(), [uart.command(bluetooth_chip.MINIDRIVER)[0]]
    while data:
        opcode, length = struct.unpack_from("<HB", data)
        statuses.append(uart.command(opcode, data[3:3 + length])[0])
        data = data[3 + length:]
    return statuses


def advertise(uart):
    """Whether each step is taken."""
    parameters = struct.pack("<HHBBB6sBB", 0xA0, 0xA0, 3, 0, 0, bytes(6), 7, 0)
    return [uart.command(opcode, data)[0] for opcode, data in (
        (SET_PARAMETERS, parameters), (SET_DATA, bytes([31]) + PAYLOAD), (SET_ENABLE, b"\1"))]


def build(uart):
    return struct.unpack_from("<H", uart.command(bluetooth_chip.READ_VERSION)[1], 1)[0]


def test_the_driver_finds_the_chip_and_loads_its_patch(bluetooth):
    _, uart = bluetooth()
    assert uart.command(bluetooth_chip.RESET)[0] == 0
    status, version = uart.command(bluetooth_chip.READ_VERSION)
    assert status == 0 and struct.unpack("<BHBHH", version) == (8, 0, 8, 15, 0x6119)
    # With their status these are 7 and 9 octets: the driver takes no others.
    assert [len(uart.command(opcode)[1]) for opcode in (0xFC79, 0xFC6E)] == [6, 8]
    assert uart.command(0xFC18, struct.pack("<HI", 0, 2_000_000))[0] == 0
    assert set(load_patch(uart)) == {0}
    assert build(uart) == bluetooth_chip.BUILD
    assert uart.command(0xFC99)[0] == 0x01, "a command of Broadcom's that it doesn't know"


def test_the_address_is_the_default_one_until_one_is_written(bluetooth):
    part, uart = bluetooth()
    assert uart.command(bluetooth_chip.READ_ADDRESS) == (0, DEFAULT_ADDRESS)
    own = bytes.fromhex("01 02 03 32 a6 dc")
    assert uart.command(bluetooth_chip.WRITE_ADDRESS, own)[0] == 0
    assert uart.command(bluetooth_chip.READ_ADDRESS) == (0, own)
    assert part.order("reset") == "done"
    assert uart.command(bluetooth_chip.READ_ADDRESS) == (0, DEFAULT_ADDRESS)


@pytest.mark.parametrize("mode, at_20_ms", [("legacy20", 0x00), ("bcm43455", 0x12)])
def test_it_knows_legacy_advertising_only(bluetooth, mode, at_20_ms):
    _, uart = bluetooth(mode)
    uart.command(bluetooth_chip.RESET)
    assert uart.command(READ_FEATURES)[1][1] & 0x18 == 0
    assert uart.command(SET_PARAMETERS, struct.pack("<HHBBB6sBB", 0x20, 0x20, 3, 0, 0, bytes(6), 7, 0))[0] == at_20_ms
    assert uart.command(SET_EXTENDED_PARAMETERS, bytes(25))[0] == 0x01


def test_what_it_advertises_is_on_the_air_and_ends_with_its_reset(bluetooth, rootcanal):
    part, uart = bluetooth()
    listener = air.Air(rootcanal.hci_port)
    try:
        uart.command(bluetooth_chip.RESET)
        assert advertise(uart) == [0, 0, 0]
        patience.wait_for("an advertisement", lambda: listener.receptions("bt4"))
        assert listener.receptions("bt4")[0].data == PAYLOAD[4:]
        assert part.order("reset") == "done"
        patience.wait_for("silence", lambda: not listener.heard("bt4", 0.5))
    finally:
        listener.stop()
    assert build(uart) == bluetooth_chip.UNPATCHED_BUILD and part.order("reset now").startswith("error")


def test_a_hang_ends_with_a_reset_and_patch_and_address_are_kept(bluetooth):
    part, uart = bluetooth()
    load_patch(uart)
    uart.command(bluetooth_chip.WRITE_ADDRESS, bytes(range(6)))
    assert part.order("hang") == "done"
    uart.send(READ_FEATURES)
    uart.send(bluetooth_chip.READ_VERSION)
    uart.send(bluetooth_chip.RESET)
    assert uart.event()[:2] == (bluetooth_chip.RESET, 0), "nothing else was answered"
    assert build(uart) == bluetooth_chip.BUILD
    assert uart.command(bluetooth_chip.READ_ADDRESS) == (0, bytes(range(6)))


def test_events_get_lost(bluetooth):
    part, uart = bluetooth()
    assert part.order("lose 2") == "done"
    for opcode in (bluetooth_chip.READ_VERSION, bluetooth_chip.READ_VERSION, bluetooth_chip.READ_ADDRESS):
        uart.send(opcode)
    assert uart.event()[0] == bluetooth_chip.READ_ADDRESS


def test_answers_to_the_patch_come_late_and_no_others(bluetooth):
    part, uart = bluetooth()
    assert part.order("late 0.2") == "done"
    uart.send(bluetooth_chip.MINIDRIVER)
    uart.send(bluetooth_chip.READ_ADDRESS)
    assert [uart.event()[0] for _ in range(2)] == [bluetooth_chip.READ_ADDRESS, bluetooth_chip.MINIDRIVER]


def test_flow_control_stops_and_goes_on(bluetooth):
    part, uart = bluetooth()
    assert part.order("stop") == "done"
    uart.send(bluetooth_chip.READ_ADDRESS)
    uart.send(bluetooth_chip.READ_VERSION)
    assert uart.is_quiet()
    assert part.order("go") == "done"
    assert [uart.event()[0] for _ in range(2)] == [bluetooth_chip.READ_ADDRESS, bluetooth_chip.READ_VERSION]


# --- USB -----------------------------------------------------------------------------


class Qemu:
    """usb-redir's end: what a device sends, cut into packets; transfers as a kernel asks for them."""

    def __init__(self, device, capabilities=usbredir.CAPABILITIES):
        self.device, self.packets, self.ident = device, [], 0
        self._data, self._size = b"", 12
        device.connected(self._take)
        self.send(usbredir.HELLO, b"test".ljust(64, b"\0") + struct.pack("<I", capabilities))

    def _take(self, data):
        self._data += data
        while len(self._data) >= self._size:
            kind, length, ident = struct.unpack_from("<IIQ" if self._size == 16 else "<III", self._data)
            self.packets.append((kind, ident, self._data[self._size:self._size + length]))
            self._data = self._data[self._size + length:]

    def send(self, kind, body):
        """Returns the packet's id."""
        self.ident += 1
        head = struct.pack("<IIQ" if self._size == 16 else "<III", kind, len(body), self.ident)
        if kind == usbredir.HELLO:
            self._size = 16
        self.device.received(head + body)
        return self.ident

    def answer_to(self, ident):
        """The packet with that id, once; None: there is none yet."""
        for packet in self.packets:
            if packet[1] == ident:
                self.packets.remove(packet)
                return packet[2]
        return None

    def control(self, kind, request, data=b"", value=0, length=0):
        """Status and data."""
        length = len(data) or length
        answer = self.answer_to(self.send(usbredir.CONTROL, struct.pack(
            "<BBBBHHH", kind & 0x80, request, kind, 0, value, 0, length) + data))
        return None if answer is None else (answer[3], answer[10:])

    def ask(self, length=2048):
        """For something from the bulk endpoint; the request's id."""
        return self.send(usbredir.BULK, struct.pack("<BBHIH", 0x82, 0, length, 0, 0))

    def given(self, ident):
        """Status and data of such a request; None: it is open still."""
        answer = self.answer_to(ident)
        return None if answer is None else (answer[1], answer[10:])

    def kinds(self):
        return [kind for kind, _, _ in self.packets]


class Later:
    """Instead of a clock: what was asked for, and a hand that does it."""

    def __init__(self):
        self.asked = []

    def __call__(self, seconds, what):
        self.asked.append([seconds, what])
        return Cancelled(self.asked, self.asked[-1])

    def come(self):
        """All that is due; how late that was."""
        due, self.asked[:] = list(self.asked), []
        for _, what in due:
            what()
        return [seconds for seconds, _ in due]


class Cancelled:
    def __init__(self, asked, one):
        self._asked, self._one = asked, one

    def cancel(self):
        self._asked[:] = [one for one in self._asked if one is not self._one]


def test_a_device_says_what_it_is():
    qemu = Qemu(usb_serial.UsbSerial(Later()))
    assert qemu.kinds() == [usbredir.HELLO, usbredir.INTERFACE_INFO, usbredir.EP_INFO, usbredir.DEVICE_CONNECT]
    interfaces, endpoints, device = (body for _, _, body in qemu.packets[1:])
    assert struct.unpack_from("<I", interfaces)[0] == 2
    assert endpoints[usbredir.slot(0x82)] == 2 and endpoints[usbredir.slot(0x81)] == 3 and endpoints[5] == usbredir.UNUSED
    assert struct.unpack("<BBBBHHH", device) == (usbredir.FULL, 2, 0, 0, 0x1209, 0x5740, 0x0200)
    assert qemu.control(0x80, usbredir.GET_DESCRIPTOR, value=1 << 8, length=18)[1] == qemu.device.device
    status, text = qemu.control(0x80, usbredir.GET_DESCRIPTOR, value=3 << 8 | 3, length=255)
    assert status == 0 and text[2:].decode("utf-16-le") == "AUTOPILOT"
    assert qemu.control(0x80, usbredir.GET_DESCRIPTOR, value=9 << 8, length=9)[0] == usbredir.STALL
    # What a configuration's descriptors say of their own length.
    whole = qemu.device.configuration
    assert struct.unpack_from("<H", whole, 2)[0] == len(whole)


def test_a_peer_that_can_less_is_spoken_to_so():
    device, sent = usb_serial.UsbSerial(Later()), []
    device.connected(sent.append)
    device.received(struct.pack("<III", usbredir.HELLO, 68, 1) + bytes(68))
    assert [struct.unpack_from("<III", one)[:2] for one in sent[1:]] == [
        (usbredir.INTERFACE_INFO, 132), (usbredir.EP_INFO, 96), (usbredir.DEVICE_CONNECT, 8)]


def test_the_autopilot_s_octets_come_and_go_and_nobody_who_listens_misses_the_newest():
    port, heard = usb_serial.UsbSerial(Later()), []
    qemu = Qemu(port)
    port.line = heard.append
    one = qemu.ask(128)
    assert qemu.given(one) is None
    port.say(b"a" * 100)
    assert qemu.given(one) == (0, b"a" * 63) and qemu.given(qemu.ask(128)) == (0, b"a" * 37)
    qemu.send(usbredir.BULK, struct.pack("<BBHIH", 0x03, 0, 5, 0, 0) + b"hello")
    assert heard == [b"hello"]
    port.say(b"b" * 63 * 1000)  # nobody reads
    assert port.unread == usb_serial.UNREAD


def test_a_port_is_closed_when_nothing_is_asked_for_any_more():
    later = Later()
    qemu = Qemu(usb_serial.UsbSerial(later))
    one = qemu.ask()
    close = qemu.send(usbredir.CONTROL, struct.pack("<BBBBHHH", 0, usb_serial.SET_LINE_STATE, 0x21, 0, 0, 0, 0))
    assert qemu.given(one)[0] == usbredir.IO_ERROR and qemu.answer_to(close) is None
    assert qemu.given(qemu.ask())[0] == usbredir.IO_ERROR, "the driver tries again"
    assert later.come() == [usb_serial.QUIET_S]
    assert qemu.answer_to(close)[3] == usbredir.SUCCESS
    assert qemu.given(qemu.ask()) is None, "the next one waits for the autopilot as ever"


def test_a_cable_that_is_pulled_leaves_nothing_open():
    port = usb_serial.UsbSerial(Later())
    qemu = Qemu(port)
    first, second = qemu.ask(), qemu.ask()
    qemu.packets.clear()
    port.obey(["unplug"])
    assert qemu.kinds() == [usbredir.BULK, usbredir.BULK, usbredir.DEVICE_DISCONNECT]
    assert [qemu.given(one)[0] for one in (first, second)] == [usbredir.IO_ERROR] * 2
    qemu.packets.clear()
    qemu.ask()
    port.say(b"into nothing")
    assert not qemu.packets
    port.obey(["plug"])
    assert qemu.kinds()[-1] == usbredir.DEVICE_CONNECT and port.unread == 0
    with pytest.raises(ValueError, match="unknown order"):
        port.obey(["pull"])


def test_the_autopilot_connects_to_its_line(short_folder):
    part = parts.Part(parts.python("models.usb_serial", "--listen", short_folder / "qemu", "--line", short_folder / "line"),
                      short_folder / "port.log", orders=True)
    try:
        assert part.process.stdout.readline() == "done\n", part.log()
        with socket.socket(socket.AF_UNIX) as qemu, socket.socket(socket.AF_UNIX) as line:
            qemu.connect(str(short_folder / "qemu"))
            line.connect(str(short_folder / "line"))
            qemu.settimeout(patience.LIMIT_S)
            assert struct.unpack_from("<I", qemu.recv(80))[0] == usbredir.HELLO
            assert part.order("unplug") == "done" and part.order("nonsense").startswith("error")
    finally:
        part.stop()


# --- Wi-Fi ---------------------------------------------------------------------------

STATION = "02:00:00:00:00:07"
ELEMENT = bytes.fromhex("dd08fa0bbc0d01f01901")


class Driver:
    """brcmfmac's side of the control protocol."""

    def __init__(self):
        self.frames, self.later = [], Later()
        self.chip = wifi_chip.WifiChip(lambda channel, frame: self.frames.append((channel, frame)), self.later)
        self.qemu = Qemu(self.chip)
        self.later.come()
        self.ask_version()
        self.later.come()

    def ask_version(self):
        """What a driver asks first. The firmware runs a moment after the first time."""
        return int.from_bytes(self.qemu.control(0xC1, 5, length=24)[1][:4], "little")

    def request(self, command, data=b"", is_set=False, length=None, interface=0):
        """Status and answer; None: the chip says nothing."""
        length = len(data) if length is None else length
        flags = 0x1234 << 16 | interface << 12 | (2 if is_set else 0)
        if self.qemu.control(0x21, 0, struct.pack("<IIII", command, length, flags, 0) + data.ljust(length, b"\0")) is None:
            return None
        answer = self.qemu.control(0xA1, 1, length=2048)[1]
        answered, got, back, status = struct.unpack_from("<IIIi", answer)
        assert (answered, got, back >> 16) == (command, length, 0x1234) and bool(back & 1) == bool(status)
        return status, answer[16:]

    def set(self, name, value=b"", network=0):
        prefix = b"bsscfg:" if network else b""
        index = struct.pack("<I", network) if network else b""
        return self.request(263, prefix + name.encode() + b"\0" + index + value, is_set=True)[0]

    def get(self, name, length=64):
        return self.request(262, name.encode() + b"\0", length=length)

    def element(self, verb, element, flags=wifi_chip.BEACON):
        return verb.ljust(4, b"\0") + struct.pack("<II", 1, flags) + element

    def access_point(self, channel=6, ssid=b"RemoteID-1"):
        self.set("chanspec", struct.pack("<I", 0x1000 | channel))
        self.set("wpa_auth", struct.pack("<I", 0x80))
        self.set("wsec", struct.pack("<I", 4))
        for command, value in ((118, 1), (2, 1)):
            self.request(command, struct.pack("<I", value), is_set=True)
        return self.request(26, struct.pack("<I", len(ssid)) + ssid.ljust(32, b"\0"), is_set=True)[0]

    def beacon(self):
        """The next one, or None."""
        self.frames.clear()
        self.chip.firmware.beacon()
        return self.frames[0][1] if self.frames else None


def elements(frame):
    """{number: octets} of a beacon or an answer to a probe; vendors' are a list."""
    found, at = {221: []}, 36
    while at < len(frame):
        number, octets = frame[at], frame[at + 2:at + 2 + frame[at + 1]]
        if number == 221:
            found[221].append(octets)
        else:
            found[number] = octets
        at += 2 + frame[at + 1]
    return found


@pytest.fixture(name="driver")
def wifi_driver():
    return Driver()


def test_a_boot_loader_comes_before_the_firmware_once_a_power_on(driver):
    assert driver.qemu.kinds().count(usbredir.DEVICE_CONNECT) == 2
    driver.chip.disconnected()
    driver.qemu = Qemu(driver.chip)
    driver.later.come()
    assert driver.qemu.control(0x21, 0, bytes(16))[0] == usbredir.STALL
    assert [driver.ask_version(), driver.ask_version()] == [wifi_chip.BOOT_LOADER] * 2
    assert driver.later.come() == [wifi_chip.LOADED_S] * 2
    assert driver.ask_version() == wifi_chip.RUNNING and driver.qemu.kinds().count(usbredir.DEVICE_CONNECT) == 2


def test_the_driver_takes_it_for_a_firmware_that_runs(driver):
    assert driver.ask_version() == 0xA123
    assert driver.get("cur_etheraddr", 6) == (0, wifi_chip.MAC)
    assert b" version 7.45" in driver.get("ver", 256)[1]
    assert driver.get("nonsense")[0] == wifi_chip.UNSUPPORTED
    assert driver.request(1, length=4) == (0, struct.pack("<I", 2))
    assert driver.request(9999, length=4)[0] == wifi_chip.UNSUPPORTED
    count, *channels = struct.unpack_from("<18I", driver.get("chanspecs", 400)[1])
    assert count == 17 and channels[5] == 0x1006


def test_an_access_point_sends_beacons_with_its_elements(driver):
    assert driver.beacon() is None
    assert driver.access_point() == 0
    frame = driver.beacon()
    assert frame[:1] == b"\x80" and frame[16:22] == wifi_chip.MAC and driver.frames[0][0] == 6
    found = elements(frame)
    assert found[0] == b"RemoteID-1" and found[3] == bytes([6]) and 48 in found and not found[221]
    assert driver.set("vndr_ie", driver.element(b"add", ELEMENT)) == 0
    assert elements(driver.beacon())[221] == [ELEMENT[2:]]
    newer = ELEMENT[:-1] + b"\x02"
    assert driver.set("vndr_ie", driver.element(b"del", ELEMENT) + driver.element(b"add", newer)) == 0
    assert elements(driver.beacon())[221] == [newer[2:]]
    assert driver.set("vndr_ie", driver.element(b"del", ELEMENT)) == wifi_chip.NOT_FOUND
    assert driver.request(26, bytes(36), is_set=True)[0] == 0
    assert driver.beacon() is None, "an empty name ends it"


def test_the_judge_s_scanner_reads_the_pcap(driver, tmp_path):
    file = wifi_chip.AirFile(tmp_path / "air.pcap")
    driver.access_point()
    driver.set("vndr_ie", driver.element(b"add", ELEMENT))
    file.send(6, driver.beacon())
    (heard,) = air.beacons(tmp_path / "air.pcap")
    assert (heard.channel, heard.address, heard.data) == ("wifi", "B8:27:EB:45:50:01", ELEMENT[5:])


def test_answers_to_probes_have_elements_of_their_own(driver):
    driver.access_point()
    driver.set("vndr_ie", driver.element(b"add", ELEMENT, wifi_chip.PROBE_RESPONSE))
    assert not elements(driver.beacon())[221]
    driver.frames.clear()
    driver.chip.obey(["probe", STATION])
    (_, frame), = driver.frames
    assert frame[:1] == b"\x50" and frame[4:10].hex(":") == STATION and elements(frame)[221] == [ELEMENT[2:]]


def test_a_second_interface_has_a_network_of_its_own(driver):
    waiting = driver.qemu.ask()
    assert driver.set("ssid", bytes(36), network=1) == 0
    status, event = driver.qemu.given(waiting)
    assert status == 0 and event[16:18] == b"\x88\x6c" and int.from_bytes(event[32:36], "big") == wifi_chip.INTERFACE
    for command, value in ((118, 1), (2, 1)):
        driver.request(command, struct.pack("<I", value), is_set=True, interface=1)
    driver.request(26, struct.pack("<I", 4) + b"ap0 ".ljust(32, b"\0"), is_set=True, interface=1)
    driver.set("vndr_ie", driver.element(b"add", ELEMENT), network=1)
    frame = driver.beacon()
    assert frame[16:22] != wifi_chip.MAC and elements(frame)[221] == [ELEMENT[2:]]
    assert driver.set("interface_remove", network=1) == 0 and driver.beacon() is None


def test_a_station_comes_in_and_is_sent_away(driver):
    driver.access_point()
    waiting = driver.qemu.ask()
    driver.chip.obey(["associate", STATION])
    assert [frame[:1] for _, frame in driver.frames] == [b"\xb0", b"\x10"]
    _, event = driver.qemu.given(waiting)
    address = bytes.fromhex(STATION.replace(":", ""))
    assert int.from_bytes(event[32:36], "big") == wifi_chip.ASSOCIATION and address in event
    assert driver.request(201, struct.pack("<I", 5) + address, is_set=True)[0] == 0
    assert driver.frames[-1][1][:1] == b"\xc0"


def test_an_element_is_refused_once_or_always_or_because_it_is_too_long(driver):
    driver.access_point()
    driver.chip.obey(["refuse", "vndr_ie", "-30"])
    assert driver.set("vndr_ie", driver.element(b"add", ELEMENT)) == -30
    assert not elements(driver.beacon())[221]
    assert driver.set("vndr_ie", driver.element(b"add", ELEMENT)) == 0
    driver.chip.obey(["refuse", "vndr_ie", "-14", "0"])
    assert [driver.set("vndr_ie", driver.element(b"add", ELEMENT)) for _ in range(3)] == [-14] * 3
    driver.chip.obey(["refuse", "vndr_ie", "0", "1"])
    driver.chip.obey(["limit", "100"])
    long = bytes([221, 150]) + bytes(150)
    assert driver.set("vndr_ie", driver.element(b"add", long)) == wifi_chip.TOO_SHORT
    assert driver.set("vndr_ie", driver.element(b"add", ELEMENT)) == 0


def test_a_silent_firmware_says_ok_and_only_its_counter_tells(driver):
    def sent():
        status, body = driver.get("counters", 512)
        assert status == 0 and struct.unpack_from("<H", body)[0] == 10
        return struct.unpack_from("<I", body, 4 + 4 * wifi_chip.BEACONS_SENT)[0]
    driver.access_point()
    before = sent()
    assert driver.beacon() and sent() == before + 1
    driver.chip.obey(["silence"])
    assert driver.set("vndr_ie", driver.element(b"add", ELEMENT)) == 0
    assert driver.beacon() is None and sent() == before + 1
    driver.chip.obey(["speak"])
    assert driver.beacon()


def test_a_firmware_that_crashes_falls_off_the_bus_and_comes_back_empty(driver):
    driver.access_point()
    waiting = driver.qemu.ask()
    driver.chip.obey(["crash", "2.5"])
    assert driver.qemu.kinds()[-1] != usbredir.DEVICE_DISCONNECT
    assert driver.qemu.control(0x21, 0, bytes(16))[0] == usbredir.STALL
    assert driver.qemu.given(waiting)[0] == usbredir.IO_ERROR
    assert driver.qemu.kinds()[-1] == usbredir.DEVICE_DISCONNECT and driver.chip.firmware is None
    with pytest.raises(ValueError, match="no firmware"):
        driver.chip.obey(["crash"])
    assert driver.later.come() == [wifi_chip.ASKED_S, 2.5]
    assert driver.qemu.kinds()[-1] == usbredir.DEVICE_CONNECT and driver.beacon() is None


def test_a_chip_that_hangs_fails_late_until_the_driver_is_bound_anew(driver):
    driver.access_point()
    waiting = driver.qemu.ask()
    driver.chip.obey(["hang"])
    assert driver.qemu.given(waiting)[0] == usbredir.IO_ERROR
    assert driver.request(2, b"\1\0\0\0", is_set=True) is None
    assert driver.later.come() == [wifi_chip.HUNG_S]
    assert driver.qemu.packets.pop()[2][3] == usbredir.STALL
    assert driver.qemu.control(0xC1, 5, length=24)[0] == 0
    assert driver.request(2, b"\1\0\0\0", is_set=True)[0] == 0 and driver.beacon() is None


def test_a_chip_that_is_not_there_or_late(driver):
    driver.chip.obey(["unplug"])
    driver.chip.disconnected()
    absent = Qemu(driver.chip)
    driver.later.come()
    assert absent.kinds() == [usbredir.HELLO] and driver.chip.firmware is None
    with pytest.raises(ValueError, match="nobody is on the air"):
        driver.chip.obey(["probe", STATION])
    driver.chip.obey(["plug"])
    assert absent.kinds()[-1] == usbredir.DEVICE_CONNECT
    driver.chip.obey(["late", "20"])
    driver.chip.disconnected()
    late = Qemu(driver.chip)
    assert late.kinds() == [usbredir.HELLO]
    assert driver.later.come() == [20] and late.kinds()[-1] == usbredir.DEVICE_CONNECT


@pytest.mark.parametrize("order", ["", "nonsense", "refuse", "limit", "limit much", "crash 1 2", "associate nobody"])
def test_a_wrong_order_is_refused(driver, order):
    driver.access_point()
    with pytest.raises(ValueError):
        driver.chip.obey(order.split())


def test_it_listens_for_qemu_and_beacons_come_by_themselves(short_folder):
    pcap = short_folder / "air.pcap"
    part = parts.Part(parts.python("models.wifi_chip", "--listen", short_folder / "qemu", "--out", pcap),
                      short_folder / "chip.log", orders=True)
    try:
        assert part.process.stdout.readline() == "done\n", part.log()
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(short_folder / "qemu"))
            driver = Driver.__new__(Driver)
            driver.qemu = RemoteQemu(line)
            assert driver.ask_version() == wifi_chip.BOOT_LOADER
            driver.qemu.wait_connected(2)
            driver.access_point()
            driver.set("vndr_ie", driver.element(b"add", ELEMENT))
            patience.wait_for("two beacons", lambda: len(air.beacons(pcap)) > 1, part=part)
            assert part.order("silence") == "done" and part.order("shout").startswith("error")
    finally:
        part.stop()


class RemoteQemu(Qemu):
    """The device is another process, at the end of a socket."""

    def __init__(self, line):
        self._line = line
        line.settimeout(patience.LIMIT_S)
        super().__init__(self)
        self.wait_connected(1)

    def wait_connected(self, times):
        while self.kinds().count(usbredir.DEVICE_CONNECT) < times:
            self._take(self._line.recv(65536))

    def connected(self, _):
        self._take(self._line.recv(80))

    def received(self, data):
        self._line.sendall(data)

    def answer_to(self, ident):
        while (answer := super().answer_to(ident)) is None:
            self._take(self._line.recv(65536))
        return answer
