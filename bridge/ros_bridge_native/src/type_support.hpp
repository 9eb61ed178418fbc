// A type support for Fast DDS whose messages are not objects but bytes of ROS 1: rmw_fastrtps writes and reads its payload through it.
//
// rmw_fastrtps_cpp serializes a message by calling functions of its type support. Ours run the layout program between ROS 1's bytes and the
// DDS payload itself, so that a message is copied once where a serialized one (rcl_publish_serialized_message, raw takes) is copied twice.
// Name, hash and description are those of the genuine type support, so that peers see no difference.
#pragma once

#include <rosidl_runtime_c/message_type_support_struct.h>
#include <rosidl_runtime_c/service_type_support_struct.h>

#include "buffer.hpp"
#include "layout.hpp"

namespace plane {

// What rcl is given to send.
struct Outgoing {
  const Program * program;
  const uint8_t * ros1;
  size_t ros1_size;
  size_t cdr_size;  // measured before
};

// What rcl is given to take into. The message goes into the frame, behind the four bytes of its length.
struct Incoming {
  const Program * program;
  Buffer * frame;
  uint32_t sequence;
  bool wanted;           // false: no subscriber, so spare the copy
  bool touched = false;  // there was a message
  bool good = false;     // and it was one of the layout
};

// Return the type support for a genuine one (of rosidl_typesupport_c); kept for good, as DDS may hold on to it.
// Throws std::runtime_error if the type has none for Fast DDS.
const rosidl_message_type_support_t * bytes_type_support(const rosidl_message_type_support_t * genuine);

// The same for a service, whose request and response are such messages.
const rosidl_service_type_support_t * bytes_service_type_support(const rosidl_service_type_support_t * genuine);

}  // namespace plane
