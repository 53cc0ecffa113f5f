/* cyclictest in small, where that is not installed: sleep to absolute times, count how late each wake was.
   cyclic -i US -D SECONDS [-p PRIORITY]: SCHED_FIFO with a priority; other options are passed over.
   Prints `us count` lines as `cyclictest -q -h` does. */
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#define LATEST 200000

static unsigned counts[LATEST];

static long long ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

int main(int argc, char **argv) {
    long long interval = 1000000, seconds = 1;
    struct sched_param priority = {0};
    for (int i = 1; i + 1 < argc; i++) {
        if (!strcmp(argv[i], "-i")) interval = 1000 * atoll(argv[i + 1]);
        if (!strcmp(argv[i], "-D")) seconds = atoll(argv[i + 1]);
        if (!strcmp(argv[i], "-p")) priority.sched_priority = atoi(argv[i + 1]);
    }
    if (priority.sched_priority && (mlockall(MCL_CURRENT) || sched_setscheduler(0, SCHED_FIFO, &priority)))
        return 1;
    memset(counts, 0, sizeof counts); /* no page is touched for the first time later */
    long long due = ns(), end = due + seconds * 1000000000LL;
    while (due < end) {
        due += interval;
        struct timespec until = {due / 1000000000LL, due % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        long long now = ns(), late = (now - due) / 1000;
        counts[late < LATEST ? late : LATEST - 1]++;
        while (due + interval < now) due += interval;
    }
    for (int us = 0; us < LATEST; us++)
        if (counts[us]) printf("%06d %06u\n", us, counts[us]);
    return 0;
}
