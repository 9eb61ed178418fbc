// TCPROS connection headers (ROS wiki, "ROS/Connection Header"): a length, then fields "name=value", each with its length.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

namespace plane {

// Return the little-endian length that TCPROS puts before headers, fields and messages.
inline uint32_t length_at(const uint8_t * data) {
  uint32_t length;
  std::memcpy(&length, data, sizeof length);
  return length;
}

using Fields = std::map<std::string, std::string>;

constexpr uint32_t kMostHeaderBytes = 1u << 20;

// What a topic says of itself in the header.
struct TopicIdentity {
  std::string topic;
  std::string type;
  std::string md5sum;
  std::string definition;
};

// What a service says of itself.
struct ServiceIdentity {
  std::string service;
  std::string type;
  std::string md5sum;
};

std::string encode(const Fields & fields);

// Read the fields behind the length. Returns false when the bytes are no header.
bool decode(const uint8_t * data, size_t size, Fields & fields);

// Return why a peer's header does not fit the topic or service, or nothing. "*" fits everything.
std::string mismatch(const Fields & peer, const TopicIdentity & own);
std::string mismatch(const Fields & peer, const ServiceIdentity & own);

}  // namespace plane
