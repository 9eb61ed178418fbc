// A moment at which the loop calls back. Once waited for, it costs nothing until then, however often it is asked for again.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "loop.hpp"

namespace plane {

// After begin(), for the loop's thread only.
class Timer : public Handler, public std::enable_shared_from_this<Timer> {
 public:
  Timer(Loop & loop, std::function<void()> due);
  ~Timer() override;

  void begin();  // throws std::system_error
  void end();
  // Have the callback called at that moment of the steady clock, if it is not called earlier anyway.
  void at(int64_t when_ns);

  void on_ready(uint32_t epoll_events) override;

 private:
  Loop & loop_;
  const std::function<void()> due_;
  const int fd_;
  Key key_ = 0;
  int64_t set_for_ns_ = 0;  // 0: for no moment
};

}  // namespace plane
