#include "odidctl/odidctl_report.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "appliance/status_fetch.h"
#include "base/whole_file.h"
#include "config/config_keys.h"

#define DATE "Written: "
#define REPORT_MAX 262144

struct odidctl_report {
    FILE *file;
    char *text;
    size_t length;
};

struct odidctl_report *odidctl_report_begin(void)
{
    struct odidctl_report *report = calloc(1, sizeof(*report));

    if (report == NULL) {
        return NULL;
    }
    report->file = open_memstream(&report->text, &report->length);
    if (report->file == NULL) {
        free(report);
        return NULL;
    }
    odidctl_report_line(report, "Remote ID: what was found on this volume at the last start");
    odidctl_report_line(report,
                        "(this text is written by the aircraft; changes in it mean nothing)");
    odidctl_report_line(report, "%s", "");
    return report;
}

void odidctl_report_end(struct odidctl_report *report)
{
    fclose(report->file);
    free(report->text);
    free(report);
}

/* Windows' Notepad shows line ends only with CR. */
void odidctl_report_line(struct odidctl_report *report, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vfprintf(report->file, format, arguments);
    va_end(arguments);
    fputs("\r\n", report->file);
}

/* ---- what is in force ---- */

static void line_of(struct odidctl_report *report, const char *label, const struct config *config,
                    const char *section, const char *name)
{
    char shown[2 * CONFIG_PATH_SIZE];

    config_key_show(config_key_find(section, name), config, shown, sizeof(shown));
    odidctl_report_line(report, "  %-22s%s", label, shown[0] == '\0' ? "none" : shown);
}

static void identity(struct odidctl_report *report, const struct config *config, unsigned index)
{
    const char *section = index == 0 ? "basic_id" : "basic_id_2";
    const struct config_basic_id *id = &config->basic_id[index];

    if (id->uas_id[0] != '\0') {
        odidctl_report_line(report, "  %-22s%s (%s)", index == 0 ? "Aircraft" : "Aircraft, second",
                            id->uas_id, config_code_name(config_id_types, id->id_type));
    } else if (index == 0) {
        odidctl_report_line(report, "  %-22s%s", "Aircraft",
                            "none: unless the autopilot sends one, it has no identity");
    }
    if (id->uas_id[0] != '\0' || index == 0) {
        line_of(report, "Kind of aircraft", config, section, "ua_type");
    }
}

void odidctl_report_in_force(struct odidctl_report *report, const struct config *config,
                             const char *password)
{
    odidctl_report_line(report, "%s", "");
    odidctl_report_line(report, "In force now");
    identity(report, config, 0);
    identity(report, config, 1);
    line_of(report, "Operator number", config, "operator", "operator_id");
    line_of(report, "Description", config, "self_id", "description");
    line_of(report, "Category", config, "system", "category");
    line_of(report, "Class", config, "system", "class");
    line_of(report, "Bluetooth 4", config, "broadcast", "bt4_enabled");
    line_of(report, "Bluetooth 5", config, "broadcast", "bt5_enabled");
    line_of(report, "Wi-Fi", config, "broadcast", "wifi_beacon_enabled");
    odidctl_report_line(report, "  %-22s%s", "Maintenance password", password);
}

/* ---- writing ---- */

static void add_date(struct odidctl_report *report, const char *run_dir)
{
    int error = 0;
    struct json_object *status = status_fetch(run_dir, &error);
    struct json_object *time = json_object_object_get(status, "time");
    struct json_object *utc = json_object_object_get(time, "utc");

    if (json_object_get_boolean(json_object_object_get(time, "known")) &&
        json_object_is_type(utc, json_type_string)) {
        odidctl_report_line(report, "%s", "");
        odidctl_report_line(report, DATE "%.40s (UTC)", json_object_get_string(utc));
    }
    json_object_put(status);
}

/* Without the date, which alone is no reason to write. */
static size_t undated(const char *text, size_t length)
{
    const char *date = memmem(text, length, "\r\n\r\n" DATE, strlen("\r\n\r\n" DATE));

    return date == NULL ? length : (size_t)(date - text) + 2;
}

int odidctl_report_write(struct odidctl_report *report, const char *path, const char *run_dir)
{
    size_t before_length = 0;
    char *before = whole_file_read(path, REPORT_MAX, &before_length);
    bool same;

    add_date(report, run_dir);
    if (fflush(report->file) != 0) {
        free(before);
        return -errno;
    }
    same = before != NULL &&
           undated(before, before_length) == undated(report->text, report->length) &&
           memcmp(before, report->text, undated(before, before_length)) == 0;
    free(before);
    return same ? 0 : whole_file_replace(path, report->text, report->length, 0);
}
