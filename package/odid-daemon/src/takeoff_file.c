#include "takeoff_file.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "config.h"

#define PATH_SIZE (CONFIG_PATH_SIZE + 16)

void takeoff_file_read(const char *run_dir, struct aircraft_takeoff *takeoff)
{
    char path[PATH_SIZE], text[128] = "";
    ssize_t length;
    int fd;

    memset(takeoff, 0, sizeof(*takeoff));
    snprintf(path, sizeof(path), "%s/takeoff", run_dir);
    fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return;
    }
    length = read(fd, text, sizeof(text) - 1);
    close(fd);
    takeoff->known =
        length > 0 &&
        sscanf(text, "%lf %lf %lf %lf", &takeoff->latitude_deg, &takeoff->longitude_deg,
               &takeoff->altitude_msl_m, &takeoff->altitude_geodetic_m) == 4 &&
        fabs(takeoff->latitude_deg) <= 90 && fabs(takeoff->longitude_deg) <= 180;
}

int takeoff_file_write(const char *run_dir, const struct aircraft_takeoff *takeoff)
{
    char path[PATH_SIZE], fresh[PATH_SIZE], text[128];
    int length, fd, error = 0;

    snprintf(path, sizeof(path), "%s/takeoff", run_dir);
    snprintf(fresh, sizeof(fresh), "%s/takeoff.new", run_dir);
    if (!takeoff->known) {
        return unlink(path) < 0 && errno != ENOENT ? -errno : 0;
    }
    length = snprintf(text, sizeof(text), "%.9f %.9f %.3f %.3f\n", takeoff->latitude_deg,
                      takeoff->longitude_deg, takeoff->altitude_msl_m,
                      takeoff->altitude_geodetic_m); /* an unknown altitude is "nan" */
    fd = open(fresh, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd < 0) {
        return -errno;
    }
    if (write(fd, text, (size_t)length) != length) {
        error = errno != 0 ? errno : EIO;
    }
    close(fd);
    if (error == 0 && rename(fresh, path) < 0) {
        error = errno;
    }
    return -error;
}
