/* odidctl status and watch: how the daemon and the appliance are. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/faults.h"
#include "appliance/status_ask.h"
#include "appliance/status_fetch.h"
#include "odidctl/odidctl.h"
#include "odidctl/odidctl_table.h"

/* ---- asking the daemon ---- */

static int say_no_answer(const char *run_dir, int error)
{
    switch (error) {
    case ENOENT:
    case ECONNREFUSED:
        fprintf(stderr,
                "odidctl: the daemon is not running (%s/%s: %s).\n"
                "Start it, and read its log if it ends again. If it was started with another\n"
                "[daemon] run_dir, name that: odidctl -run-dir DIR ...\n",
                run_dir, STATUS_SOCKET, strerror(error));
        break;
    case EAGAIN:
        fprintf(stderr,
                "odidctl: the daemon does not answer (%s/%s).\n"
                "It hangs; its supervisor restarts it within seconds. If not, restart it.\n",
                run_dir, STATUS_SOCKET);
        break;
    case EBADMSG:
        fprintf(stderr,
                "odidctl: the daemon's answer can't be understood (%s/%s).\n"
                "Are odidctl and odid-daemon of the same version?\n",
                run_dir, STATUS_SOCKET);
        break;
    default:
        fprintf(stderr, "odidctl: can't ask the daemon (%s/%s: %s).\n", run_dir, STATUS_SOCKET,
                strerror(error));
        break;
    }
    return ODIDCTL_NO_ANSWER;
}

int odidctl_tell_armed(const struct places *places)
{
    static const char *const words[] = {[ARMED_UNKNOWN] = "unknown",
                                        [ARMED_YES] = "armed",
                                        [ARMED_UNSAID] = "unknown",
                                        [ARMED_SILENT] = "disarmed",
                                        [ARMED_NO] = "disarmed"};
    static const char *const by[] = {
        [KEPT_UNHEARD] = "unheard", [KEPT_DISARMED] = "said", [KEPT_ARMED] = "said",
        [KEPT_SILENT] = "silent",   [KEPT_UNSAID] = "unsaid", [KEPT_AWAITED] = "awaited"};
    struct kept kept;
    enum armed armed = armed_look(places->run_dir, &kept);

    printf("%s %s %u %s\n", words[armed], kept.armed_once ? "once" : "never", kept.vehicle,
           by[kept.armed]);
    return armed == ARMED_NO || armed == ARMED_SILENT ? ODIDCTL_NOT_GOOD : ODIDCTL_GOOD;
}

/* ---- showing ---- */

int odidctl_status(const struct places *places, bool json)
{
    int error = 0;
    struct json_object *faults = faults_list(places->faults);
    struct json_object *status = status_fetch(places->run_dir, &error);
    bool on_air;

    if (status == NULL) {
        say_no_answer(places->run_dir, error);
        odidctl_table_faults(stderr, faults, isatty(STDERR_FILENO));
        json_object_put(faults);
        return ODIDCTL_NO_ANSWER;
    }
    json_object_object_add(status, "appliance_faults", faults);
    odidctl_add_update(places, status);
    if (json) {
        puts(json_object_to_json_string_ext(status,
                                            JSON_C_TO_STRING_PRETTY | JSON_C_TO_STRING_SPACED));
    } else {
        odidctl_table(stdout, status, isatty(STDOUT_FILENO));
    }
    on_air = json_object_get_boolean(json_object_object_get(status, "on_air"));
    json_object_put(status);
    return on_air ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

/* Ends by Ctrl-C, or when nobody reads any more. */
int odidctl_watch(const struct places *places)
{
    const struct timespec second = {.tv_sec = 1};
    bool terminal = isatty(STDOUT_FILENO);
    static char page[16384];

    setvbuf(stdout, page, _IOFBF, sizeof(page)); /* a page appears at once, without flicker */
    while (!ferror(stdout)) {
        if (terminal) {
            fputs("\033[H\033[2J", stdout);
            fflush(stdout);
        }
        odidctl_status(places, false);
        fputs(terminal ? "\nCtrl-C ends this.\n" : "\n", stdout);
        fflush(stdout);
        nanosleep(&second, NULL);
    }
    return ODIDCTL_NOT_GOOD;
}
