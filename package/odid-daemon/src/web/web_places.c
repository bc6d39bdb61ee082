#include "web/web_places.h"

#include <stdbool.h>
#include <stddef.h>
#include <sys/socket.h>

/* Each in the order in which it came. */
static struct {
    struct place {
        int fd;
        bool known; /* a session's */
        bool ended; /* shut down, and not gone yet */
        int64_t since_us;
    } places[WEB_PLACES_MAX];
    unsigned count;
} self;

static struct place *find_place(int fd)
{
    for (unsigned i = 0; i < self.count; i++) {
        if (self.places[i].fd == fd) {
            return &self.places[i];
        }
    }
    return NULL;
}

static bool is_strange(const struct place *place)
{
    return !place->known && !place->ended;
}

static void end_place(struct place *place)
{
    shutdown(place->fd, SHUT_RDWR);
    place->ended = true;
}

static void end_oldest_stranger(void)
{
    struct place *oldest = NULL;
    unsigned strangers = 0;

    for (unsigned i = 0; i < self.count; i++) {
        if (is_strange(&self.places[i])) {
            strangers++;
            oldest = oldest == NULL ? &self.places[i] : oldest;
        }
    }
    if (strangers >= WEB_STRANGERS_MAX) {
        end_place(oldest);
    }
}

void web_places_come(int fd, int64_t now_us)
{
    end_oldest_stranger();
    if (self.count == WEB_PLACES_MAX) { /* the server's limit is below */
        shutdown(fd, SHUT_RDWR);
        return;
    }
    self.places[self.count++] = (struct place){.fd = fd, .since_us = now_us};
}

void web_places_know(int fd, bool known)
{
    struct place *place = find_place(fd);

    if (place == NULL || place->known == known) {
        return;
    }
    if (!known) { /* whose session is over: one stranger more */
        end_oldest_stranger();
    }
    place->known = known;
}

void web_places_answered(int fd, int64_t now_us)
{
    struct place *place = find_place(fd);

    if (place != NULL) {
        place->since_us = now_us;
    }
}

void web_places_go(int fd)
{
    struct place *place = find_place(fd);

    if (place != NULL) {
        self.count--;
        for (; place < &self.places[self.count]; place++) {
            *place = place[1];
        }
    }
}

int64_t web_places_expire(int64_t now_us)
{
    int64_t next_us = INT64_MAX;

    for (unsigned i = 0; i < self.count; i++) {
        struct place *place = &self.places[i];
        int64_t end_us = place->since_us + WEB_STRANGER_US;

        if (is_strange(place) && now_us >= end_us) {
            end_place(place);
        } else if (is_strange(place) && end_us < next_us) {
            next_us = end_us;
        }
    }
    return next_us;
}
