#include "base/sandbox.h"

#include <bluetooth/bluetooth.h>
#include <bluetooth/hci.h>
#include <cap-ng.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <malloc.h>
#include <pwd.h>
#include <sched.h>
#include <seccomp.h>
#include <stddef.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "base/socket_families.h"

#define PRIORITY 20
/* CPU time without a pause after which the kernel ends us (SIGXCPU): a loop that spins at
 * real-time priority would starve everything else, and is restarted instead. */
#define SPIN_MAX_US 500000
/* Who has no rights but the two that are kept. */
#define INSTEAD "nobody"

/* Pages stay in memory once touched; not all at once, that would be megabytes. */
static void lock_memory(void)
{
    struct rlimit unlimited = {.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
    int flags = MCL_CURRENT | MCL_ONFAULT;

    /* What is mapped later counts against the limit: without a higher one it would fail. */
    if (setrlimit(RLIMIT_MEMLOCK, &unlimited) == 0) {
        flags |= MCL_FUTURE;
    }
    if (mlockall(flags) < 0) {
        log_warning("can't lock memory (%s): slots may be late when memory is short",
                    strerror(errno));
    }
}

int sandbox_realtime(void)
{
    struct sched_param parameters = {.sched_priority = PRIORITY};
    struct rlimit spin = {.rlim_cur = SPIN_MAX_US, .rlim_max = 2 * SPIN_MAX_US};

    lock_memory();
    if (setrlimit(RLIMIT_RTTIME, &spin) < 0) {
        return -errno;
    }
    /* A service manager may have given it, and no right to ask for it. */
    if (sched_getscheduler(0) != SCHED_FIFO && sched_setscheduler(0, SCHED_FIFO, &parameters) < 0) {
        return -errno;
    }
    return 0;
}

/*
 * What the event loop, the radios and links, the status answer, memory
 * allocation and an orderly end need. Names that an architecture doesn't have
 * are skipped by libseccomp.
 */
static const int allowed[] = {
    /* the loop */
    SCMP_SYS(epoll_wait),
    SCMP_SYS(epoll_pwait),
    SCMP_SYS(epoll_ctl),
    SCMP_SYS(poll),
    SCMP_SYS(ppoll),
    SCMP_SYS(timerfd_settime),
    SCMP_SYS(clock_gettime),
    SCMP_SYS(restart_syscall),
    /* bytes in and out */
    SCMP_SYS(read),
    SCMP_SYS(write),
    SCMP_SYS(writev),
    SCMP_SYS(recvfrom),
    SCMP_SYS(recvmsg),
    SCMP_SYS(sendto),
    SCMP_SYS(sendmsg),
    SCMP_SYS(close),
    /* opening again what went away */
    SCMP_SYS(openat),
    SCMP_SYS(open),
    SCMP_SYS(bind),
    SCMP_SYS(connect),
    SCMP_SYS(listen),
    SCMP_SYS(accept4),
    SCMP_SYS(getsockopt),
    SCMP_SYS(setsockopt),
    SCMP_SYS(getsockname),
    SCMP_SYS(fstat),
    SCMP_SYS(newfstatat),
    SCMP_SYS(lseek),
    /* the take-off point and our sockets in the run directory */
    SCMP_SYS(chmod),
    SCMP_SYS(fchmodat),
    SCMP_SYS(ftruncate),
    SCMP_SYS(unlink),
    SCMP_SYS(unlinkat),
    SCMP_SYS(rename),
    SCMP_SYS(renameat),
    SCMP_SYS(renameat2),
    /* memory, of the JSON library; never executable */
    SCMP_SYS(brk),
    SCMP_SYS(munmap),
    SCMP_SYS(mremap),
    SCMP_SYS(madvise),
    SCMP_SYS(getrandom),
    /* signals and the end */
    SCMP_SYS(rt_sigreturn),
    SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(getpid),
    SCMP_SYS(gettid),
    SCMP_SYS(exit),
    SCMP_SYS(exit_group),
};

/* Of a file descriptor: what it is opened with, and its owner is not among them, whom the kernel
 * sends a signal when something comes: a daemon that was taken over ended its keeper by that. */
static const uint32_t fcntl_commands[] = {F_GETFD, F_SETFD,         F_GETFL,
                                          F_SETFL, F_DUPFD_CLOEXEC, F_GETPIPE_SZ};
static const uint32_t ioctl_requests[] = {TCGETS,   TCSETS,   TCFLSH,
                                          TIOCOUTQ, FIONREAD, HCIGETDEVINFO};
static const uint32_t owner_commands[] = {F_SETOWN, F_SETOWN_EX, F_SETSIG};
static const uint32_t owner_requests[] = {FIOSETOWN, SIOCSPGRP};

static const int socket_families[] = {AF_UNIX, AF_INET, AF_BLUETOOTH};

/*
 * What nothing here ever needs, whatever a later library does: refused even
 * when the filter only logs. Whoever makes the daemon die twice by the filter
 * gets no other program, process, kernel or user by it.
 *
 * Files are not among them: the filter sees numbers and no paths, so it can't
 * tell our run directory from another place, and the daemon opens a terminal
 * for writing as an attacker would open anything. There it is the user that
 * counts, whom nothing but the run directory belongs to; that can't be changed
 * from here, and links and nodes, by which others might be led astray, can't
 * be made.
 */
static const int never[] = {
    /* another program, or process */
    SCMP_SYS(execve),
    SCMP_SYS(execveat),
    SCMP_SYS(fork),
    SCMP_SYS(vfork),
    SCMP_SYS(clone),
    SCMP_SYS(clone3),
    SCMP_SYS(uselib),
    /* out of its keeper's hands, and its limits */
    SCMP_SYS(prctl),
    SCMP_SYS(kill),
    SCMP_SYS(tkill),
    SCMP_SYS(rt_sigqueueinfo),
    SCMP_SYS(rt_tgsigqueueinfo),
    SCMP_SYS(pidfd_send_signal),
    SCMP_SYS(setrlimit),
    SCMP_SYS(prlimit64),
    SCMP_SYS(setpriority),
    SCMP_SYS(sched_setscheduler),
    SCMP_SYS(sched_setparam),
    SCMP_SYS(sched_setattr),
    SCMP_SYS(sched_setaffinity),
    /* into other processes */
    SCMP_SYS(ptrace),
    SCMP_SYS(process_vm_readv),
    SCMP_SYS(process_vm_writev),
    SCMP_SYS(process_madvise),
    SCMP_SYS(pidfd_getfd),
    SCMP_SYS(kcmp),
    /* what is mounted, where the root is, namespaces */
    SCMP_SYS(mount),
    SCMP_SYS(umount),
    SCMP_SYS(umount2),
    SCMP_SYS(mount_setattr),
    SCMP_SYS(move_mount),
    SCMP_SYS(open_tree),
    SCMP_SYS(fsopen),
    SCMP_SYS(fsconfig),
    SCMP_SYS(fsmount),
    SCMP_SYS(fspick),
    SCMP_SYS(pivot_root),
    SCMP_SYS(chroot),
    SCMP_SYS(unshare),
    SCMP_SYS(setns),
    SCMP_SYS(swapon),
    SCMP_SYS(swapoff),
    SCMP_SYS(quotactl),
    /* the kernel itself */
    SCMP_SYS(init_module),
    SCMP_SYS(finit_module),
    SCMP_SYS(delete_module),
    SCMP_SYS(kexec_load),
    SCMP_SYS(kexec_file_load),
    SCMP_SYS(bpf),
    SCMP_SYS(perf_event_open),
    SCMP_SYS(userfaultfd),
    SCMP_SYS(add_key),
    SCMP_SYS(request_key),
    SCMP_SYS(keyctl),
    SCMP_SYS(reboot),
    SCMP_SYS(syslog),
    SCMP_SYS(acct),
    SCMP_SYS(personality),
    SCMP_SYS(iopl),
    SCMP_SYS(ioperm),
    /* who we are: that is settled before the filter */
    SCMP_SYS(setuid),
    SCMP_SYS(setgid),
    SCMP_SYS(setreuid),
    SCMP_SYS(setregid),
    SCMP_SYS(setresuid),
    SCMP_SYS(setresgid),
    SCMP_SYS(setfsuid),
    SCMP_SYS(setfsgid),
    SCMP_SYS(setgroups),
    SCMP_SYS(capset),
    /* by which all of this could be gone round: other calls' work, handles instead of names */
    SCMP_SYS(io_uring_setup),
    SCMP_SYS(io_uring_enter),
    SCMP_SYS(io_uring_register),
    SCMP_SYS(open_by_handle_at),
    SCMP_SYS(openat2),
    SCMP_SYS(pkey_mprotect),
    /* names that lead elsewhere */
    SCMP_SYS(link),
    SCMP_SYS(linkat),
    SCMP_SYS(symlink),
    SCMP_SYS(symlinkat),
    SCMP_SYS(mknod),
    SCMP_SYS(mknodat),
    SCMP_SYS(mkdir),
    SCMP_SYS(mkdirat),
    /* the clock, the machine's name */
    SCMP_SYS(settimeofday),
    SCMP_SYS(clock_settime),
    SCMP_SYS(clock_adjtime),
    SCMP_SYS(adjtimex),
    SCMP_SYS(sethostname),
    SCMP_SYS(setdomainname),
};

/* The kernel looks at 32 bits of a command. */
static int add_for_each(scmp_filter_ctx filter, uint32_t action, int call, const uint32_t *commands,
                        size_t count)
{
    int result = 0;

    for (size_t i = 0; i < count && result == 0; i++) {
        result = seccomp_rule_add(filter, action, call, 1,
                                  SCMP_A1(SCMP_CMP_MASKED_EQ, UINT32_MAX, commands[i]));
    }
    return result;
}

#define ADD_FOR_EACH(filter, action, call, commands)                                               \
    add_for_each(filter, action, call, commands, sizeof(commands) / sizeof((commands)[0]))

/* A signal to ourselves is what abort() sends; to our keeper, of the same user, it would be its
 * end. */
static int add_own_descriptors_and_signals(scmp_filter_ctx filter)
{
    int result = ADD_FOR_EACH(filter, SCMP_ACT_ALLOW, SCMP_SYS(fcntl), fcntl_commands);

    if (result == 0) {
        result = ADD_FOR_EACH(filter, SCMP_ACT_ALLOW, SCMP_SYS(ioctl), ioctl_requests);
    }
    return result < 0 ? result
                      : seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1,
                                         SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)getpid()));
}

static int refuse_owners_and_signals(scmp_filter_ctx filter, uint32_t refuse)
{
    int result = ADD_FOR_EACH(filter, refuse, SCMP_SYS(fcntl), owner_commands);

    if (result == 0) {
        result = ADD_FOR_EACH(filter, refuse, SCMP_SYS(ioctl), owner_requests);
    }
    return result < 0 ? result
                      : seccomp_rule_add(filter, refuse, SCMP_SYS(tgkill), 1,
                                         SCMP_A0(SCMP_CMP_NE, (scmp_datum_t)getpid()));
}

/* Of the internet's family datagrams only: raw ones, with CAP_NET_RAW, would read along what comes
 * to the page, its password among it, and get past the firewall. */
static int allow_datagrams(scmp_filter_ctx filter)
{
    return seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(socket), 2,
                            SCMP_A0(SCMP_CMP_EQ, AF_INET),
                            SCMP_A1(SCMP_CMP_MASKED_EQ, SOCKET_TYPE_MASK, SOCK_DGRAM));
}

/* Netlink (with CAP_NET_ADMIN: the firewall) and packets among them. */
static int refuse_other_sockets(scmp_filter_ctx filter, uint32_t refuse)
{
    int result = socket_families_refuse(filter, refuse, socket_families,
                                        sizeof(socket_families) / sizeof(socket_families[0]));

    return result < 0 ? result : socket_families_datagrams_only(filter, refuse);
}

/* With an error, not by ending us: silence is worse than a call that fails. */
static int add_refusals(scmp_filter_ctx filter)
{
    const uint32_t refuse = SCMP_ACT_ERRNO(EPERM);
    const uint64_t executable = PROT_EXEC;
    int result = 0;

    for (size_t i = 0; i < sizeof(never) / sizeof(never[0]); i++) {
        result = seccomp_rule_add(filter, refuse, never[i], 0);
        if (result < 0 && result != -EDOM) {
            return result;
        }
    }
    result = seccomp_rule_add(filter, refuse, SCMP_SYS(mmap), 1,
                              SCMP_A2(SCMP_CMP_MASKED_EQ, executable, executable));
    if (result == 0) {
        result = seccomp_rule_add(filter, refuse, SCMP_SYS(mprotect), 1,
                                  SCMP_A2(SCMP_CMP_MASKED_EQ, executable, executable));
    }
    if (result == 0) {
        result = refuse_owners_and_signals(filter, refuse);
    }
    return result < 0 ? result : refuse_other_sockets(filter, refuse);
}

static int add_rules(scmp_filter_ctx filter)
{
    const uint64_t executable = PROT_EXEC;
    int result;

    for (size_t i = 0; i < sizeof(allowed) / sizeof(allowed[0]); i++) {
        result = seccomp_rule_add(filter, SCMP_ACT_ALLOW, allowed[i], 0);
        if (result < 0 && result != -EDOM) {
            return result;
        }
    }
    result = add_own_descriptors_and_signals(filter);
    if (result < 0) {
        return result;
    }
    for (size_t i = 0; i < sizeof(socket_families) / sizeof(socket_families[0]); i++) {
        result = socket_families[i] == AF_INET
                     ? allow_datagrams(filter)
                     : seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(socket), 1,
                                        SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)socket_families[i]));
        if (result < 0) {
            return result;
        }
    }
    result = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 1,
                              SCMP_A2(SCMP_CMP_MASKED_EQ, executable, 0));
    if (result < 0) {
        return result;
    }
    return seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1,
                            SCMP_A2(SCMP_CMP_MASKED_EQ, executable, 0));
}

static int enter_filter(bool log_only)
{
    scmp_filter_ctx filter = seccomp_init(log_only ? SCMP_ACT_LOG : SCMP_ACT_KILL_PROCESS);
    int result;

    if (filter == NULL) {
        return -ENOMEM;
    }
    result = add_rules(filter);
    if (result == 0 && log_only) {
        result = add_refusals(filter);
    }
    if (result == 0) {
        result = seccomp_load(filter);
    }
    seccomp_release(filter);
    malloc_trim(0); /* what the filter was built in */
    return result;
}

static bool may(unsigned right)
{
    return capng_have_capability(CAPNG_PERMITTED, right) == 1;
}

static bool may_more(void)
{
    for (unsigned right = 0; right <= CAP_LAST_CAP; right++) {
        if (right != CAP_NET_RAW && right != CAP_NET_ADMIN && may(right)) {
            return true;
        }
    }
    return false;
}

/* Who wasn't started as root, but by a service manager or in a container, has the rights that there
 * are: of them the two are kept. One that is missing costs its radio, not the others. */
static int keep_rights(void)
{
    bool raw = may(CAP_NET_RAW), admin = may(CAP_NET_ADMIN), more = may_more();

    if (!raw || !admin) {
        log_warning("without %s%s%s: radios may stay silent", raw ? "" : "CAP_NET_RAW",
                    raw || admin ? "" : " and ", admin ? "" : "CAP_NET_ADMIN");
    }
    if (prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0) < 0) {
        return -errno;
    }
    if (more) { /* else nothing is to be given up, which a service manager's filter may refuse */
        capng_clear(CAPNG_SELECT_BOTH);
        capng_update(raw ? CAPNG_ADD : CAPNG_DROP, CAPNG_EFFECTIVE | CAPNG_PERMITTED, CAP_NET_RAW);
        capng_update(admin ? CAPNG_ADD : CAPNG_DROP, CAPNG_EFFECTIVE | CAPNG_PERMITTED,
                     CAP_NET_ADMIN);
        if (capng_apply(CAPNG_SELECT_CAPS) < 0) {
            return -EPERM;
        }
    }
    /* As after a change of user: no other process of that user looks into this one. */
    return prctl(PR_SET_DUMPABLE, 0) < 0 ? -errno : 0;
}

/* Keeps the two capabilities over the change of user; the bounding set is emptied as well. */
static int become(const char *user)
{
    const struct passwd *entry = getpwnam(user);
    int result, parent_death_signal = 0;

    if (geteuid() != 0) {
        if (entry == NULL || entry->pw_uid != geteuid()) {
            log_warning("only root becomes user \"%s\": this one, %u, stays", user, geteuid());
        }
        return keep_rights();
    }
    if (entry == NULL) {
        log_warning("there is no user \"%s\": \"%s\" is taken", user, INSTEAD);
        entry = getpwnam(INSTEAD);
    }
    if (entry == NULL) {
        return -ENOENT;
    }
    if (prctl(PR_GET_PDEATHSIG, &parent_death_signal) < 0) {
        return -errno;
    }
    capng_clear(CAPNG_SELECT_ALL);
    if (capng_updatev(CAPNG_ADD, CAPNG_EFFECTIVE | CAPNG_PERMITTED, CAP_NET_RAW, CAP_NET_ADMIN,
                      -1) < 0) {
        return -EPERM;
    }
    result = capng_change_id((int)entry->pw_uid, (int)entry->pw_gid,
                             CAPNG_INIT_SUPP_GRP | CAPNG_CLEAR_BOUNDING | CAPNG_CLEAR_AMBIENT);
    if (result < 0) {
        return -EPERM;
    }
    /* The change has cleared it, and with it the keeper's way not to leave us behind. */
    return prctl(PR_SET_PDEATHSIG, parent_death_signal) < 0 ? -errno : 0;
}

int sandbox_enter(const char *user, bool log_only)
{
    int result = become(user);

    if (result < 0) {
        log_error("can't become user \"%s\" with CAP_NET_RAW and CAP_NET_ADMIN only: %s", user,
                  strerror(-result));
        return result;
    }
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) < 0) {
        result = -errno;
        log_error("can't set no_new_privs: %s", strerror(-result));
        return result;
    }
    result = enter_filter(log_only);
    if (result < 0) { /* the kernel's, a container's or a service manager's doing */
        log_warning("can't enter the system-call filter (%s): it goes on without",
                    strerror(-result));
        return SANDBOX_NO_FILTER;
    }
    return 0;
}
