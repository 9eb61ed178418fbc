// The ends of services in ROS 2: a client and a server of rcl, on the node that rclpy has made.
#pragma once

#include <rcl/rcl.h>

#include <cstdint>
#include <functional>
#include <string>

#include "layout.hpp"
#include "type_support.hpp"

namespace plane {

// Creation and destruction belong to the thread that holds Python's lock, as with topics. Everything else: any thread.
class Ros2Client {
 public:
  Ros2Client(rcl_node_t * node, const rosidl_service_type_support_t * type, const std::string & service);
  ~Ros2Client();
  Ros2Client(const Ros2Client &) = delete;
  Ros2Client & operator=(const Ros2Client &) = delete;

  // Have `arrived` called with how many responses have come, in threads of DDS.
  void listen(std::function<void(size_t)> arrived);
  // Return when no call is under way; none comes any more.
  void stop_listening();
  // Tell whether a server is connected both ways.
  bool ready() const;
  // Send a request; returns its number, or -1 when that fails.
  int64_t send(const Outgoing & request) const;
  // Take one response; incoming.touched tells whether it was there and for us. Returns the number of its request.
  int64_t take(Incoming & incoming) const;

 private:
  rcl_node_t * node_;
  rcl_client_t client_;
  std::function<void(size_t)> arrived_;
};

class Ros2Service {
 public:
  Ros2Service(rcl_node_t * node, const rosidl_service_type_support_t * type, const std::string & service);
  ~Ros2Service();
  Ros2Service(const Ros2Service &) = delete;
  Ros2Service & operator=(const Ros2Service &) = delete;

  // As of a client, for requests.
  void listen(std::function<void(size_t)> arrived);
  void stop_listening();
  // Take one request and its id; incoming.touched tells whether there was one.
  void take(Incoming & incoming, rmw_request_id_t & request_id) const;
  // Answer. Waits up to 100 ms for a client that DDS has not connected to yet. Returns false when that fails.
  bool answer(const Outgoing & response, rmw_request_id_t request_id) const;
  // Return when the clients have what they were answered, or the time is over.
  void wait_for_arrival(int64_t most_ns) const;

 private:
  rcl_node_t * node_;
  rcl_service_t service_;
  std::function<void(size_t)> arrived_;
};

}  // namespace plane
