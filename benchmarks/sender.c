/* Send messages of SIZE bytes to every PORT of 127.0.0.1, to each as fast as it takes them, until killed.
   BUFFER is SO_SNDBUF, 0: as the system has it. With a large one the receiver's recv() acknowledges and then
   sends what waits here: the sender's work in the receiver's time. */
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

static int connected(int port, int buffer) {
    struct sockaddr_in end = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    int one = 1, fd = socket(AF_INET, SOCK_STREAM, 0);
    end.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (buffer && fd >= 0) setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    if (fd < 0 || connect(fd, (struct sockaddr *)&end, sizeof end) < 0) exit(1);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return fd;
}

int main(int argc, char **argv) {
    size_t size = argc > 3 ? strtoul(argv[1], NULL, 10) : 0;
    char *message = calloc(1, size + 1);
    int set = epoll_create1(0);
    if (!size || !message || set < 0) return 2;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    memset(message, 'x', size);
    for (int i = 3; i < argc; i++) {
        struct epoll_event wanted = {.events = EPOLLOUT, .data.fd = connected(atoi(argv[i]), atoi(argv[2]))};
        epoll_ctl(set, EPOLL_CTL_ADD, wanted.data.fd, &wanted);
    }
    for (;;) {
        struct epoll_event ready[1024];
        int count = epoll_wait(set, ready, 1024, -1);
        for (int i = 0; i < count; i++)
            if (send(ready[i].data.fd, message, size, MSG_NOSIGNAL | MSG_DONTWAIT) < 0 && errno != EAGAIN)
                return 0;
    }
}
