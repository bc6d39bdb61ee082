/*
 * The kernel's raw HCI socket. Used by hci only.
 */
#ifndef ODID_HCI_KERNEL_H
#define ODID_HCI_KERNEL_H

/*
 * Opens hciN, which is asked to power up when it is down. Returns the
 * descriptor, or -errno: ENODEV no such controller (yet); ERFKILL blocked;
 * EAGAIN it was asked to power up: try again soon.
 */
int hci_kernel_open(int dev_id);

#endif
