/*
 * odidctl: asks the daemon how it is, and checks, reads and changes the
 * configuration. Each command is in a file odidctl_<command>.c.
 */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/settings.h"
#include "base/whole_file.h"
#include "config/config.h"
#include "flights/flights_show.h"
#include "odidctl/odidctl.h"

static const char usage[] =
    "odidctl asks the Remote ID daemon how it is, and looks after its configuration.\n"
    "\n"
    "  odidctl status [--json]           everything at one glance; exit 0 only when all that is\n"
    "                                    required is on the air\n"
    "  odidctl watch                     the same, again every second\n"
    "  odidctl doctor                    who else on this computer disturbs Remote ID, and the\n"
    "                                    remedy; exit 0 only when nobody is seen to\n"
    "  odidctl flights [N] [--json]      was it on the air the whole flight? one line a power-on,\n"
    "                                    newest first; record N in detail\n"
    "  odidctl armed                     armed, disarmed or unknown; for scripts\n"
    "  odidctl radios                    on-air, stuck or off, each; for scripts\n"
    "  odidctl check FILE                what is wrong in a configuration file\n"
    "  odidctl check DIR                 whether import would take over all that is there\n"
    "  odidctl get SECTION.KEY...        the values in force, such as wifi.channel's, one a line\n"
    "  odidctl set SECTION.KEY VALUE     changes it, unless it is wrong\n"
    "  odidctl in-force                  has the daemon what is saved for it? for scripts\n"
    "  odidctl import DIR                takes over DIR/odid.conf and DIR/authorized_keys\n"
    "  odidctl maintenance on|off        opens the access point to the technician, or closes it\n"
    "  odidctl update [FILE|URL]         installs a bundle; alone: how the update stands\n"
    "  odidctl update DIR                the newest one there, if it is newer; as from a stick\n"
    "  odidctl update cancel             calls off what is being installed\n"
    "  odidctl find-autopilot BAUD SECONDS PORT...\n"
    "                                    on which serial port one speaks; for scripts\n"
    "  odidctl board-test [STEP...]      tries what only a real board can show, and asks what a\n"
    "                                    receiver beside it shows; the report goes to CONFIG\n"
    "  odidctl factory-reset             forgets all settings, and takes over what CONFIG has\n"
    "  odidctl --version | --help\n"
    "\n"
    "Other places than the usual ones: -run-dir DIR, -config FILE, -root DIR. See odidctl(1) and\n"
    "odid.conf(5).\n";

static struct {
    struct places places;
    const char *root;
    bool json;
} self = {.root = ""};

/* ---- check ---- */

static void print_sentence(void *context, enum config_severity severity, const char *sentence)
{
    static const char *const names[] = {
        [CONFIG_ERROR] = "error", [CONFIG_WARNING] = "warning", [CONFIG_NOTE] = "note"};
    unsigned *wrong = context;

    *wrong += severity != CONFIG_NOTE;
    printf("%s: %s\n", names[severity], sentence);
}

static int check(const char *file)
{
    struct config config;
    unsigned wrong = 0;

    config_defaults(&config);
    config_read_file(&config, file, print_sentence, &wrong);
    config_judge(&config, print_sentence, &wrong);
    explicit_bzero(&config, sizeof(config));
    printf("%s: %s\n", file, wrong == 0 ? "nothing is wrong" : "see above");
    return wrong == 0 ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

/* ---- the commands ---- */

static int run_status(char *const words[])
{
    (void)words;
    return odidctl_status(&self.places, self.json);
}

static int run_watch(char *const words[])
{
    (void)words;
    return odidctl_watch(&self.places);
}

static int run_doctor(char *const words[])
{
    (void)words;
    return odidctl_doctor(&self.places);
}

static int run_flights(char *const words[])
{
    char boot[64];

    whole_file_line(self.places.boot_id, boot, sizeof(boot));
    return flights_show(stdout, self.places.flights, words[1], boot, self.json);
}

static int run_check(char *const words[])
{
    struct stat file;

    return stat(words[1], &file) == 0 && S_ISDIR(file.st_mode) ? odidctl_import_check(words[1])
                                                               : check(words[1]);
}

static int run_get(char *const words[])
{
    return settings_get(&self.places, words + 1);
}

/* Settings of the appliance's other programs: on a companion computer nobody reads them. */
static bool is_appliances(const char *name)
{
    static const char *const sections[] = {"autopilot.", "ground_station.", "maintenance.",
                                           "update.", "board."};

    for (size_t i = 0; i < sizeof(sections) / sizeof(sections[0]); i++) {
        if (strncasecmp(name, sections[i], strlen(sections[i])) == 0) {
            return true;
        }
    }
    return false;
}

static int run_set(char *const words[])
{
    if (PLACES_COMPANION && is_appliances(words[1])) {
        explicit_bzero(words[2], strlen(words[2])); /* it may be a password */
        printf("%s is a setting of the appliance's: nothing reads it here, and it isn't kept.\n",
               words[1]);
        return ODIDCTL_NOT_GOOD;
    }
    return settings_set(&self.places, words[1], words[2]);
}

static int run_in_force(char *const words[])
{
    (void)words;
    return settings_in_force(&self.places);
}

static int run_import(char *const words[])
{
    return odidctl_import(&self.places, words[1]);
}

static int run_maintenance(char *const words[])
{
    if (strcmp(words[1], "on") != 0 && strcmp(words[1], "off") != 0) {
        fputs("odidctl: maintenance needs \"on\" or \"off\"\n", stderr);
        return ODIDCTL_USAGE;
    }
    return odidctl_maintenance(&self.places, words[1]);
}

static int run_armed(char *const words[])
{
    (void)words;
    return odidctl_tell_armed(&self.places);
}

static int run_radios(char *const words[])
{
    (void)words;
    return odidctl_radios(&self.places);
}

static int run_update(char *const words[])
{
    return odidctl_update(&self.places, words[1]);
}

static int run_find_autopilot(char *const words[])
{
    return odidctl_find_autopilot(words[1], words[2], words + 3);
}

static int run_factory_reset(char *const words[])
{
    (void)words;
    return odidctl_factory_reset(&self.places);
}

/* A script, which asks whoever is there. */
static int run_board_test(char *const words[])
{
    execv(self.places.board_test, words);
    fprintf(stderr, "odidctl: %s: %s\n", self.places.board_test, strerror(errno));
    return ODIDCTL_NO_ANSWER;
}

#define WORDS_MAX 12

static const struct command {
    const char *name;
    int least, most; /* words, with its own */
    const char *needs;
    int (*run)(char *const words[]);
    bool json;             /* whether it can answer so */
    const char *elsewhere; /* what is said by whom the appliance isn't around; NULL: it works */
} commands[] = {
    {"status", 1, 1, "status takes no words", run_status, true, NULL},
    {"watch", 1, 1, "watch takes no words", run_watch, false, NULL},
    {"doctor", 1, 1, "doctor takes no words", run_doctor, false, NULL},
    {"flights", 1, 2, "flights takes at most one number", run_flights, true,
     "Flight records are the appliance's; here the journal has the log: journalctl -u odid."},
    {"check", 2, 2, "check needs one FILE or DIR", run_check, false, NULL},
    {"get", 2, WORDS_MAX, "get needs at least one SECTION.KEY, and takes up to 11", run_get, false,
     NULL},
    {"set", 3, 3, "set needs SECTION.KEY and VALUE; quote a value with blanks", run_set, false,
     NULL},
    {"in-force", 1, 1, "in-force takes no words", run_in_force, false, NULL},
    {"import", 2, 2, "import needs one DIR", run_import, false,
     "The volume CONFIG is the appliance's; here " PLACES_CONFIG
     " itself is edited, or by odidctl set."},
    {"armed", 1, 1, "armed takes no words", run_armed, false, NULL},
    {"radios", 1, 1, "radios takes no words", run_radios, false, NULL},
    {"maintenance", 2, 2, "maintenance needs \"on\" or \"off\"", run_maintenance, false,
     "Maintenance is the appliance's; here odidctl set changes settings at any time."},
    {"factory-reset", 1, 1, "factory-reset takes no words", run_factory_reset, false,
     "The factory reset is the appliance's; here apt purge odid forgets the settings."},
    {"board-test", 1, 6, "board-test takes up to five numbers", run_board_test, false,
     "The board test is the appliance's, for its own board; here odidctl doctor looks around."},
    {"find-autopilot", 4, WORDS_MAX, "find-autopilot needs BAUD, SECONDS and up to 9 PORTs",
     run_find_autopilot, false, NULL},
    {"update", 1, 2, "update takes at most one FILE, URL or DIR, or \"cancel\"", run_update, false,
     "Updates by bundles are the appliance's; here apt brings them: apt install ./odid_*.deb."},
};

/* ---- command line ---- */

static int wrong_usage(const char *what)
{
    fprintf(stderr, "odidctl: %s\n\n%s", what, usage);
    return ODIDCTL_USAGE;
}

static int run_command(const struct command *command, int count, char *const words[])
{
    if (count < command->least || count > command->most) {
        return wrong_usage(command->needs);
    }
    if (self.json && !command->json) {
        return wrong_usage("only status and flights have --json");
    }
    if (PLACES_COMPANION && command->elsewhere != NULL) {
        puts(command->elsewhere);
        return ODIDCTL_NOT_GOOD;
    }
    return command->run(words);
}

static int run_words(int count, char *const words[])
{
    if (count == 0) {
        return wrong_usage("say what to do");
    }
    for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++) {
        if (strcmp(words[0], commands[i].name) == 0) {
            return run_command(&commands[i], count, words);
        }
    }
    return wrong_usage("no such command");
}

enum flag { FLAG_RUN_DIR = 1, FLAG_CONFIG, FLAG_ROOT, FLAG_JSON, FLAG_HELP, FLAG_VERSION };

/* Returns -1 to go on, or the exit code. */
static int take_flag(int flag)
{
    switch (flag) {
    case FLAG_RUN_DIR:
        self.places.run_dir = optarg;
        return -1;
    case FLAG_CONFIG:
        self.places.config = optarg;
        self.places.other_config = true;
        return -1;
    case FLAG_ROOT:
        self.root = optarg;
        return -1;
    case FLAG_JSON:
        self.json = true;
        return -1;
    case FLAG_HELP:
        fputs(usage, stdout);
        return ODIDCTL_GOOD;
    case FLAG_VERSION:
        puts("odidctl " ODID_VERSION);
        return ODIDCTL_GOOD;
    default:
        return ODIDCTL_USAGE; /* getopt said what is wrong */
    }
}

int main(int argc, char *argv[])
{
    static const struct option flags[] = {
        {"run-dir", required_argument, NULL, FLAG_RUN_DIR},
        {"config", required_argument, NULL, FLAG_CONFIG},
        {"root", required_argument, NULL, FLAG_ROOT},
        {"json", no_argument, NULL, FLAG_JSON},
        {"help", no_argument, NULL, FLAG_HELP},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    char *words[WORDS_MAX + 2] = {NULL};
    int count = 0;

    /* Flags may stand between the words; but a value to be set is no flag, "-12.5" neither. */
    while (optind < argc) {
        bool value = count == 2 && strcmp(words[0], "set") == 0;
        int flag = value ? -1 : getopt_long_only(argc, argv, "+", flags, NULL), result;

        if (flag != -1) {
            result = take_flag(flag);
            if (result != -1) {
                return result;
            }
        } else if (optind < argc) {
            words[count] = argv[optind++];
            count += count <= WORDS_MAX;
        }
    }
    places_under(&self.places, self.root);
    return run_words(count, words);
}
