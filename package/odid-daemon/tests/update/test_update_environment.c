/* U-Boot's variables in their two copies, of which one or both may be bad. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <libuboot.h>
#include <linux/fs.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include "update/update_environment.h"

#define COPIES 2
#define COPY_SIZE 0x4000

static char folder[] = "/tmp/odid-environment-XXXXXX";
static char config[64], defaults[64], copies[COPIES][64];

static void write_file(const char *path, const void *text, size_t length)
{
    FILE *file = fopen(path, "w");

    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
}

static size_t read_copy(unsigned number, char *out)
{
    FILE *file = fopen(copies[number], "r");
    size_t length;

    assert_non_null(file);
    length = fread(out, 1, COPY_SIZE, file);
    fclose(file);
    return length;
}

/* The volume ENV is a folder, and its files lie in one piece from its hundredth block on: by this
 * program's own calls. */
int mount(const char *source, const char *target, const char *type, unsigned long flags,
          const void *data)
{
    (void)source, (void)target, (void)type, (void)flags, (void)data;
    return 0;
}

int umount(const char *target)
{
    (void)target;
    return 0;
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list rest;
    int *value;

    (void)fd;
    va_start(rest, request);
    value = va_arg(rest, int *);
    va_end(rest);
    *value = request == FIGETBSZ ? 512 : *value + 100;
    return 0;
}

/* Both copies are damaged: there is nothing but zeros in them. */
static int make_folder(void **state)
{
    static const char nothing[COPY_SIZE];
    static const char values[] =
        "slot=a\nupgrade_available=0\ntrial_failed=a\ntrial_reason=three-restarts\n";
    char text[200] = "";

    (void)state;
    if (mkdtemp(folder) == NULL) {
        return -1;
    }
    snprintf(config, sizeof(config), "%s/config", folder);
    snprintf(defaults, sizeof(defaults), "%s/defaults", folder);
    for (unsigned i = 0; i < COPIES; i++) {
        snprintf(copies[i], sizeof(copies[i]), "%s/copy-%u", folder, i);
        write_file(copies[i], nothing, sizeof(nothing));
        snprintf(text + strlen(text), sizeof(text) - strlen(text), "%s 0x0 0x%x\n", copies[i],
                 COPY_SIZE);
    }
    write_file(config, text, strlen(text));
    write_file(defaults, values, strlen(values));
    return 0;
}

static int remove_folder(void **state)
{
    char command[64];

    (void)state;
    snprintf(command, sizeof(command), "rm -r %s", folder);
    return system(command);
}

static void both_damaged_are_made_anew(void **state)
{
    struct update_variables variables;
    bool repaired;

    (void)state;
    assert_int_equal(update_variables_read(config, NULL, 'b', &variables, &repaired), -ENODATA);
    assert_int_equal(update_variables_read(config, defaults, 'b', &variables, &repaired), 0);
    assert_true(repaired);
    assert_int_equal(variables.slot, 'b');
    assert_int_equal(update_variables_read(config, defaults, 'a', &variables, &repaired), 0);
    assert_false(repaired);
    assert_int_equal(variables.slot, 'b');
    assert_int_equal(variables.trial_failed, 'a');
    assert_string_equal(variables.trial_reason, "three-restarts");
}

static void all_are_written_at_once(void **state)
{
    struct update_variables variables = {
        .slot = 'a', .trial = 'b', .unverified = 'b', .upgrade_available = true};
    bool repaired;

    (void)state;
    assert_int_equal(update_variables_write(config, &variables, UPDATE_REPORT_NOTHING), 0);
    assert_int_equal(update_variables_write(config, &variables, UPDATE_REPORT_NOTHING), 0);
    assert_int_equal(update_variables_read(config, defaults, 'a', &variables, &repaired), 0);
    assert_false(repaired);
    assert_int_equal(variables.slot, 'a');
    assert_int_equal(variables.trial, 'b');
    assert_true(variables.upgrade_available);
    assert_int_equal(variables.trial_failed, '\0');
    assert_string_equal(variables.trial_reason, "");
    assert_int_equal(variables.unverified, 'b');
    variables.unverified = '\0';
    assert_int_equal(update_variables_write(config, &variables, UPDATE_REPORT_NOTHING), 0);
    assert_int_equal(update_variables_read(config, defaults, 'a', &variables, &repaired), 0);
    assert_int_equal(variables.unverified, '\0');
}

/* Made anew, a trial's variables would be gone, and the slot on trial be the committed one. */
static void one_that_cant_be_read_is_no_reason_to_write(void **state)
{
    static char kept[COPIES][COPY_SIZE], now[COPY_SIZE];
    struct update_variables variables;
    bool repaired;

    (void)state;
    for (unsigned i = 0; i < COPIES; i++) {
        assert_int_equal(read_copy(i, kept[i]), COPY_SIZE);
    }
    for (unsigned i = 0; i < COPIES; i++) {
        assert_int_equal(truncate(copies[i], 100), 0);
        assert_true(update_variables_read(config, defaults, 'b', &variables, &repaired) < 0);
        assert_false(repaired);
        assert_int_equal(read_copy(i, now), 100);
        assert_int_equal(read_copy(1 - i, now), COPY_SIZE);
        assert_memory_equal(now, kept[1 - i], COPY_SIZE);
        write_file(copies[i], kept[i], COPY_SIZE);
    }
    assert_int_equal(update_variables_read(config, defaults, 'b', &variables, &repaired), 0);
    assert_int_equal(variables.trial, 'b');
}

static struct uboot_ctx *open_it(void)
{
    struct uboot_ctx *context;

    assert_int_equal(libuboot_initialize(&context, NULL), 0);
    assert_int_equal(libuboot_read_config(context, config), 0);
    assert_int_equal(libuboot_open(context), 0);
    return context;
}

static void close_it(struct uboot_ctx *context)
{
    libuboot_close(context);
    libuboot_exit(context);
}

/* ustate, as the client finds it after a write that says nothing of it. */
static char left_of(const char *state, bool trial_to_come)
{
    struct update_variables variables = {.slot = 'a', .upgrade_available = trial_to_come};
    struct uboot_ctx *context = open_it();
    char *value, left;

    assert_int_equal(libuboot_set_env(context, "ustate", state), 0);
    assert_int_equal(libuboot_env_store(context), 0);
    close_it(context);
    assert_int_equal(update_variables_write(config, &variables, UPDATE_REPORT_AS_IT_IS), 0);
    context = open_it();
    value = libuboot_get_env(context, "ustate");
    left = value == NULL ? '\0' : value[0];
    free(value);
    close_it(context);
    return left;
}

/* The client answered no cancel and took no update for ever: its trial was to come. */
static void a_trial_that_is_over_is_not_to_come(void **state)
{
    (void)state;
    assert_int_equal(left_of("1", false), UPDATE_REPORT_NOTHING);
    assert_int_equal(left_of("1", true), '1');
    assert_int_equal(left_of("2", false), UPDATE_REPORT_GOOD); /* nobody has told its server yet */
    assert_int_equal(left_of("3", false), UPDATE_REPORT_FAILED);
    assert_int_equal(left_of(NULL, false), '\0');
}

/* libubootenv's other form, YAML, has namespaces: by one of them whoever may speak to SWUpdate
 * could set any variable, and so choose the slot. */
static void its_place_is_said_in_the_form_without_namespaces(void **state)
{
    static const char expected[] = "/dev/odid 0xc800 0x4000\n/dev/odid 0xc800 0x4000\n";
    char volume[64], found[64], path[128], problem[200] = "", text[200] = "";
    FILE *file;

    (void)state;
    snprintf(volume, sizeof(volume), "%s/volume", folder);
    snprintf(found, sizeof(found), "%s/found", folder);
    assert_int_equal(mkdir(volume, 0700), 0);
    for (unsigned i = 0; i < COPIES; i++) {
        static const char nothing[COPY_SIZE];

        snprintf(path, sizeof(path), "%s/uboot%s.env", volume, i == 0 ? "" : "-redund");
        write_file(path, nothing, sizeof(nothing));
    }
    assert_true(update_environment_find("/dev/odid", volume, found, problem, sizeof(problem)));
    file = fopen(found, "r");
    assert_non_null(file);
    assert_int_equal(fread(text, 1, sizeof(text) - 1, file), strlen(expected));
    fclose(file);
    assert_string_equal(text, expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_damaged_are_made_anew),
        cmocka_unit_test(all_are_written_at_once),
        cmocka_unit_test(its_place_is_said_in_the_form_without_namespaces),
        cmocka_unit_test(one_that_cant_be_read_is_no_reason_to_write),
        cmocka_unit_test(a_trial_that_is_over_is_not_to_come),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
