"""What a technician does to an appliance without a network: files on the CONFIG volume, and the report beside them."""

REPORT = "odid-report.txt"


class Technician:
    """With the CONFIG volume in a card reader, and then at power-on: the same script as at boot."""

    def __init__(self, machine):
        self.machine = machine

    def mounted(self, command):
        return self.machine.must("mkdir -p /tmp/config && mount -t vfat /dev/disk/odid/config /tmp/config && "
                                 f"cd /tmp/config && ({command}); code=$?; cd /; umount /tmp/config; exit $code")

    def puts(self, files, last="true"):
        self.machine.must("rm -rf /tmp/files && mkdir /tmp/files")
        for name, content in files.items():
            self.machine.put(f"/tmp/files/{name}", content if isinstance(content, bytes) else content.encode(), "644")
        self.mounted(f"rm -rf * ._*; cp /tmp/files/* /tmp/files/.[_]* . 2>/dev/null; {last}; true")
        self.machine.must("/etc/init.d/S40config start; /etc/init.d/S42in-force start")

    def report(self):
        return self.mounted(f"cat {REPORT} 2>/dev/null; true")
