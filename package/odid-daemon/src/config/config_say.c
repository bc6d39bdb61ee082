#include <stdarg.h>
#include <stdio.h>

#include "base/utf8.h"
#include "config/config_keys.h"
#include "config/identifiers.h"

void config_say(struct config_source *source, enum config_severity severity, const char *format,
                ...)
{
    char text[2 * CONFIG_PROBLEM_SIZE], sentence[CONFIG_PROBLEM_SIZE];
    size_t filled = 0;
    va_list arguments;

    source->errors += severity == CONFIG_ERROR;
    source->warnings += severity == CONFIG_WARNING;
    if (source->said > CONFIG_SENTENCES_MAX) {
        return;
    }
    if (source->name[0] != '\0') {
        filled += (size_t)snprintf(text, sizeof(text), "%.80s", source->name);
        if (source->line > 0) {
            filled +=
                (size_t)snprintf(text + filled, sizeof(text) - filled, " line %u", source->line);
        }
        filled += (size_t)snprintf(text + filled, sizeof(text) - filled, ": ");
    }
    if (source->said++ == CONFIG_SENTENCES_MAX) {
        snprintf(text + filled, sizeof(text) - filled, "more is wrong than is listed here");
    } else {
        va_start(arguments, format);
        vsnprintf(text + filled, sizeof(text) - filled, format, arguments);
        va_end(arguments);
    }
    identifiers_remove_secrets(text); /* whatever it was that was quoted, ... */
    utf8_clean(sentence, sizeof(sentence), text);
    identifiers_remove_secrets(sentence); /* ... and what looks like one now that it was cut */
    source->report(source->context, severity, sentence);
}
