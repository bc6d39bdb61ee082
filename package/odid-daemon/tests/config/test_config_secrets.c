/* The secret part of an operator number leaves the parser in no way. */
#include "config_helper.h"

#include <sys/wait.h>

/* ---- the secret ---- */

/* The texts are kept scrambled, so that the test itself isn't what is found. */
#define SCRAMBLE 0x15

static void unscramble(char *out, const char *scrambled)
{
    size_t i = 0;

    for (; scrambled[i] != '\0'; i++) {
        out[i] = (char)(scrambled[i] ^ SCRAMBLE);
    }
    out[i] = '\0';
}

__attribute__((no_sanitize("address", "undefined"))) static unsigned
occurrences(const char *from, const char *to, const char *scrambled, size_t length)
{
    unsigned found = 0;

    for (const volatile char *at = from; at + length <= (const volatile char *)to; at++) {
        size_t i = 0;

        while (i < length && (at[i] ^ SCRAMBLE) == scrambled[i]) {
            i++;
        }
        found += i == length;
    }
    return found;
}

/* How often it stands anywhere in our memory, sanitizers' shadow left out. */
static unsigned in_memory(const char *scrambled, size_t length)
{
    FILE *maps = fopen("/proc/self/maps", "re");
    unsigned found = 0;
    char line[512];

    assert_non_null(maps);
    while (fgets(line, sizeof(line), maps) != NULL) {
        unsigned long from, to;
        char rights[5];

        if (sscanf(line, "%lx-%lx %4s", &from, &to, rights) == 3 && rights[0] == 'r' &&
            rights[1] == 'w' && to - from < (1UL << 28)) {
            found += occurrences((const char *)from, (const char *)to, scrambled, length);
        }
    }
    fclose(maps);
    return found;
}

/* "[operator]\noperator_id = FIN87astrdge12k8-" is public; what follows is written here only. */
static const char scrambled_secret[] = {'k' ^ SCRAMBLE,
                                        '7' ^ SCRAMBLE,
                                        'q' ^ SCRAMBLE,
                                        'w' ^ SCRAMBLE,
                                        '0' ^ SCRAMBLE,
                                        'v' ^ SCRAMBLE,
                                        'z' ^ SCRAMBLE,
                                        '3' ^ SCRAMBLE,
                                        'j' ^ SCRAMBLE,
                                        'p' ^ SCRAMBLE,
                                        '9' ^ SCRAMBLE,
                                        'm' ^ SCRAMBLE,
                                        '\0'};

/* In a process of its own: what our memory holds then can only come from the parser. */
static void in_child(void (*call)(const char *), const char *argument)
{
    pid_t child = fork();
    int status;

    assert_true(child >= 0);
    if (child == 0) {
        call(argument);
        _exit(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

/* The star in the pattern becomes the secret. */
static void write_secret_file(const char *pattern)
{
    size_t before = strcspn(pattern, "*");
    char text[256], secret[16];
    int length;

    unscramble(secret, scrambled_secret);
    length = snprintf(text, sizeof(text), "%.*s%s%s", (int)before, pattern, secret,
                      pattern + before + 1);
    write_file("odid.conf", text, (size_t)length);
}

/* The search finds what is there. */
static void find_a_copy(const char *scrambled)
{
    char copy[16];

    unscramble(copy, scrambled);
    if (in_memory(scrambled, 12) == 0) {
        _exit(1);
    }
    explicit_bzero(copy, sizeof(copy));
}

/* So far down the stack that the search itself doesn't overwrite what may be left there. */
__attribute__((noinline)) static void read_far_down(const char *name)
{
    volatile char distance[65536];

    distance[0] = distance[sizeof(distance) - 1] = 0;
    read_file(name);
    distance[0] = distance[sizeof(distance) - 1] = 0;
}

static void no_secret_stays(void **state)
{
    static const char *const files[] = {
        "[operator]\noperator_id = FIN87astrdge12k8-*\n",
        "[operator]\noperator_id = \"FIN87astrdge12k8-*\" ; twice: FIN87astrdge12k8-x\n",
        "# FIN87astrdge12k8-*\n[basic_id]\nuas_id = A\n",
        "[basic_id]\nuas_id = FIN87astrdge12k8-*\n",
        "[self_id]\ndescription = op FIN87astrdge12k8-*\n",
        "[mavlink]\nsource = FIN87astrdge12k8-*\n",
        "[mavlink]\noperator_id = FIN87astrdge12k8-*\n",
        "[wrong]\noperator_id = FIN87astrdge12k8-*\n",
        "[FIN87astrdge12k8-*]\n",
        "[mavlink]\nFIN87astrdge12k8-* = 1\n",
        "FIN87astrdge12k8-*",
        "[operator]\noperator_id = \"FIN87astrdge12k8-*",
        "[operator]\noperator_id = FIN87astrdge12k8*\n",
        "[operator]\noperator_id = FIN87astrdge12k8\xE2\x80\x93*\n",
    };

    (void)state;
    for (size_t i = 0; i < COUNT(files); i++) {
        in_child(write_secret_file, files[i]);
        read_far_down("odid.conf");
        assert_int_equal(in_memory(scrambled_secret, 12), 0);
        assert_int_equal(in_memory(scrambled_secret, 6), 0);
        assert_int_equal(in_memory(scrambled_secret + 6, 6), 0);
    }
    in_child(find_a_copy, scrambled_secret);
}

static void secrets_in_wrong_places_are_left_out(void **state)
{
    (void)state;
    expect("[basic_id]\nuas_id = FIN87astrdge12k8-xyz\n",
           "error: odid.conf line 2: uas_id holds an operator number; its secret part is left "
           "out\n");
    assert_string_equal(config.basic_id[0].uas_id, "FIN87astrdge12k8");
    expect("[self_id]\ndescription = FIN87astrdge12k8-xyz\n",
           "error: odid.conf line 2: description holds an operator number; its secret part is left "
           "out\n");
    assert_string_equal(config.description, "FIN87astrdge12k8");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_secret_stays),
        cmocka_unit_test(secrets_in_wrong_places_are_left_out),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
