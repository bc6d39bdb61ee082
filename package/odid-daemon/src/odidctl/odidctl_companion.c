/* On a companion computer, in odidctl_update.c's place: nothing updates by bundles there. */
#include "odidctl/odidctl.h"

void odidctl_add_update(const struct places *places, struct json_object *status)
{
    (void)places;
    json_object_object_add(status, "update", NULL);
    json_object_object_add(status, "last_update", NULL);
}

int odidctl_update(const struct places *places, const char *name)
{
    (void)places;
    (void)name;
    return ODIDCTL_NO_ANSWER; /* said before (odidctl_main.c) */
}
