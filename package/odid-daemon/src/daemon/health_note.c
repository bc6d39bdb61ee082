#include "daemon/health_note.h"

#include <stdarg.h>
#include <stdio.h>

#include "base/utf8.h"

void health_note(struct health *health, enum health_severity severity, const char *id,
                 const char *advice, const char *format, ...)
{
    struct health_problem *problem = &health->problem[health->count];
    char reason[128];
    va_list arguments;

    if (health->count == HEALTH_MAX) {
        return; /* the most important ones are there */
    }
    health->count++;
    problem->id = id;
    problem->severity = severity;
    va_start(arguments, format);
    vsnprintf(reason, sizeof(reason), format, arguments);
    va_end(arguments);
    utf8_clean(problem->reason, sizeof(problem->reason),
               reason); /* a native ID may hold any byte */
    snprintf(problem->advice, sizeof(problem->advice), "%s", advice);
}

bool health_on_air(const struct health_input *input, enum channel channel, int64_t now_us)
{
    return radio_seen(&input->radios[channel], now_us) == RADIO_ON_AIR;
}
