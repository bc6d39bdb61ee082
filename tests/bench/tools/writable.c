/*
 * What a process may write, asked of the kernel: becomes what the process is (user, groups,
 * capabilities), reads paths, a line each, and prints those that it may open for writing, create
 * something in, or connect to.
 *
 *   writable PID <PATHS
 *
 * Asked with the rights in force (AT_EACCESS): capabilities count, and so does what is mounted
 * read-only.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <grp.h>
#include <linux/capability.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#define GROUPS_MAX 32

struct rights {
    uid_t user;
    gid_t group, groups[GROUPS_MAX];
    size_t count;
    unsigned long long capabilities;
};

static int rights_of(const char *pid, struct rights *rights)
{
    char path[64], line[512], *at;
    FILE *file;
    int length;

    snprintf(path, sizeof(path), "/proc/%s/status", pid);
    file = fopen(path, "r");
    if (file == NULL) {
        return -1;
    }
    while (fgets(line, sizeof(line), file) != NULL) {
        unsigned value;

        sscanf(line, "CapEff: %llx", &rights->capabilities);
        sscanf(line, "Uid: %*u %u", &rights->user);
        sscanf(line, "Gid: %*u %u", &rights->group);
        if (strncmp(line, "Groups:", 7) == 0) {
            for (at = line + 7;
                 rights->count < GROUPS_MAX && sscanf(at, "%u%n", &value, &length) == 1;
                 at += length) {
                rights->groups[rights->count++] = value;
            }
        }
    }
    fclose(file);
    return 0;
}

static int become(const struct rights *rights)
{
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct data[2] = {{0}};

    for (int half = 0; half < 2; half++) {
        data[half].effective = (unsigned)(rights->capabilities >> (32 * half));
        data[half].permitted = data[half].effective;
    }
    if (prctl(PR_SET_KEEPCAPS, 1, 0, 0, 0) < 0 || setgroups(rights->count, rights->groups) < 0 ||
        setresgid(rights->group, rights->group, rights->group) < 0 ||
        setresuid(rights->user, rights->user, rights->user) < 0) {
        return -1;
    }
    return (int)syscall(SYS_capset, &header, data);
}

int main(int argc, char *argv[])
{
    struct rights rights = {0};
    char path[4096];

    if (argc != 2) {
        fputs("writable PID <PATHS\n", stderr);
        return 2;
    }
    if (rights_of(argv[1], &rights) < 0 || become(&rights) < 0) {
        perror(argv[1]);
        return 1;
    }
    while (fgets(path, sizeof(path), stdin) != NULL) {
        path[strcspn(path, "\n")] = '\0';
        if (faccessat(AT_FDCWD, path, W_OK, AT_EACCESS) == 0) {
            puts(path);
        }
    }
    return 0;
}
