/* What is worth mending: notes it behind the faults. */
#ifndef ODID_HEALTH_WARNINGS_H
#define ODID_HEALTH_WARNINGS_H

#include "daemon/health.h"

void health_judge_warnings(struct health *health, const struct health_input *input, int64_t now_us);

#endif
