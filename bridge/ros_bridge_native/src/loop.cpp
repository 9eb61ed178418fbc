#include "loop.hpp"

#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <future>
#include <system_error>
#include <utility>

#include "counters.hpp"

namespace plane {
namespace {

constexpr int kTickMs = 250;
constexpr int kEventsAtOnce = 64;
constexpr long kRestNs = 1'000'000;
constexpr Key kWakeKey = 0, kTimerKey = UINT64_MAX;

[[noreturn]] void fail(const char * what) { throw std::system_error(errno, std::generic_category(), what); }

}  // namespace

Loop::Loop()
: epoll_(epoll_create1(EPOLL_CLOEXEC)), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
  timer_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
  if (epoll_ < 0 || wake_ < 0 || timer_ < 0) fail("epoll");
  for (const auto & [fd, key] : {std::pair{wake_, kWakeKey}, std::pair{timer_, kTimerKey}}) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = key;
    if (epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0) fail("epoll_ctl");
  }
  thread_ = std::thread([this] { run(); });
}

Loop::~Loop() {
  ended_ = true;
  post([] {});
  thread_.join();
  handlers_.clear();
  close(epoll_);
  close(wake_);
  close(timer_);
}

Key Loop::add(int fd, std::shared_ptr<Handler> handler, uint32_t epoll_events, bool ticks) {
  Key key;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    key = next_key_++;
    handlers_[key] = std::move(handler);
    if (ticks) ticking_.push_back(key);
  }
  epoll_event event{};
  event.events = epoll_events;
  event.data.u64 = key;
  if (epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0) fail("epoll_ctl");
  if (ticks) post([] {});  // the thread may be waiting without a limit
  return key;
}

void Loop::change(Key key, int fd, uint32_t epoll_events) {
  epoll_event event{};
  event.events = epoll_events;
  event.data.u64 = key;
  epoll_ctl(epoll_, EPOLL_CTL_MOD, fd, &event);
}

void Loop::remove(Key key, int fd) {
  epoll_ctl(epoll_, EPOLL_CTL_DEL, fd, nullptr);
  std::lock_guard<std::mutex> lock(mutex_);
  handlers_.erase(key);
}

void Loop::post(std::function<void()> task) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  const uint64_t one = 1;
  (void)!write(wake_, &one, sizeof one);
}

void Loop::run_and_wait(const std::function<void()> & task) {
  if (std::this_thread::get_id() == thread_.get_id()) return task();
  std::promise<void> done;
  post([&] {
    task();
    done.set_value();
  });
  done.get_future().wait();
}

std::shared_ptr<Handler> Loop::find(Key key) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = handlers_.find(key);
  return found == handlers_.end() ? nullptr : found->second;
}

void Loop::run() {
  pthread_setname_np(pthread_self(), "plane_loop");
  epoll_event events[kEventsAtOnce];
  int64_t last_tick_ns = now_ns();
  while (!ended_) {
    bool ticks;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      ticks = !ticking_.empty();
    }
    const int number = epoll_wait(epoll_, events, kEventsAtOnce, ticks ? kTickMs : -1);
    for (int i = 0; i < number; ++i) {
      if (events[i].data.u64 == kWakeKey) {
        run_tasks();
      } else if (events[i].data.u64 == kTimerKey) {
        end_rest();
      } else if (const auto handler = find(events[i].data.u64)) {
        handler->on_ready(events[i].events);
      }
    }
    if (ticks && now_ns() - last_tick_ns >= kTickMs * 1'000'000ll) {
      last_tick_ns = now_ns();
      tick();
    }
  }
  run_tasks();
}

void Loop::run_tasks() {
  uint64_t number;
  (void)!read(wake_, &number, sizeof number);
  std::vector<std::function<void()>> tasks;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    tasks.swap(tasks_);
  }
  for (const auto & task : tasks) task();
}

void Loop::rest(std::shared_ptr<Handler> handler) {
  if (resting_.empty()) {
    itimerspec soon{};
    soon.it_value.tv_nsec = kRestNs;
    timerfd_settime(timer_, 0, &soon, nullptr);
  }
  resting_.push_back(std::move(handler));
}

void Loop::end_rest() {
  uint64_t number;
  (void)!read(timer_, &number, sizeof number);
  std::vector<std::shared_ptr<Handler>> rested;
  rested.swap(resting_);
  for (const auto & handler : rested) handler->on_rested();
}

void Loop::tick() {
  std::vector<Key> keys;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    keys.swap(ticking_);
  }
  const int64_t now = now_ns();
  keys.erase(std::remove_if(keys.begin(), keys.end(), [&](Key key) {
    const auto handler = find(key);
    return handler == nullptr || !handler->on_tick(now);
  }), keys.end());
  std::lock_guard<std::mutex> lock(mutex_);
  ticking_.insert(ticking_.end(), keys.begin(), keys.end());
}

}  // namespace plane
