/* How long something took, for people. */
#ifndef ODID_DURATION_H
#define ODID_DURATION_H

#include <stddef.h>

/* "0.3 s", "45 s", "12 min", "5 h", "3 days"; NAN: "unknown". */
void duration_text(char *out, size_t size, double seconds);

#endif
