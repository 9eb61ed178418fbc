// The ends in ROS 2: a publisher and a subscription of rcl, on the node that rclpy has made.
#pragma once

#include <rcl/rcl.h>

#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "layout.hpp"
#include "type_support.hpp"

namespace plane {

// Raise std::runtime_error with rcl's reason unless the code is that of success.
void require(rcl_ret_t code, const char * what, const std::string & name);

struct Quality {
  size_t depth;
  bool reliable;
  bool latched;
};

// Creation and destruction belong to the thread that holds Python's lock: rcl's nodes are not made for several threads.
class Ros2Publisher {
 public:
  Ros2Publisher(rcl_node_t * node, const rosidl_message_type_support_t * type, const std::string & topic, const Quality & quality);
  ~Ros2Publisher();
  Ros2Publisher(const Ros2Publisher &) = delete;
  Ros2Publisher & operator=(const Ros2Publisher &) = delete;

  // Any thread. Returns false when the bytes are no message of the type.
  bool publish(const Program & program, const uint8_t * ros1, size_t size);
  size_t peers() const;

 private:
  rcl_node_t * node_;
  rcl_publisher_t publisher_;
};

using Gid = std::array<uint8_t, RMW_GID_STORAGE_SIZE>;

struct Sender {
  Gid gid;
  uint64_t sequence;  // the sender's number of the message, from 1
};

class Ros2Subscription {
 public:
  Ros2Subscription(rcl_node_t * node, const rosidl_message_type_support_t * type, const std::string & topic, const Quality & quality);
  ~Ros2Subscription();
  Ros2Subscription(const Ros2Subscription &) = delete;
  Ros2Subscription & operator=(const Ros2Subscription &) = delete;

  // Have `arrived` called: at once if messages wait already, then in threads of DDS, one call at a time.
  void listen(std::function<void()> arrived);
  // Return when no call is under way; none comes any more.
  void stop_listening();
  // Take a message if there is one; incoming.touched tells.
  void take(Incoming & incoming, Sender & sender);
  size_t peers() const;

 private:
  rcl_node_t * node_;
  rcl_subscription_t subscription_;
  std::function<void()> arrived_;
};

}  // namespace plane
