#include "worker.hpp"

#include <pthread.h>

#include <algorithm>

namespace plane {

Worker::Worker(const char * name) : thread_([this, name] { run(name); }) {}

Worker::~Worker() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::schedule(Job * job) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (std::find(waiting_.begin(), waiting_.end(), job) != waiting_.end()) return;
    waiting_.push_back(job);
  }
  changed_.notify_all();
}

void Worker::forget(Job * job) {
  std::unique_lock<std::mutex> lock(mutex_);
  waiting_.erase(std::remove(waiting_.begin(), waiting_.end(), job), waiting_.end());
  changed_.wait(lock, [&] { return running_ != job; });
}

void Worker::run(const char * name) {
  pthread_setname_np(pthread_self(), name);
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
    if (ended_) return;
    running_ = waiting_.front();
    waiting_.pop_front();
    lock.unlock();
    running_->work();
    lock.lock();
    running_ = nullptr;
    changed_.notify_all();
  }
}

}  // namespace plane
