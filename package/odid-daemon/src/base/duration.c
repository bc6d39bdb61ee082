#include "base/duration.h"

#include <math.h>
#include <stdio.h>

double duration_s(int64_t us)
{
    return (double)us * 1e-6;
}

void duration_text(char *out, size_t size, double seconds)
{
    if (isnan(seconds)) {
        snprintf(out, size, "unknown");
    } else if (seconds < 10) {
        snprintf(out, size, "%.1f s", seconds);
    } else if (seconds < 120) {
        snprintf(out, size, "%.0f s", seconds);
    } else if (seconds < 7200) {
        snprintf(out, size, "%.0f min", floor(seconds / 60));
    } else if (seconds < 172800) {
        snprintf(out, size, "%.0f h", floor(seconds / 3600));
    } else {
        snprintf(out, size, "%.0f days", floor(seconds / 86400));
    }
}
