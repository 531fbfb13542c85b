/* A disk that takes its time: each fsync, and each write to a file below $SLOW_DISK, lasts $SLOW_DISK_MS longer until there is a file
   $SLOW_DISK_UNTIL. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void wait_for_disk(void) {
    if (access(getenv("SLOW_DISK_UNTIL"), F_OK) != 0) usleep(1000 * (useconds_t)atoi(getenv("SLOW_DISK_MS")));
}

static int is_on_disk(int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path);
    const char *disk = getenv("SLOW_DISK");
    return length > 0 && (size_t)length > strlen(disk) && strncmp(path, disk, strlen(disk)) == 0;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

int fsync(int file) { wait_for_disk(); return REAL(fsync)(file); }
int fdatasync(int file) { wait_for_disk(); return REAL(fdatasync)(file); }

ssize_t write(int file, const void *bytes, size_t count) {
    if (is_on_disk(file)) wait_for_disk();
    return REAL(write)(file, bytes, count);
}

ssize_t pwrite64(int file, const void *bytes, size_t count, off64_t offset) {
    if (is_on_disk(file)) wait_for_disk();
    return REAL(pwrite64)(file, bytes, count, offset);
}
