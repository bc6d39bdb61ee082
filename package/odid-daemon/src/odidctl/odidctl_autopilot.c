/* odidctl find-autopilot: on which of several serial ports the autopilot is. */
#include <limits.h>
#include <stdio.h>
#include <unistd.h>

#include "base/serial.h"
#include "config/config_keys.h"
#include "odidctl/autopilot_find.h"
#include "odidctl/odidctl.h"

#define SECONDS_MAX 3600

int odidctl_find_autopilot(const char *baud_text, const char *seconds_text, char *const ports[])
{
    unsigned long baud, seconds;
    unsigned count = 0;
    int found;

    if (!config_whole_number(baud_text, UINT_MAX, &baud) || !serial_baud_valid((unsigned)baud)) {
        fprintf(stderr, "odidctl: BAUD is \"%s\"; expected a speed such as 57600\n", baud_text);
        return ODIDCTL_USAGE;
    }
    if (!config_whole_number(seconds_text, SECONDS_MAX, &seconds)) {
        fprintf(stderr, "odidctl: SECONDS is \"%s\"; expected 0 (for ever) to %d\n", seconds_text,
                SECONDS_MAX);
        return ODIDCTL_USAGE;
    }
    while (ports[count] != NULL) {
        count++;
    }
    found = autopilot_find(ports, count, (unsigned)baud, (unsigned)seconds, STDOUT_FILENO);
    if (found < 0) {
        return ODIDCTL_NOT_GOOD;
    }
    puts(ports[found]);
    return ODIDCTL_GOOD;
}
