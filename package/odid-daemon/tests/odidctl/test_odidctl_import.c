/* odidctl import: what technicians' computers make of a file, and what comes of it. */
#include "appliance/password.h"
#include "odidctl_bench.h"

#include <sys/mount.h>

#include "own_mounts.h"

#define CONF "data/odid/odid.conf"
#define ANY_KEY "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define REPORT "volume/odid-report.txt"
#define MADE "volume/maintenance-password.txt"
#define BEFORE "[wifi]\nchannel = 1\n"
#define GOOD                                                                                       \
    "[basic_id]\nuas_id = SSRS5GBG01\n[operator]\noperator_id = SWE3jxza7qbzvu5d\n"                \
    "[wifi]\nchannel = 11\n"
/* A public key made for this test. */
#define KEY "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIAABAgMEBQYHCAkKCwwNDg8QERITFBUWFxgZGhscHR4f "

static void expect_report(const char *part)
{
    const char *report = got(REPORT);

    assert_non_null(report);
    if (strstr(report, part) == NULL) {
        fail_msg("not in the report: %s\n%s", part, report);
    }
    for (const char *c = report; *c != '\0'; c++) { /* for Notepad */
        assert_true(*c != '\n' || (c > report && c[-1] == '\r'));
    }
}

/* ---- wrong in many ways ---- */

#define BYTES(text) text, sizeof(text) - 1

static void wrong_files_are_refused(void **state)
{
    static const struct {
        const char *name, *text;
        size_t length;
        const char *sentence;
    } cases[] = {
        {"odid.conf", BYTES("\xFF\xFE[\0w\0i\0f\0i\0]\0"), "is UTF-16 text; save it as UTF-8"},
        {"odid.conf", BYTES("\xFE\xFF\0[\0w\0i\0f\0i\0]"), "is UTF-16 text; save it as UTF-8"},
        {"odid.conf", BYTES("[\0w\0i\0f\0i\0]\0\n\0"), "is UTF-16 text; save it as UTF-8"},
        {"odid.conf", BYTES("{\\rtf1\\ansi [wifi]}"), "word processor's file (RTF)"},
        {"odid.conf", BYTES("PK\x03\x04xxxx"), "word processor's file or an archive"},
        {"odid.conf", BYTES("<html><body>[wifi]"), "is HTML or XML"},
        {"odid.conf", BYTES(""), "odid.conf: is empty; nothing in it is used"},
        {"odid.conf", BYTES("\0\0\0\0\0\0\0\0"), "holds only NUL bytes, as after a power cut"},
        {"odid.conf", BYTES("[wifi]\nchannel = 6\0\0\0\0\n"), "odid.conf line 2: holds NUL bytes"},
        {"odid.conf", BYTES("\0\5\26\7 macOS"), "is a \"._\" file that macOS puts beside"},
        {"odid.conf", BYTES(GOOD "[bas"), "odid.conf line 7: [bas]: unknown section"},
        {"odid.conf", BYTES(GOOD "[broadcast"), "line 7: [broadcast: the closing ] is missing"},
        {"odid.conf", BYTES(GOOD "count"), "line 7: neither [section] nor key = value"},
        {"odid.conf", BYTES(GOOD "[system]\noperator_latitude = 57,7\noperator_longitude = 12"),
         "line 8: [system] operator_latitude = \"57,7\": write 57.7, with a point"},
        {"odid.conf",
         BYTES(GOOD "[self_id]\ndescription = Sj\xC3\xB6r\xC3\xA4"
                    "ddning i G\xC3\xB6teborg\n"),
         "25 bytes (22 characters; \xC3\xA5, \xC3\xA4, \xC3\xB6 are 2 bytes each), 23 bytes fit"},
        {"odid.conf",
         BYTES(GOOD "[self_id]\ndescription = Sj\xF6r\xE4"
                    "ddning\n"),
         "2 bytes that are no UTF-8 (a file saved as \"ANSI\"?)"},
        {"odid.conf", BYTES("; a\xFF\n" GOOD), "holds octets 0xFF, as erased flash does"},
        {"odid.conf", BYTES(GOOD "[wfi]\nchannel = 1\n"),
         "line 7: [wfi]: unknown section, ignored with all its keys; did you mean [wifi]?"},
        {"odid.conf", BYTES(GOOD "uas_id = X\n"), "line 7: uas_id belongs in [basic_id]"},
        {"odid.conf", BYTES(GOOD "chanel = 1\n"), "unknown key, ignored; did you mean channel?"},
        /* What stays in force is named: the one before. */
        {"odid.conf", BYTES("[wifi]\nchannel = 36\n"), "; using 1"},
        {"odid.conf", BYTES(GOOD "[broadcast]\nbt4_enabled = ja\n"), "expected true or false"},
        {"odid.conf", BYTES(GOOD "[self_id]\ndescription = \"a\n"), "closing quote is missing"},
        {"odid.conf", BYTES(GOOD "[operator]\noperator_id = Anna\xC5ke\n"),
         "[operator] operator_id: expected only ASCII letters and digits"},
        {"odid.conf", BYTES(GOOD "[system]\noperator_latitude = 57.7\n"),
         "one is set without the other"},
        {"odid.conf", BYTES(GOOD "[maintenance]\npassword = sesame\n"), "expected 8-63 ASCII"},
        {"odid.conf", BYTES(GOOD "[basic_id]\nuas_id = SSRS5GBG0123456789012345\n"),
         "20 fit on the air"},
        {"odid.conf.txt", BYTES("[wifi]\nchannel = 36\n"), "odid.conf.txt line 2"},
        {"._odid.conf", BYTES("\0\5\26\7 macOS"), "there is only ._odid.conf, which macOS puts"},
        {"odid.conf.rtf", BYTES("{\\rtf1"), "there is no odid.conf, but odid.conf.rtf"},
        {"odid (1).conf", BYTES(GOOD), "there is no odid.conf, but odid (1).conf"},
    };

    (void)state;
    assert_true(COUNT(cases) >= 20);
    for (size_t i = 0; i < COUNT(cases); i++) {
        char path[64];

        bench_clear(NULL);
        put(CONF, BEFORE);
        snprintf(path, sizeof(path), "volume/%s", cases[i].name);
        put_bytes(path, cases[i].text, cases[i].length);
        /* Nor is anything forgotten for it (a factory reset asks so). */
        if (CALL("check", "volume") != 1) {
            fail_msg("would not be refused: %s", cases[i].sentence);
        }
        if (CALL("import", "volume") != 1) {
            fail_msg("was not refused: %s", cases[i].sentence);
        }
        expect_file(CONF, BEFORE);
        expect_report(cases[i].sentence);
        expect_report("stays in force");
        expect_report("In force now");
        assert_non_null(strstr(got("run/faults/config"), "The volume CONFIG was not taken over"));
        assert_null(strstr(got(REPORT), "sesame"));
    }
}

static void larger_than_anybody_needs(void **state)
{
    static char text[65537];

    (void)state;
    memset(text, ';', sizeof(text));
    put(CONF, BEFORE);
    put_bytes("volume/odid.conf", text, sizeof(text));
    assert_int_equal(CALL("import", "volume"), 1);
    expect_report("it is larger than 64 KiB");
    unlink("volume/odid.conf");
    shell("mkdir volume/odid.conf");
    assert_int_equal(CALL("import", "volume"), 1);
    expect_report("can't be read: Is a directory");
    expect_file(CONF, BEFORE);
    assert_int_equal(CALL("import", "elsewhere"), 1);
    assert_non_null(strstr(said, "what was in force before stays in force"));
}

/* ---- odd and right ---- */

static void odd_files_are_taken_over(void **state)
{
    static const struct {
        const char *name, *text, *said, *kept;
    } cases[] = {
        {"odid.conf", GOOD, "It was taken over", GOOD},
        {"ODID.CONF", GOOD, "It was taken over", GOOD},
        {"Odid.Conf.TXT", GOOD, "note: its name is Odid.Conf.TXT (Windows adds .txt", GOOD},
        {"odid.conf", "\xEF\xBB\xBF" GOOD, "byte-order mark, as Windows writes it: no fault",
         "\xEF\xBB\xBF" GOOD},
        {"odid.conf", "[wifi]\r\nchannel = 11\r\n", "has the line ends of Windows: no fault",
         "[wifi]\r\nchannel = 11\r\n"},
        {"odid.conf", "[wifi]\nchannel = 11",
         "note: ends within its last line. If the file was cut", "[wifi]\nchannel = 11"},
        {"odid.conf", "[wifi]\rchannel = 11\r", "It was taken over", "[wifi]\rchannel = 11\r"},
        {"odid.conf", GOOD "[self_id]\ndescription = \"Sj\xC3\xB6\"\n",
         "warning: odid.conf line 8: [self_id] description = \"Sj\xC3\xB6\": only ASCII is sure",
         GOOD "[self_id]\ndescription = \"Sj\xC3\xB6\"\n"},
        {"odid.conf", "[basic_id]\nuas_id = 123\n", "warning: [basic_id] uas_id = \"123\" is no",
         "[basic_id]\nuas_id = 123\n"},
        {"odid.conf", "; nothing\n", "warning: [basic_id] uas_id is not set", "; nothing\n"},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        char path[64];

        bench_clear(NULL);
        put(CONF, BEFORE);
        put("run/faults/config", "before\n");
        put("volume/._odid.conf", "rubbish");
        snprintf(path, sizeof(path), "volume/%s", cases[i].name);
        put(path, cases[i].text);
        assert_int_equal(CALL("import", "volume"), 0);
        expect_file(CONF, cases[i].kept);
        expect_report(cases[i].said);
        expect_file(path, cases[i].text);
        assert_null(strstr(got(REPORT), "._odid"));
        expect_none("run/faults/config");
    }
}

static void nothing_on_the_volume(void **state)
{
    (void)state;
    put(CONF, BEFORE);
    put("volume/odid.conf.example", GOOD);
    put("volume/README.TXT", "hello");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_report("There is none on this volume");
    expect_file(CONF, BEFORE);
    expect_none("run/faults/config");
}

static void two_files(void **state)
{
    (void)state;
    put("volume/odid.conf", GOOD);
    put("volume/odid.conf.txt", BEFORE);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(CONF, GOOD);
    expect_report("warning: there are odid.conf and odid.conf.txt: the first one counts");
    assert_non_null(strstr(said, "there are odid.conf and odid.conf.txt"));
}

static void identity_in_the_report(void **state)
{
    (void)state;
    put("volume/odid.conf", GOOD "[basic_id_2]\nuas_id = SE-ABC\nid_type = registration\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_report("  Aircraft              SSRS5GBG01 (serial)\r\n");
    expect_report("  Aircraft, second      SE-ABC (registration)\r\n");
    expect_report("  Operator number       SWE3jxza7qbzvu5d\r\n");
    expect_report("  Maintenance password  made by this board, see maintenance-password.txt\r\n");
    assert_null(strstr(got(REPORT), "Written:"));
}

static void the_date_when_it_is_known(void **state)
{
    struct stat first, second;
    pid_t daemon = answer_with("{\"time\": {\"known\": false, \"utc\": null}}");

    (void)state;
    put("volume/odid.conf", GOOD);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_null(strstr(got(REPORT), "Written:"));
    end(daemon);
    /* It alone is no reason to write. */
    assert_int_equal(stat(REPORT, &first), 0);
    daemon = answer_with("{\"time\": {\"known\": true, \"utc\": \"2026-11-21 12:00:00\"}}");
    assert_int_equal(CALL("import", "volume"), 0);
    assert_int_equal(stat(REPORT, &second), 0);
    assert_int_equal(first.st_ino, second.st_ino);
    unlink(REPORT);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_report("Written: 2026-11-21 12:00:00 (UTC)\r\n");
    end(daemon);
}

/* ---- only what changed ---- */

static void only_when_it_changed(void **state)
{
    struct stat first, second;

    (void)state;
    put("volume/odid.conf", GOOD);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_int_equal(CALL("set", "wifi.channel", "3"), 0);
    assert_int_equal(stat(REPORT, &first), 0);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_non_null(strstr(got(CONF), "channel = 3"));
    assert_int_equal(stat(REPORT, &second), 0);
    assert_int_equal(first.st_ino, second.st_ino); /* flash wears */
    put("volume/odid.conf", GOOD "; changed\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(CONF, GOOD "; changed\n");
    /* A /data that was made anew. */
    unlink(CONF);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(CONF, GOOD "; changed\n");
    /* A refused one is refused again, and what it says is not forgotten. */
    put("volume/odid.conf", GOOD "chanel = 1\n");
    assert_int_equal(CALL("import", "volume"), 1);
    assert_int_equal(CALL("import", "volume"), 1);
    expect_report("did you mean channel?");
    expect_file(CONF, GOOD "; changed\n");
}

/* It counted as taken over for ever, and so the report said. */
static void what_was_damaged_is_taken_over_again(void **state)
{
    static const struct {
        const char *text;
        size_t length;
    } damaged[] = {{BYTES("")}, {BYTES("\0\0\0\0")}, {BYTES("[wifi]\nchan\0\0\0")}};

    (void)state;
    put("volume/odid.conf", GOOD);
    put("volume/authorized_keys", KEY "anna\n");
    assert_int_equal(CALL("import", "volume"), 0);
    for (unsigned i = 0; i < COUNT(damaged); i++) {
        put_bytes(CONF, damaged[i].text, damaged[i].length);
        put_bytes("data/ssh/authorized_keys", damaged[i].text, damaged[i].length);
        assert_int_equal(CALL("import", "volume"), 0);
        expect_file(CONF, GOOD);
        expect_file("data/ssh/authorized_keys", KEY "anna\n");
    }
    /* Nor is one that can't be read. */
    unlink(CONF);
    assert_int_equal(mkdir(CONF, 0755), 0);
    assert_int_equal(CALL("import", "volume"), 1);
    expect_report("odid.conf can't be kept in");
}

#define LOST "data/odid/settings-lost"

/* Another identity was on the air, and prevent_downgrade gone: CONFIG's counted, and nobody said
 * so. */
static void what_was_set_and_is_damaged_is_lost(void **state)
{
    static const struct {
        const char *file, *text;
        size_t length;
        bool lost;
    } cases[] = {
        {CONF, BYTES("\0\0\0\0"), true},
        {CONF, BYTES("\xFF\xFF\xFF\xFF"), true}, /* erased flash; it had been sound */
        {CONF, BYTES("[wifi]\nchannel = 3\n\xFF\xFF"), true},
        {CONF ".imported", BYTES("\0\0\0\0"), true},
        {CONF ".imported", BYTES(""), true},
        {CONF ".imported", BYTES("0123456789abcdef"), true},    /* cut short */
        {CONF ".imported", BYTES("0123456789abcdef\n"), false}, /* CONFIG was changed */
        {CONF ".imported", NULL, 0, true}, /* a check of the disk had cleared its inode */
        {CONF ".imported", BYTES("0000000000000000\n"), false}, /* the image's conf was there */
        {CONF, BYTES("[wifi]\n"), false},
    };

    (void)state;
    for (unsigned i = 0; i < COUNT(cases); i++) {
        bench_clear(NULL);
        put("volume/odid.conf", GOOD);
        assert_int_equal(CALL("import", "volume"), 0);
        assert_int_equal(CALL("set", "wifi.channel", "3"), 0);
        assert_int_equal(access(LOST, F_OK), -1);
        if (cases[i].text == NULL) {
            assert_int_equal(unlink(cases[i].file), 0);
        } else {
            put_bytes(cases[i].file, cases[i].text, cases[i].length);
        }
        assert_int_equal(CALL("import", "volume"), 0);
        assert_int_equal(access(LOST, F_OK), cases[i].lost ? 0 : -1);
        if (cases[i].lost) {
            expect_file(CONF, GOOD);
            expect_report("what was set in /data is damaged, and lost: this file counts again");
        }
        /* It stays until somebody saves some. */
        assert_int_equal(CALL("import", "volume"), 0);
        assert_int_equal(access(LOST, F_OK), cases[i].lost ? 0 : -1);
        assert_int_equal(CALL("set", "wifi.channel", "6"), 0);
        assert_int_equal(access(LOST, F_OK), -1);
    }
}

/* ---- secrets ---- */

static void the_secret_part_is_not_kept(void **state)
{
    (void)state;
    put("volume/odid.conf", "; FIN87astrdge12k8-xyz\n[operator]\noperator_id = "
                            "\"FIN87astrdge12k8-xyz\" ; FIN87astrdge12k8-xyz\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(CONF, "; FIN87astrdge12k8\n[operator]\noperator_id = \"FIN87astrdge12k8\" ; "
                      "FIN87astrdge12k8\n");
    expect_report("check character right; the secret part is not kept");
    assert_null(strstr(got(REPORT), "xyz"));
    assert_null(strstr(said, "xyz"));
    put("volume/odid.conf", "[operator]\noperator_id = FIN87astrdge12k8-xyy\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_report("does not fit the others: one of them is mistyped");
    assert_null(strstr(got(REPORT), "xyy"));
}

static void the_password_is_consumed(void **state)
{
    static const char after[] = "[maintenance]\r\n; password: taken over  \r\nat_boot = yes\r\n";

    (void)state;
    put("data/secrets/wifi_ssid", "IEEE\n");
    put("volume/odid.conf", "[maintenance]\r\npassword = \"password\" ;x\r\nat_boot = yes\r\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("volume/odid.conf", after);
    expect_file(CONF, after);
    expect_file("data/secrets/maintenance.psk",
                "f42c6fc52df0ebef9ebb4b90b38a5f902e83fe1b135a70e23aed762e9710a12e\nIEEE\n");
    expect_report("  Maintenance password  set\r\n");
    expect_report("  warning: [maintenance] password has 8 characters: ");
    /* What is left on the volume is not imported again, and keeps the key. */
    assert_int_equal(CALL("set", "wifi.channel", "3"), 0);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_non_null(strstr(got(CONF), "channel = 3"));
    assert_int_equal(CALL("get", "maintenance.password"), 0);
    assert_string_equal(said, "set\n");
    assert_int_equal(system("grep -rq '\"password\"' data volume run/faults"), 256);
}

/* It was in neither place when power was switched off before /data was mended. */
static void a_password_that_is_in_memory_only_stays_on_the_volume(void **state)
{
    static const char given[] = "[maintenance]\npassword = password\n";

    (void)state;
    shell("mkdir -p run/odid-appliance && touch run/odid-appliance/data-in-memory");
    put("volume/odid.conf", given);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("volume/odid.conf", given);
    expect_report("the password stays in this file until it can be kept");
    assert_int_equal(CALL("get", "maintenance.password"), 0);
    assert_string_equal(said, "set\n");
    shell("rm -r run/odid-appliance/data-in-memory data/secrets"); /* the disk of before */
    assert_int_equal(CALL("import", "volume"), 0);
    assert_null(strstr(got("volume/odid.conf"), "= password"));
    assert_int_equal(CALL("get", "maintenance.password"), 0);
    assert_string_equal(said, "set\n");
}

/* The board's own, as long as nobody gives one: the volume shows it, and the access point takes it.
 */
static void a_password_is_made_and_shown(void **state)
{
    char first[512], key[128], made[32];

    (void)state;
    put("data/secrets/wifi_ssid", "RemoteID-12AB\n");
    assert_int_equal(CALL("import", "volume"), 0);
    snprintf(first, sizeof(first), "%.500s", got(MADE));
    snprintf(key, sizeof(key), "%.100s", got("data/secrets/maintenance.psk"));
    assert_string_equal(key + 64, "\nRemoteID-12AB\n");
    assert_non_null(strstr(first, "access point RemoteID-12AB in maintenance:\r\n"));
    snprintf(made, sizeof(made), "    %.14s\r\n", got("data/secrets/maintenance.made"));
    assert_non_null(strstr(first, made));

    /* The same at the next power-on, also when the volume lost it. */
    unlink(MADE);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(MADE, first);
    expect_file("data/secrets/maintenance.psk", key);

    /* Also where a failing disk has left no key: nobody could get in by what the volume shows. */
    put("data/secrets/maintenance.psk", "00112233445566778899aabbccddeeff00112233445566778899aabb\1"
                                        "\2 a failing disk's\nRemoteID-12AB\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file(MADE, first);
    expect_file("data/secrets/maintenance.psk", key);

    /* Until there is another one, and then nothing shows a password that isn't the one. */
    assert_int_equal(CALL("set", "maintenance.password", "password"), 0);
    assert_int_equal(CALL("import", "volume"), 0);
    expect_none(MADE);
    expect_report("  Maintenance password  set\r\n");
    assert_int_equal(CALL("set", "maintenance.password", ""), 0);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_true(strcmp(got(MADE), first) != 0);
}

/* Power failed between the password and its key. */
static void a_made_password_without_key_gets_it(void **state)
{
    (void)state;
    put("data/secrets/wifi_ssid", "IEEE\n");
    put("data/secrets/maintenance.made", "abcd-efgh-jkmn\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("data/secrets/maintenance.psk",
                "9572061122096ab642e57dc31a1fa49d2cfa4f3180c1b1ed0055689a40039da5\nIEEE\n");
    assert_non_null(strstr(got(MADE), "    abcd-efgh-jkmn\r\n"));
}

/* As the volume shows it. */
static const char *made_password(void)
{
    char *at = strstr(got(MADE), ":\r\n\r\n    ");

    assert_non_null(at);
    at += strlen(":\r\n\r\n    ");
    at[strcspn(at, "\r")] = '\0';
    return at;
}

/* The only copy that anybody could read went from the volume, its key stayed in force, and the
 * report said that a password was set; or it showed octets that nobody can type. */
static void a_made_password_of_worn_flash_is_made_anew(void **state)
{
    static const struct {
        const char *text;
        size_t length;
    } worn[] = {
        {BYTES("")},
        {BYTES("\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0")},
        {BYTES("\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\n")},
        {BYTES("abcd-efgh-\xFF\xFF\xFF\xFF\n")},
    };

    (void)state;
    for (unsigned i = 0; i < 2 * COUNT(worn); i++) {
        const char *at;

        bench_clear(NULL);
        assert_int_equal(CALL("import", "volume"), 0);
        put_bytes("data/secrets/maintenance.made", worn[i / 2].text, worn[i / 2].length);
        if (i % 2 != 0) {
            put_bytes("data/secrets/maintenance.psk", worn[i / 2].text, worn[i / 2].length);
        }
        assert_int_equal(CALL("import", "volume"), 0);
        at = made_password();
        assert_int_equal(strlen(at), 14);
        assert_int_equal(strspn(at, "abcdefghjkmnpqrstuvwxyz23456789-"), 14);
        assert_int_equal(password_check("data", at), 1);
    }
}

/* The password was shown, and its key in force nowhere. Too long to be read stands for worn out. */
static void a_key_that_cannot_be_read_is_made_anew_of_the_made_password(void **state)
{
    static char worn[100000];

    (void)state;
    assert_int_equal(CALL("import", "volume"), 0);
    memset(worn, '7', sizeof(worn) - 1);
    put("data/secrets/maintenance.psk", worn);
    assert_true(password_check("data", "whatever") < 0);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_int_equal(password_check("data", made_password()), 1);
}

/* They are left on the volume, which any computer reads. */
static void no_password_stays_in_a_file_that_does_not_count(void **state)
{
    static const char *const cut[] = {"volume/odid.conf.cut-short",
                                      "volume/odid.conf.txt.cut-short"};

    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        put(cut[i], "[wifi]\nchannel = 99\n[maintenance]\npassword = secret123\npassword = secr");
    }
    put("volume/odid.conf.txt", "[maintenance]\npassword = secret123\n");
    put("volume/odid.conf",
        "[wifi]\nchannel = 99\n"); /* refused: the other one may be the right one */
    assert_int_equal(CALL("import", "volume"), 1);
    assert_non_null(strstr(got("volume/odid.conf.txt"), "secret123"));
    assert_int_equal(system("grep -q 'secr' volume/*.cut-short"), 256);
    expect_report("note: odid.conf.cut-short had a password, which doesn't count");
    put("volume/odid.conf", BEFORE);
    assert_int_equal(CALL("import", "volume"), 0);
    assert_int_equal(system("grep -rq 'secr' volume data"), 256);
    expect_report("note: odid.conf.txt had a password, which doesn't count: it is blanked there");
}

static void a_refused_file_keeps_its_password(void **state)
{
    (void)state;
    put("data/secrets/maintenance.psk", ANY_KEY "\n");
    put("volume/odid.conf", "[maintenance]\npassword = password\n[wifi]\nchannel = 36\n");
    assert_int_equal(CALL("import", "volume"), 1);
    expect_file("data/secrets/maintenance.psk", ANY_KEY "\n");
    assert_non_null(strstr(got("volume/odid.conf"), "password = password\n"));
}

/* ---- authorized_keys ---- */

static void keys_are_taken_over(void **state)
{
    struct stat file;

    (void)state;
    put("volume/authorized_keys.txt",
        "\xEF\xBB\xBF# mine\r\n" KEY "anna@laptop\r\n\r\n  " KEY "\r\n" KEY "last");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("data/ssh/authorized_keys", "# mine\n" KEY "anna@laptop\n\n" KEY "\n" KEY "last\n");
    assert_int_equal(stat("data/ssh/authorized_keys", &file), 0);
    assert_int_equal(file.st_mode & 0777, 0600);
    assert_int_equal(stat("data/ssh", &file), 0);
    assert_int_equal(file.st_mode & 0777, 0700);
    expect_report("It was taken over: 3 keys may log in.");
    /* Only when it changed. */
    put("data/ssh/authorized_keys", KEY "by hand\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("data/ssh/authorized_keys", KEY "by hand\n");
    /* Nobody could log in with what erased flash has left of them, and the report said that one key
     * may. */
    put_bytes("data/ssh/authorized_keys", BYTES("\xFF\xFF\xFF\xFF"));
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("data/ssh/authorized_keys", "# mine\n" KEY "anna@laptop\n\n" KEY "\n" KEY "last\n");
    put("volume/authorized_keys.txt", "# none\n");
    assert_int_equal(CALL("import", "volume"), 0);
    expect_file("data/ssh/authorized_keys", "");
}

/* 64 KiB of them were 4 MB of report, at each power-on. */
static void of_many_wrong_lines_some_are_told(void **state)
{
    char text[4000] = "";

    (void)state;
    for (unsigned i = 0; i < 500; i++) {
        strcat(text, "hello\n");
    }
    put("volume/authorized_keys.txt", text);
    assert_int_equal(CALL("import", "volume"), 1);
    shell("grep -q 'line 20: ' volume/odid-report.txt");
    shell("! grep -q 'line 21: ' volume/odid-report.txt");
    shell("grep -q 'authorized_keys.txt: and 480 lines more' volume/odid-report.txt");
}

static void wrong_keys_are_refused(void **state)
{
    static const struct {
        const char *text;
        size_t length;
        const char *sentence;
    } cases[] = {
        {BYTES(""), "authorized_keys is empty"},
        {BYTES("\r\n\r\n"), "holds no key; to close SSH"},
        {BYTES("\xFF\xFEs\0s\0h\0"), "is UTF-16 text"},
        {BYTES(KEY "a\nssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIAABAgME a\n"),
         "authorized_keys line 2: the key itself is damaged or cut"},
        {BYTES("ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIAABAgM a\n"), "is no base64"},
        {BYTES("ssh-rsa =\n"), "line 1: the key itself is no base64"},
        {BYTES("ssh-rsa ====\n"), "line 1: the key itself is no base64"},
        {BYTES("ssh-ed25519\n"), "line 1: the key itself is no base64"},
        {BYTES("ssh-rsa AAAAC3NzaC1lZDI1NTE5AAAAIAABAgMEBQYHCAkKCwwNDg8QERITFBUWFxgZGhscHR4f\n"),
         "or is of another type than it says"},
        {BYTES("ssh-dss AAAA\n"), "expected the type of a key first"},
        {BYTES("command=\"sh\" " KEY "\n"), "options before it are not taken"},
        {BYTES("hello\n"), "expected the type of a key first"},
        {BYTES("-----BEGIN OPENSSH PRIVATE KEY-----\nAAAA\n"), "line 1: is a private key"},
        {BYTES("PuTTY-User-Key-File-3: ssh-ed25519\n"), "line 1: is a private key"},
        {BYTES("---- BEGIN SSH2 PUBLIC KEY ----\n"), "is a key in another form"},
        {BYTES(KEY "a\0b\n"), "holds NUL bytes"},
        {BYTES(KEY "a\xFF\n"), "holds octets 0xFF, as erased flash does"},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        bench_clear(NULL);
        shell("mkdir data/ssh");
        put("data/ssh/authorized_keys", KEY "before\n");
        put("volume/odid.conf", GOOD);
        put_bytes("volume/authorized_keys", cases[i].text, cases[i].length);
        if (CALL("import", "volume") != 1) {
            fail_msg("was not refused: %s", cases[i].sentence);
        }
        expect_file("data/ssh/authorized_keys", KEY "before\n");
        expect_report(cases[i].sentence);
        expect_report("NONE OF ITS KEYS WAS TAKEN OVER");
        expect_file(CONF, GOOD); /* one has nothing to do with the other */
    }
}

/* ---- what would be taken over ---- */

/* What a factory reset goes by: it forgot what didn't come back. */
static void what_would_be_taken_over_is_said_and_nothing_is(void **state)
{
    static const struct {
        const char *conf, *keys, *says;
    } cases[] = {
        {GOOD, NULL, "volume: would be taken over\n"},
        {"[wifi]\nchannel = 11\n", KEY "a\n", "volume: would be taken over\n"}, /* of warnings */
        {GOOD, "# none\n", "volume: would be taken over\n"},
        {NULL, KEY "a\n", "volume: not all of it would be taken over: there is no odid.conf"},
        {"[wifi]\nchannel = 99\n", KEY "a\n", "taken over: odid.conf.txt line 2: [wifi] channel"},
        {GOOD, KEY "a\nhello\n", "taken over: authorized_keys line 2: expected the type"},
        {GOOD, "", "taken over: authorized_keys is empty"},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        bool good = strstr(cases[i].says, "not all") == NULL && cases[i].says[0] == 'v';

        bench_clear(NULL);
        if (cases[i].conf != NULL) {
            put("volume/odid.conf.txt", cases[i].conf);
        }
        if (cases[i].keys != NULL) {
            put("volume/authorized_keys", cases[i].keys);
        }
        assert_int_equal(CALL("check", "volume"), good ? 0 : 1);
        if (strstr(said, cases[i].says) == NULL) {
            fail_msg("doesn't say: %s\n%s", cases[i].says, said);
        }
        expect_none(CONF);
        expect_none("data/ssh/authorized_keys");
        expect_none(REPORT);
    }
}

/* It was silent behind fifty sentences: nothing was taken over, and nobody was told. */
static void an_error_behind_many_warnings_is_one(void **state)
{
    char text[4000] = GOOD;

    (void)state;
    for (unsigned i = 0; i < 60; i++) {
        strcat(text, "channel = 11\n");
    }
    strcat(text, "channel = 99\n");
    put("volume/odid.conf", text);
    assert_int_equal(CALL("check", "volume"), 1);
    assert_int_equal(CALL("import", "volume"), 1);
    expect_report("NOTHING OF IT WAS TAKEN OVER");
    assert_int_equal(access("run/faults/config", F_OK), 0);
}

/* ---- volumes that can't be written ---- */

static void in_a_child(void (*what)(void))
{
    pid_t child = fork();
    int status;

    assert_true(child >= 0);
    if (child == 0) {
        if (!own_mounts()) {
            _exit(77);
        }
        what();
        _exit(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77) {
        print_message("skipped: mounting is not allowed here\n");
        skip();
    }
    assert_int_equal(status, 0);
}

#define REQUIRE(condition)                                                                         \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            print_message("line %d: %s\n%s\n", __LINE__, #condition, said);                        \
            _exit(1);                                                                              \
        }                                                                                          \
    } while (0)

static void volume_full(void)
{
    REQUIRE(mount_small_disk("volume", "64k"));
    put("volume/odid.conf", "[maintenance]\npassword = password\n");
    fill_to_the_last_byte("volume/photos");
    REQUIRE(CALL("import", "volume") == 4);
    REQUIRE(strstr(said, "odid-report.txt can't be written on the volume CONFIG: No space") !=
            NULL);
    REQUIRE(strstr(got("run/faults/config"), "No space left") != NULL);
    /* Taken over all the same, and the password is gone: that needs no space. */
    REQUIRE(strcmp(got(CONF), "[maintenance]\n; password: taken o\n") == 0);
    REQUIRE(strcmp(got("volume/odid.conf"), "[maintenance]\n; password: taken o\n") == 0);
    REQUIRE(access("volume/.odid-report.txt.new", F_OK) < 0);
}

static void volume_read_only(void)
{
    REQUIRE(mount_small_disk("volume", "64k"));
    put("volume/odid.conf", "[maintenance]\npassword = password\n");
    REQUIRE(mount("none", "volume", NULL, MS_REMOUNT | MS_RDONLY, NULL) == 0);
    REQUIRE(CALL("import", "volume") == 4);
    REQUIRE(strstr(said, "Read-only file system") != NULL);
    REQUIRE(strcmp(got(CONF), "[maintenance]\n; password: taken o\n") == 0);
    REQUIRE(got("data/secrets/maintenance.psk") != NULL);
    /* What could not be blanked is no reason to import the rest again. */
    REQUIRE(CALL("set", "wifi.channel", "3") == 0);
    REQUIRE(CALL("import", "volume") == 4);
    REQUIRE(strstr(got(CONF), "channel = 3") != NULL);
}

static void data_full(void)
{
    REQUIRE(mount_small_disk("data", "64k"));
    shell("mkdir data/odid data/secrets data/ssh");
    put(CONF, BEFORE);
    fill_to_the_last_byte("data/flights");
    put("volume/odid.conf", "[maintenance]\npassword = password\n");
    put("volume/authorized_keys", KEY "\n");
    REQUIRE(CALL("import", "volume") == 1);
    REQUIRE(strstr(said, "can't be kept in ./data/odid/odid.conf: No space left") != NULL);
    REQUIRE(strstr(got(REPORT), "can't be kept") != NULL);
    REQUIRE(strcmp(got(CONF), BEFORE) == 0);
    REQUIRE(strstr(got("volume/odid.conf"), "password = password\n") != NULL);
    REQUIRE(access("data/ssh/authorized_keys", F_OK) < 0);
    REQUIRE(CALL("set", "wifi.channel", "3") == 1);
    REQUIRE(strstr(said, "No space left on device; nothing was changed") != NULL);
    REQUIRE(strcmp(got(CONF), BEFORE) == 0);
    REQUIRE(access("data/odid/.odid.conf.new", F_OK) < 0);
    /* There is room again. */
    unlink("data/flights");
    REQUIRE(CALL("import", "volume") == 0);
    REQUIRE(strstr(got("volume/odid.conf"), "password = password\n") == NULL);
}

static void a_full_volume(void **state)
{
    (void)state;
    in_a_child(volume_full);
}

static void a_read_only_volume(void **state)
{
    (void)state;
    in_a_child(volume_read_only);
}

static void a_full_data(void **state)
{
    (void)state;
    in_a_child(data_full);
}

#define TEST(function) cmocka_unit_test_setup(function, bench_clear)

/* With the other half of the one that was in force it was one, and refused when it was checked. */
static void half_of_a_place_is_no_place(void **state)
{
    (void)state;
    put("volume/odid.conf", "[system]\noperator_location_type = fixed\noperator_latitude = 57.7\n"
                            "operator_longitude = 11.9\n");
    assert_int_equal(CALL("import", "volume"), 0);
    put("volume/odid.conf", "[system]\noperator_location_type = fixed\noperator_latitude = 57.8\n");
    assert_int_equal(CALL("import", "volume"), 1);
    assert_non_null(strstr(got(REPORT), "one is set without the other"));
    /* Nor does half of the one in force make one of none: it was refused for what it doesn't say.
     */
    put("volume/odid.conf", "[system]\noperator_latitude =\n");
    assert_int_equal(CALL("import", "volume"), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(wrong_files_are_refused),
        TEST(larger_than_anybody_needs),
        TEST(odd_files_are_taken_over),
        TEST(nothing_on_the_volume),
        TEST(two_files),
        TEST(identity_in_the_report),
        TEST(the_date_when_it_is_known),
        TEST(only_when_it_changed),
        TEST(what_was_damaged_is_taken_over_again),
        TEST(what_was_set_and_is_damaged_is_lost),
        TEST(the_secret_part_is_not_kept),
        TEST(the_password_is_consumed),
        TEST(a_password_that_is_in_memory_only_stays_on_the_volume),
        TEST(a_password_is_made_and_shown),
        TEST(a_made_password_without_key_gets_it),
        TEST(a_made_password_of_worn_flash_is_made_anew),
        TEST(a_key_that_cannot_be_read_is_made_anew_of_the_made_password),
        TEST(half_of_a_place_is_no_place),
        TEST(no_password_stays_in_a_file_that_does_not_count),
        TEST(a_refused_file_keeps_its_password),
        TEST(keys_are_taken_over),
        TEST(wrong_keys_are_refused),
        TEST(of_many_wrong_lines_some_are_told),
        TEST(what_would_be_taken_over_is_said_and_nothing_is),
        TEST(an_error_behind_many_warnings_is_one),
        TEST(a_full_volume),
        TEST(a_read_only_volume),
        TEST(a_full_data),
    };

    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
