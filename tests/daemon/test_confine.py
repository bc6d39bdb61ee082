"""Programs without a filter of their own, started so that they keep away from the radios."""

import errno
import os
import pwd
import subprocess
import sys

import parts
import pytest

SYS_IOCTL = {"x86_64": 16, "aarch64": 29}[os.uname().machine]
CONFINE = parts.DAEMON.with_name("odid-confine")
TRY = """
import ctypes, socket, sys
libc = ctypes.CDLL(None, use_errno=True)
made = libc.socket({family}, socket.{kind}, {protocol})
sys.exit(0 if made >= 0 else ctypes.get_errno())
"""


def tried(family, kind, protocol=0, words=(CONFINE,)):
    """0, or the error of making such a socket."""
    program = TRY.format(family=family, kind=kind, protocol=protocol)
    return subprocess.run([*words, os.path.realpath(sys.executable), "-c", program]).returncode


@pytest.mark.parametrize("family, kind, protocol", [
    ("socket.AF_BLUETOOTH", "SOCK_RAW", 1),  # HCI
    ("socket.AF_BLUETOOTH", "SOCK_SEQPACKET", 0),  # L2CAP
    ("socket.AF_PACKET", "SOCK_RAW", 0), ("socket.AF_ALG", "SOCK_SEQPACKET", 0), ("socket.AF_VSOCK", "SOCK_STREAM", 0)])
def test_no_socket_of_a_radio_s(family, kind, protocol):
    """Anybody's Inquiry stood in the controller's queue before the daemon's data: off the air for seconds."""
    assert tried(family, kind, protocol) == errno.EPERM


def test_not_by_a_family_that_the_kernel_cuts_to_32_bits():
    assert tried("ctypes.c_long(socket.AF_BLUETOOTH | 1 << 32)", "SOCK_RAW", 1) == errno.EPERM


@pytest.mark.parametrize("family", ["AF_UNIX", "AF_INET", "AF_INET6", "AF_NETLINK"])
def test_those_that_such_a_program_needs(family):
    assert tried(f"socket.{family}", "SOCK_DGRAM") == 0


def test_the_program_s_status_is_its_own_and_nothing_gives_it_rights():
    said = subprocess.run([CONFINE, "sh", "-c", "grep -E '^(NoNewPrivs|Seccomp):' /proc/self/status; exit 7"],
                          capture_output=True, text=True)
    assert said.returncode == 7 and said.stdout.split() == ["NoNewPrivs:", "1", "Seccomp:", "2"]


@pytest.mark.parametrize("words, status", [([], 2), (["-x"], 2), (["-u"], 2), (["-u", "nobody"], 2), (["/nowhere"], 127)])
def test_what_can_t_be_started(words, status):
    said = subprocess.run([CONFINE, *words], capture_output=True, text=True)
    assert said.returncode == status and said.stderr.count("\n") == 1 and "odid-confine" in said.stderr


@pytest.mark.parametrize("upper", [0, 1 << 32])
def test_no_controller_is_made_of_a_pseudo_terminal(upper):
    """The line discipline N_HCI: with CAP_NET_ADMIN it took the name of an adapter that was unplugged."""
    program = (f"import ctypes, os, sys, termios; libc = ctypes.CDLL(None, use_errno=True); _, slave = os.openpty(); "
               f"made = libc.syscall(ctypes.c_long({SYS_IOCTL}), ctypes.c_long(slave), ctypes.c_long(termios.TIOCSETD | {upper}), "
               f"ctypes.byref(ctypes.c_int(0))); sys.exit(0 if made >= 0 else ctypes.get_errno())")
    python = os.path.realpath(sys.executable)
    assert subprocess.run([python, "-c", program]).returncode == 0, "N_TTY is anybody's"
    assert subprocess.run([CONFINE, python, "-c", program]).returncode == errno.EPERM


# --- with the network's rights (-u), as hostapd --------------------------------

# capability.h's CAP_NET_ADMIN and CAP_NET_RAW
RIGHTS = f"{1 << 12 | 1 << 13:016x}"
AS_NOBODY = (CONFINE, "-u", "nobody")
of_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")


def status_of(*words):
    said = subprocess.run([*words, "cat", "/proc/self/status"], capture_output=True, text=True, check=True)
    return dict(line.split(":\t", 1) for line in said.stdout.splitlines() if ":\t" in line)


@of_root
def test_a_program_that_needs_the_network_s_rights_has_these_and_no_others():
    """hostapd was root, with all rights; its control socket deletes files by name."""
    status, nobody = status_of(*AS_NOBODY), pwd.getpwnam("nobody")
    assert status["Uid"].split() == [str(nobody.pw_uid)] * 4 and status["Gid"].split() == [str(nobody.pw_gid)] * 4
    assert [int(one) for one in status["Groups"].split()] == os.getgrouplist("nobody", nobody.pw_gid)
    assert {status[name] for name in ("CapInh", "CapPrm", "CapEff", "CapAmb")} == {RIGHTS}
    assert int(status["CapBnd"], 16) == 0 and (status["NoNewPrivs"], status["Seccomp"]) == ("1", "2")


@of_root
@pytest.mark.parametrize("family, kind, protocol, error", [
    ("socket.AF_PACKET", "SOCK_RAW", 0, 0), ("socket.AF_NETLINK", "SOCK_RAW", 16, 0),  # EAPOL; the radio, by nl80211
    ("socket.AF_NETLINK", "SOCK_RAW", 12, errno.EPERM),  # the firewall
    ("socket.AF_NETLINK", "SOCK_RAW", "ctypes.c_long(12 | 1 << 32)", errno.EPERM),
    ("socket.AF_NETLINK", "SOCK_RAW", 15, errno.EPERM),  # mdev: devices, and so commands of root's
    ("socket.AF_INET", "SOCK_DGRAM", 0, 0),  # questions about the interface
    ("socket.AF_INET", "SOCK_RAW", 17, errno.EPERM),  # from any port, past the firewall
    ("socket.AF_INET", "SOCK_RAW | socket.SOCK_CLOEXEC", 17, errno.EPERM),
    ("socket.AF_INET", "SOCK_STREAM", 0, errno.EPERM),  # passed to the daemon, closing it held it up
    ("socket.AF_INET6", "SOCK_DGRAM", 0, errno.EPERM),
    ("socket.AF_BLUETOOTH", "SOCK_RAW", 1, errno.EPERM)])
def test_what_it_reaches_with_them(family, kind, protocol, error):
    assert tried(family, kind, protocol, AS_NOBODY) == error


@of_root
@pytest.mark.parametrize("family, kind, protocol, error", [
    ("socket.AF_NETLINK", "SOCK_RAW", 16, 0), ("socket.AF_UNIX", "SOCK_DGRAM", 0, 0),
    ("socket.AF_NETLINK", "SOCK_RAW", 0, errno.EPERM),  # interfaces, addresses and routes: telemetry comes by one of these
    ("socket.AF_NETLINK", "SOCK_RAW", 12, errno.EPERM), ("socket.AF_NETLINK", "SOCK_RAW", 15, errno.EPERM),
    ("socket.AF_PACKET", "SOCK_RAW", 0, errno.EPERM), ("socket.AF_INET", "SOCK_DGRAM", 0, errno.EPERM)])
def test_who_asks_the_radios_reaches_these_only(family, kind, protocol, error):
    assert tried(family, kind, protocol, (CONFINE, "-r", "nobody")) == error


@of_root
@pytest.mark.parametrize("command, error", [
    (0x8933, 0),  # SIOCGIFINDEX
    (0x8913, errno.EPERM),  # SIOCGIFFLAGS, for SIOCSIFFLAGS: lo switched off, and telemetry is gone until power-off
    (0x5423, errno.EPERM)])  # TIOCSETD
@pytest.mark.parametrize("family, protocol", [("AF_UNIX", 0), ("AF_NETLINK", 16)])
def test_who_asks_the_radios_has_one_ioctl(family, protocol, command, error):
    """What a socket's family doesn't know the kernel asks of all interfaces."""
    program = (f"import fcntl, socket, sys\none = socket.socket(socket.{family}, socket.SOCK_DGRAM, {protocol})\n"
               f"try:\n    fcntl.ioctl(one, {command}, b'lo'.ljust(40, bytes(1)))\nexcept OSError as error:\n    sys.exit(error.errno)\n")
    said = subprocess.run([CONFINE, "-r", "nobody", os.path.realpath(sys.executable), "-c", program])
    assert said.returncode == error


@of_root
def test_who_asks_the_radios_has_one_right():
    status = status_of(CONFINE, "-r", "nobody")
    assert {status[name] for name in ("CapInh", "CapPrm", "CapEff", "CapAmb")} == {f"{1 << 12:016x}"}
    assert int(status["CapBnd"], 16) == 0


@of_root
@pytest.mark.parametrize("level, option, size", [
    (263, 5, 16), (263, 13, 16),  # the rings of if_packet.h, for receiving and sending
    ("socket.SOL_SOCKET", 33, 4), ("socket.SOL_SOCKET", 32, 4)])  # buffers beyond what everybody may have
def test_it_takes_no_memory_that_counts_as_nobody_s(level, option, size):
    """Its group's limit doesn't see these pages."""
    program = ("import ctypes, socket, sys; libc = ctypes.CDLL(None, use_errno=True); "
               "one = socket.socket(socket.AF_PACKET, socket.SOCK_RAW); "
               f"set = libc.setsockopt(one.fileno(), {level}, {option}, bytes({size}), {size}); "
               "sys.exit(0 if set == 0 else ctypes.get_errno())")
    python = os.path.realpath(sys.executable)
    assert subprocess.run([python, "-c", program]).returncode == 0
    assert subprocess.run([*AS_NOBODY, python, "-c", program]).returncode == errno.EPERM


@of_root
def test_it_leaves_no_process_behind():
    said = subprocess.run([*AS_NOBODY, "sh", "-c", "sleep 1000 & echo left"], capture_output=True, text=True)
    assert said.returncode != 0 and not said.stdout and "fork" in said.stderr


@of_root
def test_a_user_that_there_is_not():
    said = subprocess.run([CONFINE, "-u", "nobody-of-that-name", "true"], capture_output=True, text=True)
    assert said.returncode == 127 and 'no user "nobody-of-that-name"' in said.stderr


@of_root
def test_who_may_not_become_another_user_starts_nothing():
    said = subprocess.run([CONFINE, "-u", "root", "echo", "started"], capture_output=True, text=True, user="nobody")
    assert said.returncode == 127 and not said.stdout and "can't be confined" in said.stderr
