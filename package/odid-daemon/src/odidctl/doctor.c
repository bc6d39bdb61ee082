/* What the doctor's probes look with, and how they say what they found. */
#include "odidctl/doctor.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/utf8.h"
#include "base/whole_file.h"

#define FILE_MAX 65536
#define NAMES_MAX 1000

__attribute__((format(printf, 3, 0))) static void fill_path(const struct doctor *doctor,
                                                            char path[DOCTOR_PATH_SIZE],
                                                            const char *format, va_list arguments)
{
    int length = snprintf(path, DOCTOR_PATH_SIZE, "%.200s", doctor->root);

    vsnprintf(path + length, (size_t)(DOCTOR_PATH_SIZE - length), format, arguments);
}

const char *doctor_path(const struct doctor *doctor, char path[DOCTOR_PATH_SIZE],
                        const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    fill_path(doctor, path, format, arguments);
    va_end(arguments);
    return path;
}

bool doctor_exists(const struct doctor *doctor, const char *format, ...)
{
    char path[DOCTOR_PATH_SIZE];
    struct stat file;
    va_list arguments;

    va_start(arguments, format);
    fill_path(doctor, path, format, arguments);
    va_end(arguments);
    return lstat(path, &file) == 0;
}

/* Anything else could hold up whoever opens it. */
static bool is_regular(const char *path)
{
    struct stat file;

    return stat(path, &file) == 0 && S_ISREG(file.st_mode);
}

void doctor_line(const struct doctor *doctor, char line[DOCTOR_LINE_SIZE], const char *format, ...)
{
    char path[DOCTOR_PATH_SIZE];
    va_list arguments;

    va_start(arguments, format);
    fill_path(doctor, path, format, arguments);
    va_end(arguments);
    line[0] = '\0';
    if (is_regular(path)) {
        whole_file_line(path, line, DOCTOR_LINE_SIZE);
    }
}

static char *trim(char *line)
{
    size_t length;

    line += strspn(line, " \t");
    length = strlen(line);
    while (length > 0 && strchr(" \t\r", line[length - 1]) != NULL) {
        line[--length] = '\0';
    }
    return line;
}

void doctor_lines(const struct doctor *doctor, const char *path, doctor_line_fn *take,
                  void *context)
{
    char below[DOCTOR_PATH_SIZE], *text = NULL, *rest, *line;
    unsigned number = 0;
    size_t length;

    if (is_regular(doctor_path(doctor, below, "%s", path))) {
        text = whole_file_read(below, FILE_MAX, &length);
    }
    rest = text;
    while ((line = strsep(&rest, "\n")) != NULL && take(context, trim(line), ++number)) {
    }
    free(text);
}

struct beginning {
    const char *begin;
    unsigned found;
};

static bool take_beginning(void *context, const char *line, unsigned number)
{
    struct beginning *beginning = context;

    if (strncmp(line, beginning->begin, strlen(beginning->begin)) == 0) {
        beginning->found = number;
    }
    return beginning->found == 0;
}

unsigned doctor_line_beginning(const struct doctor *doctor, const char *path, const char *begin)
{
    struct beginning beginning = {.begin = begin};

    doctor_lines(doctor, path, take_beginning, &beginning);
    return beginning.found;
}

static int is_visible(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

void doctor_names(const struct doctor *doctor, const char *folder, doctor_name_fn *take,
                  void *context)
{
    char path[DOCTOR_PATH_SIZE];
    struct dirent **entries = NULL;
    int count = scandir(doctor_path(doctor, path, "%s", folder), &entries, is_visible, alphasort);
    bool on = true;

    for (int i = 0; i < count; i++) {
        on = on && i < NAMES_MAX && take(context, entries[i]->d_name);
        free(entries[i]);
    }
    free(entries);
}

const struct doctor_process *doctor_process(const struct doctor *doctor, const char *name)
{
    for (size_t i = 0; i < doctor->count; i++) {
        if (strncmp(doctor->processes[i].name, name, sizeof(doctor->processes[i].name) - 1) == 0) {
            return &doctor->processes[i];
        }
    }
    return NULL;
}

const char *doctor_unit(const struct doctor *doctor, const char *unit)
{
    static const char *const folders[] = {"/etc/systemd/system", "/run/systemd/system",
                                          "/usr/local/lib/systemd/system",
                                          "/usr/lib/systemd/system", "/lib/systemd/system"};
    static char path[DOCTOR_PATH_SIZE];

    for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]); i++) {
        if (doctor_exists(doctor, "%s/%s", folders[i], unit)) {
            snprintf(path, sizeof(path), "%s/%s", folders[i], unit);
            return path;
        }
    }
    return NULL;
}

void doctor_tell(struct doctor *doctor, const char *where, unsigned line, const char *remedy,
                 const char *format, ...)
{
    char sentence[1024], shown[1024];
    va_list arguments;

    /* Names and words of other people's, all of it. */
    va_start(arguments, format);
    vsnprintf(sentence, sizeof(sentence), format, arguments);
    va_end(arguments);
    utf8_clean(shown, sizeof(shown), sentence);
    puts(shown);
    utf8_clean(shown, sizeof(shown), remedy);
    printf("    Remedy: %s\n", shown);
    if (where != NULL) {
        utf8_clean(shown, sizeof(shown), where);
        printf("    See:    %s", shown);
        if (line > 0) {
            printf(":%u", line);
        }
        putchar('\n');
    }
    doctor->found++;
}
