#include "update/update_environment.h"

#include <errno.h>
#include <fcntl.h>
#include <libuboot.h>
#include <linux/fs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/whole_file.h"

#define PATH_SIZE 300
#define FILES 2

/* ---- where it is ---- */

static const char *const files[FILES] = {"uboot.env", "uboot-redund.env"};

struct place {
    long long offset;
    long long size;
};

/* A file's place on its volume, when it lies there in one piece. Returns 0 or -errno. */
static int place_of(int fd, struct place *place)
{
    struct stat file;
    int block_size, first = 0;

    if (fstat(fd, &file) < 0 || ioctl(fd, FIGETBSZ, &block_size) < 0) {
        return -errno;
    }
    for (int i = 0; (long long)i * block_size < file.st_size; i++) {
        int block = i; /* in the file; then on the volume */

        if (ioctl(fd, FIBMAP, &block) < 0) {
            return -errno;
        }
        first = i == 0 ? block : first;
        if (block == 0 || block != first + i) {
            return -ENOTUNIQ;
        }
    }
    place->offset = (long long)first * block_size;
    place->size = file.st_size;
    return file.st_size > 0 ? 0 : -ENODATA;
}

static int find_file(const char *mount_point, const char *name, struct place *place)
{
    char path[PATH_SIZE];
    int fd, result;

    snprintf(path, sizeof(path), "%s/%s", mount_point, name);
    fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return -errno;
    }
    result = place_of(fd, place);
    close(fd);
    return result;
}

static bool find_files(const char *volume, const char *mount_point, char *text, size_t size,
                       char *problem, size_t problem_size)
{
    size_t filled = 0;

    for (int i = 0; i < FILES; i++) {
        struct place place = {0};
        int result = find_file(mount_point, files[i], &place);

        if (result < 0) {
            snprintf(problem, problem_size, "%s on the volume ENV: %s", files[i],
                     result == -ENOTUNIQ ? "it doesn't lie in one piece" : strerror(-result));
            return false;
        }
        filled += (size_t)snprintf(text + filled, size - filled, "%s 0x%llx 0x%llx\n", volume,
                                   place.offset, place.size);
    }
    return true;
}

bool update_environment_find(const char *volume, const char *mount_point, const char *config,
                             char *problem, size_t problem_size)
{
    char text[2 * PATH_SIZE];
    bool found;
    int result;

    if ((mkdir(mount_point, 0700) < 0 && errno != EEXIST) ||
        mount(volume, mount_point, "vfat", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC, NULL) <
            0) {
        snprintf(problem, problem_size, "the volume ENV can't be read: %s", strerror(errno));
        return false;
    }
    found = find_files(volume, mount_point, text, sizeof(text), problem, problem_size);
    umount(mount_point);
    if (!found) {
        return false;
    }
    result = whole_file_replace(config, text, strlen(text), 0644);
    if (result < 0) {
        snprintf(problem, problem_size, "%s: %s", config, strerror(-result));
    }
    return result == 0;
}

/* ---- variables ---- */

/* A context with what is on the disk, or, when both copies are damaged, with the defaults (NULL:
 * fails). */
static int open_environment(const char *config, const char *defaults, struct uboot_ctx **context,
                            bool *damaged)
{
    int result;

    *damaged = false;
    if (libuboot_initialize(context, NULL) < 0) {
        return -ENOMEM;
    }
    if (libuboot_read_config(*context, config) < 0) {
        libuboot_exit(*context);
        return -ENOENT;
    }
    result = libuboot_open(*context);
    /* Else (-EIO) a copy can't be read, and the other one may be good. */
    *damaged = result == -ENODATA;
    if (*damaged && defaults != NULL && libuboot_load_file(*context, defaults) >= 0) {
        return 0;
    }
    if (result < 0) {
        libuboot_close(*context);
        libuboot_exit(*context);
    }
    return result;
}

static int close_environment(struct uboot_ctx *context, bool store)
{
    int result = store && libuboot_env_store(context) < 0 ? -EIO : 0;

    libuboot_close(context);
    libuboot_exit(context);
    return result;
}

static char slot_variable(struct uboot_ctx *context, const char *name)
{
    char *value = libuboot_get_env(context, name);
    char slot =
        value != NULL && (strcmp(value, "a") == 0 || strcmp(value, "b") == 0) ? value[0] : '\0';

    free(value);
    return slot;
}

static void set_slot(struct uboot_ctx *context, const char *name, char slot)
{
    char value[2] = {slot, '\0'};

    libuboot_set_env(context, name, slot == '\0' ? NULL : value);
}

int update_variables_read(const char *config, const char *defaults, char running,
                          struct update_variables *variables, bool *repaired)
{
    struct uboot_ctx *context;
    int result = open_environment(config, defaults, &context, repaired);
    char *value;

    memset(variables, 0, sizeof(*variables));
    if (result < 0) {
        return result;
    }
    if (*repaired) {
        set_slot(context, "slot", running);
    }
    variables->slot = slot_variable(context, "slot");
    variables->trial = slot_variable(context, "trial");
    variables->trial_failed = slot_variable(context, "trial_failed");
    variables->unverified = slot_variable(context, "unverified");
    value = libuboot_get_env(context, "upgrade_available");
    variables->upgrade_available = value != NULL && strcmp(value, "1") == 0;
    free(value);
    value = libuboot_get_env(context, "trial_reason");
    snprintf(variables->trial_reason, sizeof(variables->trial_reason), "%s",
             value == NULL ? "" : value);
    free(value);
    value = libuboot_get_env(context, "restarts");
    variables->restarts = value == NULL ? 0 : (unsigned)strtoul(value, NULL, 16);
    free(value);
    return close_environment(context, *repaired);
}

/* Where there is none, nobody reads it. SWUpdate's own word that a trial is to come is over with
 * the trial: as long as it stands, its client takes nothing from its server. */
static void set_report(struct uboot_ctx *context, enum update_report report, bool trial_to_come)
{
    char *state = libuboot_get_env(context, "ustate"), value[2] = {(char)report, '\0'};

    if (state != NULL && strcmp(state, "1") == 0 && report == UPDATE_REPORT_AS_IT_IS &&
        !trial_to_come) {
        value[0] = UPDATE_REPORT_NOTHING;
    }
    if (state != NULL && value[0] != UPDATE_REPORT_AS_IT_IS) {
        libuboot_set_env(context, "ustate", value);
    }
    free(state);
}

int update_variables_write(const char *config, const struct update_variables *variables,
                           enum update_report report)
{
    struct uboot_ctx *context;
    char restarts[16];
    bool damaged;
    int result = open_environment(config, NULL, &context, &damaged);

    if (result < 0) {
        return result;
    }
    set_slot(context, "slot", variables->slot);
    set_slot(context, "trial", variables->trial);
    set_slot(context, "trial_failed", variables->trial_failed);
    set_slot(context, "unverified", variables->unverified);
    libuboot_set_env(context, "trial_reason", NULL);
    libuboot_set_env(context, "upgrade_available", variables->upgrade_available ? "1" : "0");
    snprintf(restarts, sizeof(restarts), "%x", variables->restarts);
    libuboot_set_env(context, "restarts", restarts);
    libuboot_set_env(context, "bootcount", "0");
    set_report(context, report, variables->upgrade_available);
    return close_environment(context, true);
}
