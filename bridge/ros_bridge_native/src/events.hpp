// What Python should know: few, bounded, and never waited for.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>

namespace plane {

enum class EventKind : int32_t {
  kConnected = 1,  // a publisher in ROS 1 sends to us from now on
  kClosed = 2,     // it does no longer, or the connection could not be made
  kRefused = 3,    // the connection headers do not fit
  kNeedsWriter = 4,  // a latching publisher waits for a writer of its own
  kNeedsServer = 5,  // calls wait for the place of a service in ROS 1
  kBadMessage = 6,
  kBadPeer = 7,  // a peer of our server was turned away
  kCallFailed = 8,
  kMissed = 9,         // a publisher has not been heard for three seconds
  kSubscribed = 10,    // a subscriber is connected; the text is its topic and its name
  kUnsubscribed = 11,  // it is not any more; behind these the text has our address, the peer's and its port
  kUnheard = 12,       // a subscriber has not been heard for three seconds
  kHeard = 13,         // it is heard again
  kOtherVersion = 14,  // a subscriber was turned away because of its type; the text is its connection header without the length
  kNotPublished = 15,  // one was turned away because its topic is not published, or not at the moment; the same text
};

constexpr size_t kMostEventBytes = 1 << 16;

struct Event {
  EventKind kind;
  uint64_t token;  // of the connection or the route
  std::string text;
};

class Events {
 public:
  void put(EventKind kind, uint64_t token, std::string text) {
    std::lock_guard<std::mutex> lock(mutex_);
    // Losing a report of garbage is fine, losing the end of a connection is not: those are as few as connections.
    if (queue_.size() >= kMostWaiting && dispensable(kind)) return;
    queue_.push_back({kind, token, std::move(text)});
    arrived_.notify_one();
  }

  bool next(int timeout_ms, Event & event) {
    std::unique_lock<std::mutex> lock(mutex_);
    if (!arrived_.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&] { return !queue_.empty(); })) return false;
    event = std::move(queue_.front());
    queue_.pop_front();
    return true;
  }

 private:
  static bool dispensable(EventKind kind) {
    return (kind >= EventKind::kBadMessage && kind <= EventKind::kCallFailed) || kind >= EventKind::kOtherVersion;
  }

  static constexpr size_t kMostWaiting = 1000;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<Event> queue_;
};

}  // namespace plane
