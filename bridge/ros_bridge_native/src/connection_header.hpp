// TCPROS connection headers (ROS wiki, "ROS/Connection Header"): a length, then fields "name=value", each with its length.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plane {

using Fields = std::map<std::string, std::string>;

constexpr uint32_t kMostHeaderBytes = 1u << 20;

// What a topic says of itself in the header.
struct TopicIdentity {
  std::string topic;
  std::string type;
  std::string md5sum;
  std::string definition;
};

std::string encode(const Fields & fields);

// Read the fields behind the length. Returns false when the bytes are no header.
bool decode(const uint8_t * data, size_t size, Fields & fields);

// Return why a peer's header does not fit the topic, or nothing. "*" fits everything.
std::string mismatch(const Fields & peer, const TopicIdentity & own);

}  // namespace plane
