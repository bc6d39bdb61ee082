/* Descriptions, bundles and folders of them: those that are right, and those made to deceive. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "appliance/update_bundle.h"

#define GOOD                                                                                       \
    "software =\n{\n\tversion = \"1.10.0\";\n\tdescription = \"Remote ID appliance\";\n"           \
    "\thardware-compatibility: [ \"odid-cm4\" ];\n\tslot-octets = \"8388608\";\n\n\tstable: {\n"   \
    "\t\tslot-a: {\n\t\t\timages: ( {\n\t\t\t\tfilename = \"slot.img\";\n\t\t\t} "                 \
    ");\n\t\t};\n\t};\n}\n"

static char folder[] = "/tmp/odid-bundles-XXXXXX";

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL;
}

static int remove_folder(void **state)
{
    char command[sizeof(folder) + 8];

    (void)state;
    snprintf(command, sizeof(command), "rm -r %s", folder);
    return system(command);
}

static int parse(const char *text)
{
    struct update_bundle bundle;

    return update_bundle_parse(text, strlen(text), &bundle);
}

/* ---- descriptions ---- */

static void what_our_own_tool_writes_is_understood(void **state)
{
    struct update_bundle bundle;

    (void)state;
    assert_int_equal(update_bundle_parse(GOOD, strlen(GOOD), &bundle), 0);
    assert_string_equal(bundle.version, "1.10.0");
    assert_string_equal(bundle.hardware, "odid-cm4");
    assert_true(bundle.slot_octets == 8388608);
}

static void each_key_once_and_each_value_plain(void **state)
{
    static const char rest[] = "hardware-compatibility: [ \"odid-cm4\" ];\nslot-octets = \"1\";\n";
    static const char *const wrong[] = {
        "",
        "version = \"1.0\";\nversion = \"2.0\";\n",
        "version = \"\";\n",
        "version = \"1.0;\n",
        "version = \"1.0\"\n",
        "version = \"1 0\";\n",
        "version = \"1.0\"; version = \"2.0\";\n",
        "version = \"\033[2J\";\n",
        "version = \"1/../2\";\n",
        "version : \"1.0\";\n",
        "version = \"1.0\" \"0\";\n",
        "version = "
        "\"1234567890123456789012345678901234567890123456789012345678901234567890\";\n",
    };

    (void)state;
    for (unsigned i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        char text[400];

        snprintf(text, sizeof(text), "%s%s", wrong[i], rest);
        if (parse(text) != -EBADMSG) {
            fail_msg("taken: %s", text);
        }
    }
    assert_int_equal(parse("version = \"1.0\";\nhardware-compatibility: [ \"odid-cm4\" ];\n"
                           "slot-octets = \"99999999999999999999\";\n"),
                     -EBADMSG);
    assert_int_equal(parse("version = \"1.0\";\nslot-octets = \"1\";\n"
                           "hardware-compatibility: [ \"odid-cm4\", \"odid-qemu\" ];\n"),
                     -EBADMSG);
    assert_int_equal(update_bundle_parse("version = \"1.0\0\";", 17, &(struct update_bundle){0}),
                     -EBADMSG);
}

static void by_numbers_not_by_letters(void **state)
{
    (void)state;
    assert_true(update_version_compare("1.9.0", "1.10.0") < 0);
    assert_true(update_version_compare("1.10.0", "1.9.9") > 0);
    assert_true(update_version_compare("1.10.0", "1.10.0") == 0);
}

/* ---- bundles ---- */

/* A bundle's head, by hand: name with everything that is to stand in its place. */
static void write_bundle(const char *file, const char *magic, const char *name, size_t name_size,
                         const char *text, unsigned text_size)
{
    char path[300], padding[4] = "";
    FILE *out;

    snprintf(path, sizeof(path), "%s/%s", folder, file);
    out = fopen(path, "w");
    assert_non_null(out);
    fprintf(out, "%s%08X%08X%08X%08X%08X%08X%08X%08X%08X%08X%08X%08X%08X", magic, 1, 0100644, 0, 0,
            1, 0, text_size, 0, 0, 0, 0, (unsigned)name_size, 0);
    fwrite(name, 1, name_size, out);
    fwrite(padding, 1, (4 - (110 + name_size) % 4) % 4, out);
    fwrite(text, 1, strlen(text), out);
    fclose(out);
}

static int read_bundle(const char *file, struct update_bundle *bundle)
{
    char path[300];
    int fd, result;

    snprintf(path, sizeof(path), "%s/%s", folder, file);
    fd = open(path, O_RDONLY);
    assert_true(fd >= 0);
    result = update_bundle_read(fd, bundle);
    close(fd);
    return result;
}

static void both_kinds_of_archive_are_read(void **state)
{
    struct update_bundle bundle;

    (void)state;
    write_bundle("a", "070702", "sw-description", 15, GOOD, strlen(GOOD));
    assert_int_equal(read_bundle("a", &bundle), 0);
    assert_string_equal(bundle.version, "1.10.0");
    write_bundle("a", "070701", "sw-description", 15, GOOD, strlen(GOOD));
    assert_int_equal(read_bundle("a", &bundle), 0);
}

/* Text behind the NUL of the name announced a false version: an old bundle was installed. */
static void nothing_hides_behind_the_name(void **state)
{
    static const char name[] = "sw-description\0\n\tversion = \"99.0\";\n";
    struct update_bundle bundle;

    (void)state;
    write_bundle("b", "070702", name, sizeof(name), GOOD, strlen(GOOD));
    assert_int_equal(read_bundle("b", &bundle), -EBADMSG);
}

static void what_is_no_bundle_is_refused(void **state)
{
    struct update_bundle bundle;

    (void)state;
    write_bundle("c", "070707", "sw-description", 15, GOOD, strlen(GOOD));
    assert_int_equal(read_bundle("c", &bundle), -EBADMSG);
    write_bundle("c", "070702", "sw-descriptioN", 15, GOOD, strlen(GOOD));
    assert_int_equal(read_bundle("c", &bundle), -EBADMSG);
    write_bundle("c", "070702", "sw-description", 15, GOOD, strlen(GOOD) + 1); /* cut short */
    assert_int_equal(read_bundle("c", &bundle), -EBADMSG);
    write_bundle("c", "070702", "sw-description", 15, GOOD, UPDATE_DESCRIPTION_MAX + 1);
    assert_int_equal(read_bundle("c", &bundle), -EBADMSG);
    write_bundle("c", "070702", "sw-description", 15, GOOD, 0xFFFFFFFF);
    assert_int_equal(read_bundle("c", &bundle), -EBADMSG);
}

/* ---- folders ---- */

static void write_version(const char *file, const char *version, const char *hardware)
{
    char text[300];

    snprintf(text, sizeof(text),
             "version = \"%s\";\nhardware-compatibility: [ \"%s\" ];\nslot-octets = \"1\";\n",
             version, hardware);
    write_bundle(file, "070702", "sw-description", 15, text, (unsigned)strlen(text));
}

static void the_newest_for_this_board(void **state)
{
    struct update_bundle bundle;
    char name[NAME_MAX + 1], path[300];

    (void)state;
    assert_int_equal(update_bundle_newest(folder, "odid-cm4", name, &bundle), -ENOENT);
    write_version("old.swu", "1.9.0", "odid-cm4");
    write_version("new.swu", "1.10.0", "odid-cm4");
    write_version("other.swu", "2.0.0", "odid-qemu");
    write_version("no-bundle", "3.0.0", "odid-cm4");
    snprintf(path, sizeof(path), "%s/link.swu", folder);
    assert_int_equal(symlink("/dev/zero", path), 0);
    snprintf(path, sizeof(path), "%s/pipe.swu", folder);
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(update_bundle_newest(folder, "odid-cm4", name, &bundle), 0);
    assert_string_equal(name, "new.swu");
    assert_string_equal(bundle.version, "1.10.0");
    assert_int_equal(update_bundle_newest("/nowhere", "odid-cm4", name, &bundle), -ENOENT);
}

/* 750,000 names exhausted the memory. */
static void a_full_folder_is_not_read_to_its_end(void **state)
{
    struct update_bundle bundle;
    struct timespec before, after;
    char name[NAME_MAX + 1], path[300];

    (void)state;
    for (int i = 0; i < 5000; i++) {
        snprintf(path, sizeof(path), "%s/%d.swu", folder, i);
        assert_int_equal(mknod(path, S_IFREG | 0600, 0), 0);
    }
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &before);
    for (int i = 0; i < 100; i++) {
        update_bundle_newest(folder, "odid-cm4", name, &bundle);
    }
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &after);
    /* All of them would take a hundred times as long. */
    assert_true(after.tv_sec - before.tv_sec < 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_our_own_tool_writes_is_understood),
        cmocka_unit_test(each_key_once_and_each_value_plain),
        cmocka_unit_test(by_numbers_not_by_letters),
        cmocka_unit_test(both_kinds_of_archive_are_read),
        cmocka_unit_test(nothing_hides_behind_the_name),
        cmocka_unit_test(what_is_no_bundle_is_refused),
        cmocka_unit_test(the_newest_for_this_board),
        cmocka_unit_test(a_full_folder_is_not_read_to_its_end),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
