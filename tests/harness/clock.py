"""A clock that jumps: a library, loaded before a program, under which the time of day goes forwards and backwards."""

import shutil
import subprocess

import pytest

_SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sys/time.h>
#include <time.h>

/* Every call is up to a day before or after the truth; the clock that only runs forwards stays as it is. */
static long shift(void) {
    static unsigned long state = 88172645463325252UL;
    state ^= state << 13; state ^= state >> 7; state ^= state << 17;
    return (long)(state % 172800UL) - 86400L;
}
int clock_gettime(clockid_t clock, struct timespec *answer) {
    static int (*true_clock)(clockid_t, struct timespec *);
    if (!true_clock) true_clock = dlsym(RTLD_NEXT, "clock_gettime");
    int result = true_clock(clock, answer);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) answer->tv_sec += shift();
    return result;
}
int gettimeofday(struct timeval *answer, void *zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    answer->tv_sec = now.tv_sec; answer->tv_usec = now.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *answer) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (answer) *answer = now.tv_sec;
    return now.tv_sec;
}
"""


def jumping_clock(folder):
    """Return the environment variables under which the clock jumps; skip where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("there is no C compiler on this machine")
    source, library = folder / "clock.c", folder / "clock.so"
    source.write_text(_SOURCE)
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return {"LD_PRELOAD": str(library)}
