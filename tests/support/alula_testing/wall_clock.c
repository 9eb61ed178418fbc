/* Shifts the wall clock of every process that it is loaded into (LD_PRELOAD), by the seconds that stand in a file: an int64 in the machine's
   order of bytes, which may be written anew at any time. The file: the environment variable WALL_CLOCK_SHIFT.

   The kernel's clock stays as it is. So a wait until a time of the wall clock is made in slices, each of which ends as if nothing had
   happened (POSIX allows that, and callers look again): it ends early or late with the step, as under a clock that is set. Times of the
   monotonic clock, which are small, are passed on. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define WALL 1000000000 /* seconds; a clock that shows more is no monotonic one */
#define SLICE_NS 50000000

static volatile const int64_t *shift;

__attribute__((constructor)) static void load(void) {
  const char *path = getenv("WALL_CLOCK_SHIFT");
  int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return;
  void *at = mmap(NULL, sizeof *shift, PROT_READ, MAP_SHARED, file, 0);
  if (at != MAP_FAILED) shift = at;
  close(file);
}

static void *next(const char *name) {
  /* The condition variables of today, not those of before 2003. */
  void *found = dlvsym(RTLD_NEXT, name, "GLIBC_2.3.2");
  return found ? found : dlsym(RTLD_NEXT, name);
}

static int64_t shift_s(void) { return shift ? *shift : 0; }

int clock_gettime(clockid_t clock, struct timespec *now) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
  int failed = real(clock, now);
  if (!failed && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec += shift_s();
  return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
  (void)zone;
  struct timespec at;
  clock_gettime(CLOCK_REALTIME, &at);
  now->tv_sec = at.tv_sec;
  now->tv_usec = at.tv_nsec / 1000;
  return 0;
}

time_t time(time_t *out) {
  struct timespec at;
  clock_gettime(CLOCK_REALTIME, &at);
  if (out) *out = at.tv_sec;
  return at.tv_sec;
}

/* Returns whether a time of the shifted wall clock has not come, and the end of the next slice by the kernel's clock. */
static int slice(const struct timespec *end, struct timespec *slice_end) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  int64_t rest_ns = SLICE_NS;
  if (end->tv_sec - now.tv_sec < 2) rest_ns = (end->tv_sec - now.tv_sec) * INT64_C(1000000000) + end->tv_nsec - now.tv_nsec;
  int is_last = rest_ns <= SLICE_NS;
  if (!is_last) rest_ns = SLICE_NS;
  if (rest_ns < 0) rest_ns = 0;
  int64_t at_ns = now.tv_nsec + rest_ns;
  slice_end->tv_sec = now.tv_sec - shift_s() + at_ns / 1000000000;
  slice_end->tv_nsec = at_ns % 1000000000;
  return !is_last;
}

int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict mutex, const struct timespec *restrict end) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  if (!real) real = next("pthread_cond_timedwait");
  if (end->tv_sec < WALL) return real(condition, mutex, end);
  struct timespec until;
  int more = slice(end, &until), said = real(condition, mutex, &until);
  return said == ETIMEDOUT && more ? 0 : said;
}

int sem_timedwait(sem_t *restrict semaphore, const struct timespec *restrict end) {
  static int (*real)(sem_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "sem_timedwait");
  for (;;) {
    struct timespec until;
    int more = slice(end, &until);
    if (!real(semaphore, &until)) return 0;
    if (errno != ETIMEDOUT || !more) return -1;
  }
}

int pthread_mutex_timedlock(pthread_mutex_t *restrict mutex, const struct timespec *restrict end) {
  static int (*real)(pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  for (;;) {
    struct timespec until;
    int more = slice(end, &until), said = real(mutex, &until);
    if (said != ETIMEDOUT || !more) return said;
  }
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *end, struct timespec *rest) {
  static int (*real)(clockid_t, int, const struct timespec *, struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "clock_nanosleep");
  if (clock != CLOCK_REALTIME || !(flags & TIMER_ABSTIME)) return real(clock, flags, end, rest);
  for (;;) {
    struct timespec until;
    int more = slice(end, &until), said = real(clock, flags, &until, rest);
    if (said || !more) return said;
  }
}
