// Responses to clients in ROS 2: answers and refusals.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <set>
#include <string>

#include "ros2_ends.hpp"
#include "ros2_services.hpp"
#include "service_route.hpp"

namespace plane {

// What may take long goes by a worker: large responses, and the first one to a client, which DDS may still be connecting to.
class Replies : public Job {
 public:
  Replies(Context & context, const ServiceSpecification & specification, const Ros2Service & service, Counters & counters);

  // The loop's thread only. The response is in the bytes, from the offset on, and has the layout.
  void answer(const rmw_request_id_t & request_id, Frame bytes, size_t offset, int64_t start_ns);
  // Say no, and why, if the type can.
  void refuse(const rmw_request_id_t & request_id, const std::string & reason);
  // From here on everything goes at once, in the thread that says so.
  void stop_deferring() { defers_ = false; }
  // Send what the worker has not come to, and leave it alone from then on. After stop_deferring(), in another thread than the loop's.
  void finish();

 private:
  struct Reply {
    rmw_request_id_t request_id;
    Frame bytes;
    size_t offset;
    int64_t start_ns;  // 0: a refusal
  };

  void send_soon(Reply reply);
  void send(const Reply & reply);
  void work() override;

  Context & context_;
  const ServiceSpecification & specification_;
  const Ros2Service & service_;
  Counters & counters_;
  std::atomic<bool> defers_{true};
  std::set<Gid> known_;  // clients that have been answered: DDS is connected to them
  std::mutex slow_mutex_;
  std::deque<Reply> slow_;
};

}  // namespace plane
