#include "daemon/run_dir.h"

#include <dirent.h>
#include <fcntl.h>
#include <pwd.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/kept.h"
#include "base/log.h"
#include "daemon/kept_counters.h"

#define MODE 0755
#define KEPT_SIZE_MAX 4096 /* neither file is that long */

static bool is_kept(int folder, const char *name)
{
    struct stat file;

    return (strcmp(name, KEPT_FILE) == 0 || strcmp(name, KEPT_COUNTERS_FILE) == 0) &&
           fstatat(folder, name, &file, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(file.st_mode) &&
           file.st_size <= KEPT_SIZE_MAX;
}

static void clean_up(DIR *names)
{
    int folder = dirfd(names);
    struct dirent *entry;

    while ((entry = readdir(names)) != NULL) {
        const char *name = entry->d_name;

        if (strcmp(name, ".") != 0 && strcmp(name, "..") != 0 && !is_kept(folder, name) &&
            unlinkat(folder, name, 0) < 0) {
            unlinkat(folder, name, AT_REMOVEDIR);
        }
    }
}

void run_dir_prepare(const char *path, const char *user, bool clean)
{
    const struct passwd *owner = getpwnam(user);
    struct stat status;
    int folder;
    DIR *names;

    if (mkdir(path, MODE) == 0 && owner != NULL && chown(path, owner->pw_uid, owner->pw_gid) == 0) {
        log_info("made %s", path);
    }
    if (!clean || owner == NULL) {
        return;
    }
    folder = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (folder < 0) {
        return;
    }
    names = fdopendir(folder);
    if (names == NULL) {
        close(folder);
        return;
    }
    if (fstat(folder, &status) == 0 && status.st_uid == owner->pw_uid &&
        fchmod(folder, MODE) == 0) {
        clean_up(names);
    }
    closedir(names);
}
