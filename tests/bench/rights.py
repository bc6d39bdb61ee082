"""What each process of the appliance may do: as docs/security.md says it, and as its kernel says it."""

import re
import time
from collections import namedtuple
from fnmatch import fnmatchcase

import parts

from .runs import tool

DOCUMENT = parts.ROOT / "docs/security.md"
# Of the table. In the last two the document has patterns; the others have to be equal.
COLUMNS = ("user", "groups", "capabilities", "bounding", "filter", "no new privs", "listens", "writes")
PATTERNS = ("listens", "writes")
# A row of the table, or a process: for each column what stands there, a set.
Row = namedtuple("Row", "name there columns")
Process = namedtuple("Process", "pid name columns")
EVERYBODY = re.compile(r"^Everybody may write: (.*?)\n\n", re.M | re.S)

# Bit by bit, as in the kernel's capability.h.
CAPABILITIES = """chown dac_override dac_read_search fowner fsetid kill setgid setuid setpcap linux_immutable
    net_bind_service net_broadcast net_admin net_raw ipc_lock ipc_owner sys_module sys_rawio sys_chroot sys_ptrace
    sys_pacct sys_admin sys_boot sys_nice sys_resource sys_time sys_tty_config mknod lease audit_write audit_control
    setfcap mac_override mac_admin syslog wake_alarm block_suspend audit_read perfmon bpf checkpoint_restore""".split()

MANY = ("runsv",)       # one for each service; of all others there is one for each row
BENCH = "S05bench"      # this script and all that it has started are the bench's own
KERNEL = "2"            # kthreadd: the kernel's threads are its children
STATUS = "State PPid Uid Gid Groups CapInh CapPrm CapEff CapBnd CapAmb NoNewPrivs Seccomp".split()
LASTING_S = 3           # what isn't there again after so long came and went: a script's sleep, a question
EPHEMERAL = 32768       # from here on the kernel chooses: a socket that sends
TCP_LISTEN, UNIX_ACCEPTS, UNIX_DATAGRAMS = "0A", 0x10000, "0002"
NETWORKS = ("tcp", "tcp6", "udp", "udp6", "raw", "raw6", "icmp", "icmp6")
OTHERS = ("packet", "hci", "l2cap", "rfcomm", "sco")    # by their kind only

SNAPSHOT = r"""cd /proc
echo @status
grep -HE '^(""" + "|".join(STATUS) + r"""):' [0-9]*/task/[0-9]*/status
echo @cmdline
for one in [0-9]*; do echo "$one $(tr '\0' ' ' <$one/cmdline)"; done
echo @links
ls -l [0-9]*/cwd [0-9]*/fd
for kind in """ + " ".join((*NETWORKS, *OTHERS, "unix")) + r"""; do
	echo "@$kind"
	[ ! -e net/$kind ] || sed 1d net/$kind
done
echo @users; cat /etc/passwd
echo @groups; cat /etc/group
echo @capabilities; cat sys/kernel/cap_last_cap"""


def cell(text):
    words = (word.strip().strip("`") for word in text.split(","))
    return frozenset(word for word in words if word not in ("", "-"))


def table(text):
    """The rows of the table that begins with the column "process"."""
    lines = text.splitlines()
    at = next(number for number, line in enumerate(lines) if re.match(r"\| *process *\|", line))
    names = [name.strip() for name in lines[at].strip("|").split("|")]
    rows = []
    for line in lines[at + 2:]:
        if not line.startswith("|"):
            break
        cells = dict(zip(names, (one.strip() for one in line.strip("|").split("|")), strict=True))
        rows.append(Row(cells["process"].strip("`"), cells["there"],
                        {column: cell(cells[column]) for column in COLUMNS}))
    return rows


def everybody(text):
    return cell(EVERYBODY.search(text)[1])


# --- the comparison -------------------------------------------------------------------


def covered(one, patterns):
    return any(fnmatchcase(one, pattern) for pattern in patterns)


def said(words):
    return ", ".join(sorted(words)) or "-"


def differs(row, process):
    """The columns in which a process isn't, or has more than, what its row says."""
    return [column for column in COLUMNS
            if (any(not covered(one, row.columns[column]) for one in process.columns[column]) if column in PATTERNS
                else process.columns[column] != row.columns[column])]


def differences(rows, processes, states):
    """One sentence for each way in which these processes aren't the table's rows that are there in these states."""
    problems, of_row = [], [(row, []) for row in rows if row.there in states]
    for process in processes:
        # Two halves of one program: the row that fits best.
        candidates = [one for one in of_row if one[0].name == process.name]
        if not candidates:
            problems.append(f"{process.name} (process {process.pid}): it has no row"
                            + "".join(f"; {column}: {said(process.columns[column])}" for column in COLUMNS))
            continue
        row, mine = min(candidates, key=lambda one: len(differs(one[0], process)))
        mine.append(process)
        for column in differs(row, process):
            problems.append(f"{row.name} (process {process.pid}), {column}: expected {said(row.columns[column])}, "
                            f"found {said(process.columns[column])}")
    for row, mine in of_row:
        if not mine:
            problems.append(f"{row.name}, user {said(row.columns['user'])}: no such process")
            continue
        if len(mine) > 1 and row.name not in MANY:
            problems.append(f"{row.name}, process: expected one, found {', '.join(one.pid for one in mine)}")
        for column in PATTERNS:
            found = {one for process in mine for one in process.columns[column]}
            problems += [f"{row.name}, {column}: expected {pattern}, found {said(found)}"
                         for pattern in sorted(row.columns[column]) if not covered_by_any(pattern, found)]
    return problems


def covered_by_any(pattern, found):
    return any(fnmatchcase(one, pattern) for one in found)


# --- the machine's side ---------------------------------------------------------------


def sections(text):
    parted = re.split(r"^@(\w+)\n", text, flags=re.M)
    return dict(zip(parted[1::2], parted[2::2]))


def name_of(command, folder):
    """A service's script has the service's name, another script its own."""
    words = command.split() or ["no-command-line"]
    if words[0].rsplit("/", 1)[-1] == "sh" and len(words) > 1:
        return (folder if words[1] == "./run" else words[1]).rsplit("/", 1)[-1]
    return words[0].rsplit("/", 1)[-1]


def named(listing):
    return {fields[2]: fields[0] for fields in (line.split(":") for line in listing.splitlines())}


def rights(masks, last):
    mask = 0
    for one in masks:
        mask |= int(one, 16)
    if mask == (2 << last) - 1:
        return frozenset(("all",))
    return frozenset(CAPABILITIES[bit] for bit in range(last + 1) if mask >> bit & 1)


def address(text):
    """Of /proc/net/tcp and its like: * is any address."""
    where, port = text.split(":")
    port = int(port, 16)
    if int(where, 16) == 0:
        where = "*"
    elif len(where) == 8:
        where = ".".join(str(octet) for octet in reversed(bytes.fromhex(where)))
    return f"{where}:{'ephemeral' if port >= EPHEMERAL else port}"


def listening(found):
    """What waits for somebody: inode and name of each such socket."""
    for kind in NETWORKS:
        for fields in map(str.split, found[kind].splitlines()):
            waits = fields[3] == TCP_LISTEN if kind.startswith("tcp") else int(fields[2].split(":")[0], 16) == 0
            if waits:
                yield fields[9], f"{kind} {address(fields[1])}"
    for kind in OTHERS:
        for fields in map(str.split, found[kind].splitlines()):
            yield fields[8 if kind == "packet" else 5], kind
    for fields in map(str.split, found["unix"].splitlines()):
        if len(fields) > 7 and (int(fields[3], 16) & UNIX_ACCEPTS or fields[4] == UNIX_DATAGRAMS):
            yield fields[6], f"unix {fields[7].rstrip('@')}"


def snapshot(text):
    """The processes that a SNAPSHOT shows, but for the kernel's threads and the bench's own."""
    found = sections(text)
    threads, commands, folders, sockets = {}, {}, {}, {}
    for pid, thread, key, value in re.findall(r"^(\d+)/task/(\d+)/status:(\w+):[ \t]*(.*)$", found["status"], re.M):
        threads.setdefault(pid, {}).setdefault(thread, {})[key] = value
    # What ended in the middle of it is told by halves.
    threads = {pid: {thread: one for thread, one in of_process.items() if one.keys() >= set(STATUS)}
               for pid, of_process in threads.items()}
    threads = {pid: of_process for pid, of_process in threads.items() if pid in of_process}
    for line in found["cmdline"].splitlines():
        pid, _, command = line.partition(" ")
        commands[pid] = command.strip()
    holder = None
    for line in found["links"].splitlines():
        if match := re.search(r" (\d+)/cwd -> (.*)$", line):
            folders[match[1]] = match[2]
        elif match := re.match(r"(\d+)/fd:$", line):
            holder = match[1]
        elif match := re.search(r"-> socket:\[(\d+)\]$", line):
            sockets.setdefault(match[1], set()).add(holder)

    def parent(pid):
        return threads[pid][pid]["PPid"]

    def left_out(pid):
        return pid in threads and (pid == KERNEL or parent(pid) == KERNEL or BENCH in commands.get(pid, "")
                                   or threads[pid][pid]["State"].startswith("Z") or left_out(parent(pid)))

    waiting = {}
    for inode, what in listening(found):
        for pid in sockets.get(inode, ("nobody",)):
            waiting.setdefault(pid, set()).add(what)
    users, groups, last = named(found["users"]), named(found["groups"]), int(found["capabilities"])
    processes = []
    for pid, of_process in threads.items():
        if left_out(pid):
            continue
        values = {key: {value for one in of_process.values() for value in one[key].split()}
                  for key in of_process[pid]}
        processes.append(Process(pid, name_of(commands.get(pid, ""), folders.get(pid, "")), {
            "user": frozenset(users.get(one, one) for one in values["Uid"]),
            "groups": frozenset(groups.get(one, one) for one in values["Gid"] | values["Groups"]),
            "capabilities": rights(values["CapInh"] | values["CapPrm"] | values["CapEff"] | values["CapAmb"], last),
            "bounding": rights(values["CapBnd"], last),
            "filter": frozenset("yes" if one == "2" else "no" for one in values["Seccomp"]),
            "no new privs": frozenset("yes" if one == "1" else "no" for one in values["NoNewPrivs"]),
            "listens": frozenset(waiting.get(pid, ())),
            "writes": frozenset(("all",))}))
    if "nobody" in waiting:
        processes.append(Process("-", "socket of no process", dict.fromkeys(COLUMNS, frozenset())
                                 | {"listens": frozenset(waiting["nobody"])}))
    return processes


def outermost(paths):
    """Without what lies in a folder that is one of them."""
    kept = []
    for path in sorted(set(paths)):
        if not any(path.startswith(f"{one}/") for one in kept):
            kept.append(path)
    return frozenset(kept)


def writable(machine, pid):
    return outermost(machine.must(f"/tmp/writable {pid} </tmp/paths").splitlines())


def running(machine):
    """The processes that last; and what nobody, who is in no group, may write: so may everybody."""
    before = machine.must("cd /proc; echo [0-9]*").split()
    time.sleep(LASTING_S)
    processes = [one for one in snapshot(machine.must(f"{SNAPSHOT}; true"))
                 if one.pid in before or not one.pid.isdigit()]
    machine.put("/tmp/writable", tool("writable"))
    # All but what belongs to single processes, and the sockets at which hostapd_cli waits for an answer: they come and go.
    machine.must("for one in /*; do [ $one = /proc ] || find $one ! -type l ! -path '/run/hostapd-cli/*'; done >/tmp/paths; "
                 "find /proc/[a-z]* ! -type l >>/tmp/paths; true")
    nobody = machine.must("chpst -u nobody sleep 60 >/dev/null & echo $!").strip()
    time.sleep(0.5)
    common = writable(machine, nobody)
    machine.run(f"kill {nobody}")
    measured = []
    for one in processes:
        if one.columns["capabilities"] != {"all"} and one.pid.isdigit():
            paths = writable(machine, one.pid) - common
            one = one._replace(columns=one.columns | {"writes": paths})
        measured.append(one)
    machine.must("rm /tmp/writable /tmp/paths")
    return measured, common
