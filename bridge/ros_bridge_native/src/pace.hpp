// How fast a backlog of small messages is let through to ROS 2.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace plane {

// What comes in a burst would push messages out of the subscribers' queues, which DDS does not tell about: a reader acknowledges what it
// will never take. So of a burst five go at once, half of ROS 2's default depth, and the rest at a rate that rclpy keeps up with while
// publisher and bridge want the processor, too (it takes one in 0.2 ms when it has one to itself). One that goes on for long loses messages
// in any case; then the rate doubles until `depth` messages a millisecond, for subscribers that are fast.
class Pace {
 public:
  explicit Pace(size_t depth) : most_(std::max(kMostAtLeast, static_cast<double>(depth))) {}

  // Return whether another message may go now.
  bool take(int64_t now_ns) {
    tokens_ = std::min(std::max(kAtOnce, rate_), tokens_ + static_cast<double>(now_ns - taken_at_ns_) * 1e-6 * rate_);
    taken_at_ns_ = now_ns;
    if (tokens_ >= 1.0) {
      tokens_ -= 1.0;
      return true;
    }
    if (now_ns - refused_at_ns_ > kOverNs) {  // a backlog begins
      rate_ = kFirst;
      since_ns_ = now_ns;
    } else if (now_ns - since_ns_ > kDoubleEveryNs) {
      rate_ = std::min(2 * rate_, most_);
      since_ns_ = now_ns;
    }
    refused_at_ns_ = now_ns;
    return false;
  }

 private:
  static constexpr double kAtOnce = 5.0;
  static constexpr double kFirst = 2.0, kMostAtLeast = 10.0;  // messages a millisecond
  static constexpr int64_t kDoubleEveryNs = 100'000'000;
  static constexpr int64_t kOverNs = 20'000'000;

  const double most_;
  double rate_ = kFirst;
  double tokens_ = kAtOnce;
  int64_t taken_at_ns_ = 0;
  int64_t refused_at_ns_ = 0;
  int64_t since_ns_ = 0;
};

}  // namespace plane
