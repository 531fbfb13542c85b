/* A PWM channel that takes no pulse as long as there is a file $OUTPUT_FAILS: writes to its duty_cycle end as those to a driver that has
   lost its chip. $OUTPUT is the end of the path of the channel's folder. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int fails(int file) {
    char link[64], path[4096], wanted[256];
    if (access(getenv("OUTPUT_FAILS"), F_OK) != 0) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    snprintf(wanted, sizeof wanted, "%s/duty_cycle", getenv("OUTPUT"));
    size_t end = strlen(wanted);
    return (size_t)length > end && strcmp(path + length - end, wanted) == 0;
}

ssize_t pwrite64(int file, const void *bytes, size_t count, off64_t offset) {
    if (fails(file)) {
        errno = EIO;
        return -1;
    }
    return ((__typeof__(&pwrite64))dlsym(RTLD_NEXT, "pwrite64"))(file, bytes, count, offset);
}
