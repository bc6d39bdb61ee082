#include "appliance/maintenance_key.h"

#include <nettle/pbkdf2.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define ROUNDS 4096

void maintenance_key(const char *password, const char *ssid, char key[MAINTENANCE_KEY_SIZE])
{
    uint8_t bits[(MAINTENANCE_KEY_SIZE - 1) / 2];

    nettle_pbkdf2_hmac_sha1(strlen(password), (const uint8_t *)password, ROUNDS, strlen(ssid),
                            (const uint8_t *)ssid, sizeof(bits), bits);
    for (size_t i = 0; i < sizeof(bits); i++) {
        snprintf(key + 2 * i, 3, "%02x", bits[i]);
    }
    explicit_bzero(bits, sizeof(bits));
}
