/* The slots' block devices. slot: 'a' or 'b'. */
#ifndef ODID_UPDATE_SLOT_H
#define ODID_UPDATE_SLOT_H

#include <stdbool.h>
#include <stdint.h>

/* Whether it may be written to. Returns whether it is so now; why not is logged. */
bool update_slot_protect(char slot, bool read_only);

bool update_slot_is_writable(char slot);

/*
 * Takes away what an install left that came to nothing: U-Boot would start it where the other slot
 * is damaged, and asks for no signature. It has to be writable. What fails is logged.
 */
void update_slot_spoil(char slot);

/* Its size; 0: not known. */
uint64_t update_slot_octets(char slot);

#endif
