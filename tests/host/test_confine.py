"""Programs without a filter of their own, started so that they keep away from the radios."""

import errno
import subprocess
import sys

import pytest

from . import parts

CONFINE = parts.DAEMON.with_name("odid-confine")
TRY = """
import ctypes, socket, sys
libc = ctypes.CDLL(None, use_errno=True)
made = libc.socket({family}, socket.{kind}, {protocol})
sys.exit(0 if made >= 0 else ctypes.get_errno())
"""


def tried(family, kind, protocol=0):
    """0, or the error of making such a socket."""
    program = TRY.format(family=family, kind=kind, protocol=protocol)
    return subprocess.run([CONFINE, sys.executable, "-c", program]).returncode


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


@pytest.mark.parametrize("words, status", [([], 2), (["-x"], 2), (["/nowhere"], 127)])
def test_what_can_t_be_started(words, status):
    said = subprocess.run([CONFINE, *words], capture_output=True, text=True)
    assert said.returncode == status and said.stderr.count("\n") == 1 and "odid-confine" in said.stderr
