/*
 * The access point's key in maintenance: made of the technician's password,
 * which is kept nowhere.
 */
#ifndef ODID_MAINTENANCE_KEY_H
#define ODID_MAINTENANCE_KEY_H

#define MAINTENANCE_KEY_SIZE 65 /* 64 hexadecimal digits and a terminator */

/*
 * WPA2's pre-shared key (IEEE 802.11 annex J.4): PBKDF2-HMAC-SHA1 over password
 * and name of the network, 4096 rounds, 256 bits.
 */
void maintenance_key(const char *password, const char *ssid, char key[MAINTENANCE_KEY_SIZE]);

#endif
