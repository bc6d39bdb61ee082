/* How long something took, for people. */
#ifndef ODID_DURATION_H
#define ODID_DURATION_H

#include <stddef.h>
#include <stdint.h>

double duration_s(int64_t us);

/* "0.3 s", "45 s", "12 min", "5 h", "3 days"; NAN: "unknown". */
void duration_text(char *out, size_t size, double seconds);

#endif
