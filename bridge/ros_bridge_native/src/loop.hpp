// One thread that waits for all ROS 1 sockets.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <unordered_map>
#include <vector>

namespace plane {

// Something with a file descriptor. Called in the loop's thread only.
class Handler {
 public:
  virtual ~Handler() = default;
  virtual void on_ready(uint32_t epoll_events) = 0;
  // Return whether the handler still has to be asked again; called about every quarter of a second while it is.
  virtual bool on_tick(int64_t /*now_ns*/) { return false; }
  // Called once, a millisecond after rest() was asked for.
  virtual void on_rested() {}
};

using Key = uint64_t;

class Loop {
 public:
  Loop();
  ~Loop();  // ends the thread

  // Any thread:
  Key add(int fd, std::shared_ptr<Handler> handler, uint32_t epoll_events, bool ticks = false);
  void change(Key key, int fd, uint32_t epoll_events);
  void remove(Key key, int fd);
  void post(std::function<void()> task);
  void run_and_wait(const std::function<void()> & task);
  // The loop's thread only:
  void rest(std::shared_ptr<Handler> handler);

 private:
  void run();
  void run_tasks();
  void tick();
  void end_rest();
  std::shared_ptr<Handler> find(Key key);

  int epoll_;
  int wake_;
  int timer_;
  std::atomic<bool> ended_{false};
  std::mutex mutex_;
  Key next_key_ = 1;
  std::unordered_map<Key, std::shared_ptr<Handler>> handlers_;
  std::vector<Key> ticking_;
  std::vector<std::shared_ptr<Handler>> resting_;
  std::vector<std::function<void()>> tasks_;
  std::thread thread_;
};

}  // namespace plane
