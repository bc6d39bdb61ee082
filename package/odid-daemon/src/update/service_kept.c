/* odid-update: what it shows of an update, and keeps of it. */
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "appliance/faults.h"
#include "base/log.h"
#include "update/service.h"
#include "update/update_places.h"

void service_complain(const char *what, int result)
{
    if (result < 0) {
        log_error("%s: %s", what, strerror(-result));
    }
}

/* Before the gate nothing keeps the aircraft on the ground: SWUpdate's word that something begins
 * can be anybody's on this board (its notifier's socket has no mode). */
void service_show(const struct service *self)
{
    bool checking = self->update.state == UPDATE_CHECKING && !self->passed;

    service_complain("the update's state can't be shown", update_write_state(STATE, &self->update));
    if (self->update.state == UPDATE_IDLE || checking) {
        unlink(UPDATING);
    } else {
        int fd = open(UPDATING, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);

        if (fd >= 0) {
            close(fd);
        }
    }
}

/* Where /data is full there is room once the record is gone, which isn't needed any more then. */
static void write_result(struct service *self, const struct update_result *result, bool decided)
{
    time_t known = self->time_known ? time(NULL) : 0;
    int written = update_write_result(DATA, result, known);

    if (decided) {
        service_complain("the trial's record can't be removed", update_remove_record(DATA));
        written = written < 0 ? update_write_result(DATA, result, known) : written;
    }
    service_complain("the update's result can't be kept", written);
}

__attribute__((format(printf, 4, 0))) static void keep_result(struct service *self,
                                                              enum update_outcome outcome,
                                                              const char *to, const char *format,
                                                              va_list arguments)
{
    struct update_result result = {.outcome = outcome};
    bool recorded = outcome != UPDATE_REFUSED && self->record.from[0] != '\0';
    bool decided = outcome != UPDATE_REFUSED || !self->beside;

    result.from_server = recorded && self->record.from_server;
    snprintf(result.from, sizeof(result.from), "%s", recorded ? self->record.from : self->version);
    snprintf(result.to, sizeof(result.to), "%s", to);
    vsnprintf(result.sentence, sizeof(result.sentence), format, arguments);
    log_info("update: %s", result.sentence);
    write_result(self, &result, decided);
    if (decided) {
        faults_set(FAULTS, "update", outcome == UPDATE_BACK ? result.sentence : NULL);
    }
}

void service_keep(struct service *self, enum update_outcome outcome, const char *to,
                  const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    keep_result(self, outcome, to, format, arguments);
    va_end(arguments);
}
