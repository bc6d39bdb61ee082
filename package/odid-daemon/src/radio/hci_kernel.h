/*
 * The kernel's raw HCI socket. Used by hci only.
 */
#ifndef ODID_HCI_KERNEL_H
#define ODID_HCI_KERNEL_H

#include <stdbool.h>

/*
 * Opens hciN, which is asked to power up when it is down. down_first: one that
 * is up is asked to power down, until it was seen down, which clears that.
 * Returns the descriptor, or -errno: ENODEV no such controller (yet); ERFKILL
 * blocked; EAGAIN it was asked to power up, or down: try again soon; EINPROGRESS its
 * driver hasn't set it up.
 */
int hci_kernel_open(int dev_id, bool *down_first);

#endif
