#include "appliance/places.h"

#include <stddef.h>
#include <stdio.h>

void places_config(const struct places *places, char path[PLACES_PATH_SIZE])
{
    if (places->config != NULL) {
        snprintf(path, PLACES_PATH_SIZE, "%s", places->config);
    } else {
        snprintf(path, PLACES_PATH_SIZE, "%s/odid/odid.conf", places->data);
    }
}
