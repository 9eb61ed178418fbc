// What the routes of services have in common, whichever world the server is in.
#pragma once

#include <cstdint>
#include <string>

#include "connection_header.hpp"
#include "layout.hpp"
#include "routes.hpp"

namespace plane {

// How a response says no: the bytes, in ROS 1's serialization, around the reason; one that has no flag can't.
struct Refusal {
  bool has_flag = false;
  bool has_text = false;
  std::string before;  // the whole response if it has no text
  std::string after;
};

struct ServiceSpecification {
  ServiceIdentity ros1;
  std::string ros2_service;
  rcl_node_t * node;
  const rosidl_service_type_support_t * type;
  Program request;
  Program response;
  int64_t timeout_ns;
  Refusal refusal;
  uint64_t token;  // names the route in events
  bool converts;   // Python converts between ROS 1's layout and ROS 2's, which is that of the programs
};

// How often a server is looked for while calls wait.
constexpr int64_t kLookEveryNs = 50'000'000;
constexpr const char * kBridgeEnds = "the bridge is shutting down";

// Return the bytes of a refusal, behind four bytes of length.
Frame refusal_frame(const Refusal & refusal, const std::string & reason);

}  // namespace plane
