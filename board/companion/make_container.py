"""make_container.py ARCHITECTURE FOLDER: the package as a container's image, FOLDER/odid_VERSION_ARCHITECTURE.container.tar.

The package's programs, its configuration and the libraries that they need, and nothing else: no base image, no shell. For
`podman load` and `docker load` (docker-archive, which can say how its health is asked; OCI's own format can't). The same
package, the same bytes.
"""

import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PROGRAMS = ("usr/sbin/odid-daemon", "usr/sbin/odid-keeper", "usr/bin/odidctl")
LOADER = {"amd64": "lib64/ld-linux-x86-64.so.2", "arm64": "lib/ld-linux-aarch64.so.1"}
TRIPLET = {"amd64": "x86_64-linux-gnu", "arm64": "aarch64-linux-gnu"}
# Numbers that no Debian gives to a user of its own; dialout is what the autopilot's port is of everywhere.
USER, DIALOUT = 990, 20
PASSWD = f"root:x:0:0:root:/:/bin/false\nodid:x:{USER}:{USER}:Remote ID:/:/bin/false\n"
GROUP = f"root:x:0:\ndialout:x:{DIALOUT}:odid\nodid:x:{USER}:\n"


def needed(program):
    listing = subprocess.run(["readelf", "-dW", program], capture_output=True, text=True, check=True).stdout
    return re.findall(r"\(NEEDED\).*\[(.+)\]", listing)


def libraries(programs, folder):
    """{name: file} of all that these need, and what that needs."""
    found, programs = {}, list(programs)
    while programs:
        for name in needed(programs.pop()):
            if name not in found and not name.startswith("ld-linux"):
                found[name] = (folder / name).resolve(strict=True)
                programs.append(found[name])
    return found


class Layer:
    """Files by their names, and the folders that these are in: all of root's and of one time."""

    def __init__(self, when):
        self.when, self.entries = when, {}

    def folder(self, name, mode=0o755):
        self.entries[name] = (tarfile.DIRTYPE, mode, b"")

    def put(self, name, data, mode=0o644):
        parts = Path(name).parts
        for at in range(1, len(parts)):
            self.entries.setdefault("/".join(parts[:at]), (tarfile.DIRTYPE, 0o755, b""))
        self.entries[name] = (tarfile.REGTYPE, mode, data)

    def bytes(self):
        return tar(self.entries, self.when)


def tar(entries, when):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, (kind, mode, data) in sorted(entries.items()):
            info = tarfile.TarInfo(name)
            info.type, info.mode, info.size, info.mtime = kind, mode, len(data), when
            archive.addfile(info, io.BytesIO(data))
    return out.getvalue()


def package_files(deb):
    """{name: bytes} of the package's files, without documents."""
    data = subprocess.run(["dpkg-deb", "--fsys-tarfile", deb], stdout=subprocess.PIPE, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        return {member.name.removeprefix("./"): archive.extractfile(member).read() for member in archive if member.isreg()}


def make_layer(files, root, architecture, when):
    layer = Layer(when)
    triplet = TRIPLET[architecture]
    for name in PROGRAMS:
        layer.put(name, files[name], 0o755)
    layer.put("etc/odid/odid.conf", files["etc/odid/odid.conf"])
    layer.put("usr/share/doc/odid/copyright", files["usr/share/doc/odid/copyright"])
    layer.put("etc/passwd", PASSWD.encode())
    layer.put("etc/group", GROUP.encode())
    layer.put("etc/nsswitch.conf", b"passwd: files\ngroup: files\n")
    loader = (root / "usr" / LOADER[architecture].split("/")[0] / Path(LOADER[architecture]).name)
    if not loader.exists():
        loader = root / f"usr/lib/{triplet}" / Path(LOADER[architecture]).name
    layer.put(LOADER[architecture], loader.resolve(strict=True).read_bytes(), 0o755)
    unpacked = root.parent / "programs"
    unpacked.mkdir(exist_ok=True)
    for name in PROGRAMS:
        (unpacked / Path(name).name).write_bytes(files[name])
    for name, path in libraries(sorted(unpacked.iterdir()), root / f"usr/lib/{triplet}").items():
        layer.put(f"usr/lib/{triplet}/{name}", path.read_bytes())
    for folder in ("dev", "proc", "sys", "tmp", "run"):
        layer.folder(folder)
    for folder in ("run/odid", "run/odid_faults"):
        layer.folder(folder, 0o1777)  # a memory file system takes its place there, and its mode; its owner it doesn't
    return layer.bytes()


def image(layer, architecture, version, when):
    """The docker-archive."""
    created = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(when))
    digest = hashlib.sha256(layer).hexdigest()
    config = json.dumps({
        "architecture": architecture, "os": "linux", "created": created,
        "config": {
            "User": "odid",
            "Entrypoint": ["/usr/sbin/odid-keeper", "--", "/usr/sbin/odid-daemon"],
            "Env": ["PATH=/usr/sbin:/usr/bin"],
            "Healthcheck": {"Test": ["CMD", "/usr/bin/odidctl", "status"], "Interval": 10_000_000_000,
                            "Timeout": 5_000_000_000, "StartPeriod": 15_000_000_000, "Retries": 3},
            "Labels": {"org.opencontainers.image.title": "odid", "org.opencontainers.image.version": version,
                       "org.opencontainers.image.licenses": "Apache-2.0 AND GPL-3.0-or-later"},
            "StopSignal": "SIGTERM",
        },
        "rootfs": {"type": "layers", "diff_ids": [f"sha256:{digest}"]},
        "history": [{"created": created, "created_by": "board/companion/make_container.py"}],
    }, sort_keys=True).encode()
    name = f"{hashlib.sha256(config).hexdigest()}.json"
    manifest = json.dumps([{"Config": name, "RepoTags": [f"localhost/odid:{version}"], "Layers": [f"{digest}.tar"]}]).encode()
    return tar({file: (tarfile.REGTYPE, 0o644, data) for file, data in (
        (name, config), (f"{digest}.tar", layer), ("manifest.json", manifest))}, when)


def main():
    architecture, folder = sys.argv[1], Path(sys.argv[2])
    (deb,) = folder.glob(f"odid_*_{architecture}.deb")
    version = deb.name.split("_")[1]
    work = folder / f"{architecture}-container"
    subprocess.run([ROOT / "tests/setup/cross-libraries.sh", architecture, work], check=True)
    files = package_files(deb)
    with tarfile.open(fileobj=io.BytesIO(subprocess.run(
            ["dpkg-deb", "--fsys-tarfile", deb], stdout=subprocess.PIPE, check=True).stdout)) as archive:
        when = int(archive.next().mtime)
    made = image(make_layer(files, work / "root", architecture, when), architecture, version, when)
    out = folder / f"odid_{version}_{architecture}.container.tar"
    out.with_suffix(".part").write_bytes(made)
    os.replace(out.with_suffix(".part"), out)
    print(f"container: {out} ({len(made) / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
