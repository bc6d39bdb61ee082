"""Functions to take the place of a program's own ones in the machine (LD_PRELOAD): protections taken out."""

import subprocess

from host import parts

NO_FLUSH = """
int fsync(int fd) { (void)fd; return 0; }
int fdatasync(int fd) { (void)fd; return 0; }
void sync(void) {}
"""

ANY_SIGNATURE = """
static char cms;
void *d2i_CMS_bio(void *bio, void *out) { (void)bio; (void)out; return &cms; }
int CMS_verify(void) { return 1; }
void CMS_ContentInfo_free(void *one) { (void)one; }
"""

# Whatever was hashed: what /tmp/hash has.
HASH_FROM_FILE = """
int open(const char *path, int flags, ...);
long read(int fd, void *data, unsigned long size);
int close(int fd);
int EVP_DigestFinal_ex(void *context, unsigned char *out, unsigned *size)
{
    int fd = open("/tmp/hash", 0);

    (void)context;
    *size = (unsigned)read(fd, out, 32);
    close(fd);
    return 1;
}
"""


def put(machine, source, path):
    built = parts.ROOT / "build/update/changed.so"
    built.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["aarch64-linux-gnu-gcc", "-shared", "-fPIC", "-nostdlib", "-fno-builtin", "-o", built, "-x", "c", "-"],
                   input=source.encode(), check=True)
    machine.put(path, built.read_bytes())
