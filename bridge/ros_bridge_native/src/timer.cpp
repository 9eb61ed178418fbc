#include "timer.hpp"

#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

namespace plane {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;

}  // namespace

// The steady clock is CLOCK_MONOTONIC.
Timer::Timer(Loop & loop, std::function<void()> due)
: loop_(loop), due_(std::move(due)), fd_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
  if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "timerfd_create");
}

Timer::~Timer() { close(fd_); }

void Timer::begin() { key_ = loop_.add(fd_, shared_from_this(), EPOLLIN); }

void Timer::end() { loop_.remove(key_, fd_); }

void Timer::at(int64_t when_ns) {
  if (set_for_ns_ != 0 && set_for_ns_ <= when_ns) return;
  set_for_ns_ = std::max<int64_t>(when_ns, 1);
  itimerspec moment{};
  moment.it_value.tv_sec = set_for_ns_ / kSecondNs;
  moment.it_value.tv_nsec = set_for_ns_ % kSecondNs;
  timerfd_settime(fd_, TFD_TIMER_ABSTIME, &moment, nullptr);
}

void Timer::on_ready(uint32_t) {
  uint64_t number;
  (void)!read(fd_, &number, sizeof number);
  set_for_ns_ = 0;
  due_();
}

}  // namespace plane
