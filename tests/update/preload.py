"""Functions to take the place of a program's own ones in the machine (LD_PRELOAD): protections taken out."""

import subprocess
import tempfile
from pathlib import Path

import parts

REAL = """
void *dlsym(void *handle, const char *name);
int open(const char *path, int flags, ...);
int close(int fd);
#define REAL(name) ((__typeof__(&name))dlsym((void *)-1, #name))    /* RTLD_NEXT */
"""

NO_FLUSH = """
int fsync(int fd) { (void)fd; return 0; }
int fdatasync(int fd) { (void)fd; return 0; }
void sync(void) {}
"""

# Whatever was signed; and what can't be read as a signature is /tmp/signature.
ANY_SIGNATURE = """
void *BIO_new_file(const char *path, const char *mode);

int CMS_verify(void *cms, void *certificates, void *store, void *content, void *out, unsigned flags)
{
    return REAL(CMS_verify)(cms, certificates, store, content, out, flags | 4);     /* CMS_NO_CONTENT_VERIFY */
}

void *d2i_CMS_bio(void *bio, void *out)
{
    void *cms = REAL(d2i_CMS_bio)(bio, out);

    return cms != 0 ? cms : REAL(d2i_CMS_bio)(BIO_new_file("/tmp/signature", "rb"), out);
}
"""

# Of the two hashes in /tmp/hashes, the second one wherever the first one comes out.
OTHER_HASH = """
long read(int fd, void *data, unsigned long size);
int memcmp(const void *one, const void *other, unsigned long size);
void *memcpy(void *out, const void *in, unsigned long size);

int EVP_DigestFinal_ex(void *context, unsigned char *out, unsigned *size)
{
    int result = REAL(EVP_DigestFinal_ex)(context, out, size), fd = open("/tmp/hashes", 0);
    unsigned char hashes[64];

    if (read(fd, hashes, 64) == 64 && memcmp(out, hashes, 32) == 0) {
        memcpy(out, hashes + 32, 32);
    }
    close(fd);
    return result;
}
"""

# Where a long stream ends, /tmp/rest follows.
REST_FROM_FILE = """
#define LONG (1 << 20)

long read(int fd, void *data, unsigned long size)
{
    static long passed[1024];
    static int rest = -1;
    long got = REAL(read)(fd, data, size);

    if (got > 0 && fd < 1024) {
        passed[fd] += got;
    }
    if (got != 0 || fd >= 1024 || passed[fd] < LONG) {
        return got;
    }
    rest = rest < 0 ? open("/tmp/rest", 0) : rest;
    return REAL(read)(rest, data, size);
}
"""


# What is given to SWUpdate is asked to be tried only.
DRY_RUN = """
#include <network_ipc.h>

int ipc_inst_start_ext(void *priv, ssize_t size)
{
    struct swupdate_request *request = priv;

    request->dry_run = RUN_DRYRUN;
    return REAL(ipc_inst_start_ext)(request, size);
}
"""


def put(machine, source, path):
    headers = next((parts.ROOT / "build/appliance/cache").glob("sysroot-*")) / "usr/include"
    with tempfile.NamedTemporaryFile(suffix=".so") as built:
        subprocess.run(["aarch64-linux-gnu-gcc", "-shared", "-fPIC", "-nostdlib", "-fno-builtin", "-idirafter", headers,
                        "-o", built.name, "-x", "c", "-"], input=(REAL + source).encode(), check=True)
        machine.put(path, Path(built.name).read_bytes())
