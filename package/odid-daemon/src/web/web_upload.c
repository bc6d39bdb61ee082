#include "web/web_upload.h"

#include <errno.h>
#include <fcntl.h>
#include <network_ipc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"

#define CONTROL_SOCKET "sockinstctrl"

int web_upload_open(const char *directory, char *sentence, size_t size)
{
    struct swupdate_request request;
    char path[512];
    int fd;

    snprintf(path, sizeof(path), "%s/" CONTROL_SOCKET, directory);
    if (access(path, W_OK) < 0) {
        log_warning("%s: %s", path, strerror(errno));
        snprintf(sentence, size,
                 "The updater isn't running on this appliance, so nothing was sent. Switch the "
                 "power off and on, and try again; if it stays so, write the image to the board.");
        return -1;
    }
    setenv("TMPDIR", directory, 1); /* that is where libswupdate looks for the socket */
    swupdate_prepare_req(&request);
    request.source = SOURCE_LOCAL;
    snprintf(request.info, sizeof(request.info), "page");
    fd = ipc_inst_start_ext(&request, sizeof(request));
    if (fd < 0) {
        snprintf(sentence, size,
                 "The updater takes no bundle now: another update is under way. Wait until it is "
                 "over, and try again.");
        return -1;
    }
    if (fcntl(fd, F_SETFL, O_NONBLOCK) < 0 || fcntl(fd, F_SETFD, FD_CLOEXEC) < 0) {
        log_error("can't speak to the updater: %s", strerror(errno));
    }
    return fd;
}

ssize_t web_upload_give(int fd, const char *data, size_t length)
{
    ssize_t done = send(fd, data, length, MSG_NOSIGNAL);

    if (done < 0 && (errno == EAGAIN || errno == EINTR)) {
        return 0;
    }
    return done;
}

void web_upload_close(int fd)
{
    if (fd >= 0) {
        ipc_end(fd);
    }
}
