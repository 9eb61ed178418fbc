// Messages that go through Python: those that it receives itself, and those of types that it converts.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "buffer.hpp"

namespace plane {

enum class PythonKind : int32_t { kMessage = 0, kRequest = 1, kResponse = 2 };

struct PythonMessage {
  uint64_t token;  // of the route
  PythonKind kind;
  uint64_t number;  // of the route's writer or call
  int64_t start_ns;
  std::string sender;  // in ROS 2
  Frame bytes;
  size_t offset;  // where the message begins
};

// A bounded queue for each route, taken from in turn by one thread of Python. No other thread ever waits for Python.
class PythonQueue {
 public:
  // Returns how many older messages of the route had to go.
  size_t put(PythonMessage message, size_t depth) {
    std::lock_guard<std::mutex> lock(mutex_);
    auto & queue = queues_[message.token];
    size_t gone = 0;
    for (; queue.size() >= depth; ++gone) queue.pop_front();
    if (queue.empty() && gone == 0) turns_.push_back(message.token);
    queue.push_back(std::move(message));
    arrived_.notify_one();
    return gone;
  }

  // Returns nothing after the time, or after close().
  std::unique_ptr<PythonMessage> next(int timeout_ms) {
    std::unique_lock<std::mutex> lock(mutex_);
    arrived_.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&] { return closed_ || !turns_.empty(); });
    if (closed_ || turns_.empty()) return nullptr;
    const auto queue = queues_.find(turns_.front());
    turns_.pop_front();
    auto message = std::make_unique<PythonMessage>(std::move(queue->second.front()));
    queue->second.pop_front();
    if (queue->second.empty()) queues_.erase(queue);
    else turns_.push_back(message->token);
    return message;
  }

  void forget(uint64_t token) {
    std::lock_guard<std::mutex> lock(mutex_);
    queues_.erase(token);
    for (auto turn = turns_.begin(); turn != turns_.end();) turn = *turn == token ? turns_.erase(turn) : turn + 1;
  }

  void close() {
    std::lock_guard<std::mutex> lock(mutex_);
    closed_ = true;
    arrived_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::map<uint64_t, std::deque<PythonMessage>> queues_;  // by the routes' tokens; none is empty
  std::deque<uint64_t> turns_;
  bool closed_ = false;
};

}  // namespace plane
