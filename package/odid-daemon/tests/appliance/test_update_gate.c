/* The service update's socket: what is said to it, and what it answers when. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "simulated_time.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/update_gate.h"
#include "loop_until.h"

static char folder[] = "/tmp/odid-gate-XXXXXX";
static bool known;
static const char *verdict;

static int asker = -1;
static char sentence[UPDATE_SENTENCE_SIZE];

static bool is_known(void)
{
    return known;
}

static void judge(char answer[UPDATE_SENTENCE_SIZE])
{
    snprintf(answer, UPDATE_SENTENCE_SIZE, "%s", verdict);
}

static void cancel(char answer[UPDATE_SENTENCE_SIZE])
{
    snprintf(answer, UPDATE_SENTENCE_SIZE, "called off: %s", verdict);
}

static int begin_all(void **state)
{
    static const struct update_gate_calls calls = {is_known, judge, cancel};

    (void)state;
    return mkdtemp(folder) == NULL || loop_init() < 0 || update_gate_serve(folder, &calls) < 0;
}

static int end_all(void **state)
{
    char path[sizeof(folder) + 32];

    (void)state;
    snprintf(path, sizeof(path), "%s/" UPDATE_GATE_SOCKET, folder);
    unlink(path);
    return rmdir(folder);
}

static int begin(void **state)
{
    (void)state;
    known = true;
    verdict = "";
    return 0;
}

static bool is_answered(void)
{
    return recv(asker, sentence, sizeof(sentence), MSG_DONTWAIT) > 0;
}

static void begin_asking(const char *word)
{
    asker = update_gate_say(folder, word);
    assert_true(asker >= 0);
}

/* The sentence. */
static const char *answer_within(int ms)
{
    assert_true(loop_until(is_answered, ms));
    close(asker);
    return sentence;
}

static void one_word_one_sentence(void **state)
{
    (void)state;
    begin_asking("gate");
    assert_string_equal(answer_within(10), "");
    verdict = "Because.";
    begin_asking("gate");
    assert_string_equal(answer_within(10), "Because.");
    begin_asking("cancel");
    assert_string_equal(answer_within(10), "called off: Because.");
}

/* ---- who waits for the answer, in a thread of its own ---- */

static atomic_bool done;

static void *ask(void *context)
{
    int *result = context;

    *result = update_gate_ask(folder, "gate", sentence);
    done = true;
    return NULL;
}

static bool is_done(void)
{
    usleep(1000); /* the thread's time isn't simulated */
    return done;
}

static void who_asks_has_the_sentence(void **state)
{
    pthread_t thread;
    int result = -1;

    (void)state;
    verdict = "Because.";
    assert_int_equal(pthread_create(&thread, NULL, ask, &result), 0);
    assert_true(loop_until(is_done, PATIENCE_MS));
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_int_equal(result, 0);
    assert_string_equal(sentence, "Because.");
}

/* ---- when it isn't known yet ---- */

/* SWUpdate's word that it has begun comes by another way. */
static void the_answer_waits_until_it_is_known_what_is_asked(void **state)
{
    (void)state;
    known = false;
    begin_asking("gate");
    run_ms(400);
    assert_false(is_answered());
    known = true;
    assert_string_equal(answer_within(100), "");
}

static void and_no_longer_than_five_seconds(void **state)
{
    (void)state;
    known = false;
    begin_asking("gate");
    run_ms(4900);
    assert_false(is_answered());
    assert_non_null(strstr(answer_within(200), "didn't say that it has begun"));
}

static void whoever_says_nothing_or_nonsense_takes_no_place(void **state)
{
    int fds[20];

    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        fds[i] =
            update_gate_say(folder, i % 2 == 0 ? "something else" : "a word that is far too long");
        assert_true(fds[i] >= 0);
        run_ms(10);
    }
    begin_asking("gate");
    assert_string_equal(answer_within(10), "");
    for (unsigned i = 0; i < 20; i++) {
        close(fds[i]);
    }
}

static void it_is_roots(void **state)
{
    char path[sizeof(folder) + 32];
    struct stat file;

    (void)state;
    snprintf(path, sizeof(path), "%s/" UPDATE_GATE_SOCKET, folder);
    assert_int_equal(stat(path, &file), 0);
    assert_int_equal(file.st_mode & 0777, 0600);
}

static void nobody_there_is_an_error(void **state)
{
    (void)state;
    assert_int_equal(update_gate_ask("/tmp", "gate", sentence), -ENOENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_word_one_sentence, begin),
        cmocka_unit_test_setup(who_asks_has_the_sentence, begin),
        cmocka_unit_test_setup(the_answer_waits_until_it_is_known_what_is_asked, begin),
        cmocka_unit_test_setup(and_no_longer_than_five_seconds, begin),
        cmocka_unit_test_setup(whoever_says_nothing_or_nonsense_takes_no_place, begin),
        cmocka_unit_test_setup(it_is_roots, begin),
        cmocka_unit_test_setup(nobody_there_is_an_error, begin),
    };

    return cmocka_run_group_tests(tests, begin_all, end_all);
}
