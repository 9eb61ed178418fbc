// Whether the peer of a connection is still heard, by what the kernel knows of it, and quick repetition of what it has not acknowledged.
#pragma once

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "sockets.hpp"

namespace plane {

// The loop's thread only, but for silent().
class Liveness {
 public:
  // Look at the connection; to be called at each tick of the loop.
  void look(int fd, int64_t now_ns) {
    tcp_info info{};
    socklen_t size = sizeof info;
    if (getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return;
    const int64_t silent_ms = std::min(info.tcpi_last_ack_recv, info.tcpi_last_data_recv);
    missed_ = silent_ms >= kMissedMs;
    silent_ = silent_ms >= kSilentMs;
    repeat_soon(fd, info, now_ns);
    looked_ns_ = now_ns;
  }

  // The peer has not been heard for so long that it does not count any more.
  bool silent() const { return silent_; }
  // It has not been heard for three seconds.
  bool missed() const { return missed_; }

 private:
  static constexpr int64_t kMissedMs = 3000, kSilentMs = 11'000;
  static constexpr int64_t kAgainMs = 1000;
  static constexpr int kStalled = 2;  // repetitions without an answer
  static constexpr int64_t kMs = 1'000'000;

  // What is not acknowledged the kernel repeats after twice the time each time, up to two minutes: so late it would arrive when the
  // network is back. But the time to the next repetition never goes beyond the user timeout (since Linux 4.19), so a user timeout that
  // is always a second ahead makes it once a second.
  void repeat_soon(int fd, const tcp_info & info, int64_t now_ns) {
    if (info.tcpi_retransmits == 0) {
      if (shortened_) set_timeout(fd, kGiveUpMs);
      shortened_ = false;
      stalled_since_ns_ = 0;
      return;
    }
    if (stalled_since_ns_ == 0) stalled_since_ns_ = looked_ns_;
    if (info.tcpi_retransmits < kStalled) return;
    shortened_ = true;
    set_timeout(fd, std::min<int64_t>(kGiveUpMs, (now_ns - stalled_since_ns_) / kMs + kAgainMs));
  }

  static void set_timeout(int fd, int64_t timeout_ms) {
    const int value = static_cast<int>(timeout_ms);
    setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &value, sizeof value);
  }

  std::atomic<bool> silent_{false};
  bool missed_ = false;
  bool shortened_ = false;
  int64_t looked_ns_ = 0;
  int64_t stalled_since_ns_ = 0;
};

}  // namespace plane
