/* How long a test waits for what comes: a busy machine must not look like a fault. */
#ifndef ODID_TESTS_PATIENCE_H
#define ODID_TESTS_PATIENCE_H

#define PATIENCE_MS 60000

#endif
