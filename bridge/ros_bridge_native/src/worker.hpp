// A thread for large messages, so that their copies do not hold up small ones.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

namespace plane {

class Job {
 public:
  virtual ~Job() = default;
  virtual void work() = 0;
};

class Worker {
 public:
  explicit Worker(const char * name);
  ~Worker();

  // Have the job's work() called soon, once for all calls until it begins.
  void schedule(Job * job);
  // Return when the job is neither waiting nor running; it may not be scheduled any more.
  void forget(Job * job);

 private:
  void run(const char * name);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job *> waiting_;
  Job * running_ = nullptr;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace plane
