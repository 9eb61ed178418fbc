// Figures of a route, written on the hot path and read at any time.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>

namespace plane {

// As in stats.py: bins of durations that grow by 5 % from 1 us.
constexpr int kBins = 400;
constexpr double kBinGrowth = 1.05;

inline int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Counters {
  std::atomic<uint64_t> count{0};
  std::atomic<uint64_t> bytes{0};
  std::atomic<uint64_t> errors{0};           // messages that are none of the type
  std::atomic<uint64_t> dropped_slow{0};     // gave way because a ROS 1 subscriber does not keep up
  std::atomic<uint64_t> dropped_overrun{0};  // gave way because they arrived faster than they crossed
  std::atomic<uint64_t> peers{0};            // connections in ROS 1
  std::atomic<uint32_t> bins[kBins]{};

  void crossed(int64_t since_ns, size_t size) {
    static const double scale = 1.0 / std::log(kBinGrowth);
    const double microseconds = std::max(1.0, static_cast<double>(now_ns() - since_ns) / 1000.0);
    const int bin = std::min(kBins - 1, static_cast<int>(std::log(microseconds) * scale));
    bins[bin].fetch_add(1, std::memory_order_relaxed);
    bytes.fetch_add(size, std::memory_order_relaxed);
    count.fetch_add(1, std::memory_order_relaxed);
  }
};

}  // namespace plane
