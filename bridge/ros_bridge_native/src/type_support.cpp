#include "type_support.hpp"

#include <fastcdr/Cdr.h>
#include <rcutils/error_handling.h>
#include <rosidl_typesupport_fastrtps_cpp/message_type_support.h>
#include <rosidl_typesupport_fastrtps_cpp/service_type_support.h>

#include <cstring>
#include <map>
#include <mutex>
#include <stdexcept>

namespace plane {
namespace {

using eprosima::fastcdr::Cdr;

constexpr const char * kFastDds = "rosidl_typesupport_fastrtps_c";

// Cdr knows where its bytes end, and does not tell. Asking by jump() makes it enlarge a buffer of its own, which those of services are. An
// explicit instantiation may name private members; should another Fast CDR call them otherwise, this does not compile.
using Place = eprosima::fastcdr::FastBuffer::iterator Cdr::*;
struct CdrPlaces {
  Place here, end;
};
CdrPlaces places_of_cdr();
template <Place kHere, Place kEnd>
struct Reach {
  friend CdrPlaces places_of_cdr() { return {kHere, kEnd}; }
};
template struct Reach<&Cdr::offset_, &Cdr::end_>;

size_t bytes_left(const Cdr & cdr) {
  const CdrPlaces places = places_of_cdr();
  return static_cast<size_t>(cdr.*places.end - cdr.*places.here);
}

bool serialize(const void * message, Cdr & cdr) {
  const auto & outgoing = *static_cast<const Outgoing *>(message);
  auto * payload = reinterpret_cast<uint8_t *>(cdr.get_current_position());
  if (!cdr.jump(outgoing.cdr_size)) return false;
  write_cdr(*outgoing.program, outgoing.ros1, outgoing.ros1_size, payload);
  return true;
}

bool deserialize(Cdr & cdr, void * message) {
  auto & incoming = *static_cast<Incoming *>(message);
  incoming.touched = true;
  if (cdr.endianness() != Cdr::Endianness::LITTLE_ENDIANNESS) return true;  // not good: what we speak is little-endian
  if (!incoming.wanted) {
    incoming.good = true;
    return true;
  }
  const auto * payload = reinterpret_cast<const uint8_t *>(cdr.get_current_position());
  const size_t left = bytes_left(cdr);
  const size_t size = ros1_size(*incoming.program, payload, left);
  if (size == SIZE_MAX) return true;
  const auto length = static_cast<uint32_t>(size);
  incoming.frame->reserve(sizeof length + size);
  incoming.frame->set_size(sizeof length + size);
  std::memcpy(incoming.frame->data(), &length, sizeof length);
  write_ros1(*incoming.program, payload, left, incoming.sequence, incoming.frame->data() + sizeof length);
  incoming.good = true;
  return true;
}

uint32_t serialized_size(const void * message) { return static_cast<uint32_t>(static_cast<const Outgoing *>(message)->cdr_size); }

size_t most_bytes(char & bounds_info) {
  bounds_info = ROSIDL_TYPESUPPORT_FASTRTPS_UNBOUNDED_TYPE;
  return 0;
}

struct BytesTypeSupport {
  rosidl_message_type_support_t handle;  // first, so that its address is that of the whole
  message_type_support_callbacks_t callbacks;
  const rosidl_message_type_support_t * genuine;
};

// Everything but the bytes, such as the introspection that tells peers what the type looks like, is the genuine type's.
const rosidl_message_type_support_t * find_handle(const rosidl_message_type_support_t * ours, const char * identifier) {
  if (std::strcmp(identifier, ours->typesupport_identifier) == 0) return ours;
  return get_message_typesupport_handle(reinterpret_cast<const BytesTypeSupport *>(ours)->genuine, identifier);
}

struct BytesServiceTypeSupport {
  rosidl_service_type_support_t handle;  // first, as above
  service_type_support_callbacks_t callbacks;
  const rosidl_service_type_support_t * genuine;
};

const rosidl_service_type_support_t * find_service_handle(const rosidl_service_type_support_t * ours, const char * identifier) {
  if (std::strcmp(identifier, ours->typesupport_identifier) == 0) return ours;
  return get_service_typesupport_handle(reinterpret_cast<const BytesServiceTypeSupport *>(ours)->genuine, identifier);
}

}  // namespace

const rosidl_message_type_support_t * bytes_type_support(const rosidl_message_type_support_t * genuine) {
  static std::mutex mutex;
  static auto & kept = *new std::map<const rosidl_message_type_support_t *, BytesTypeSupport>();
  std::lock_guard<std::mutex> lock(mutex);
  if (const auto found = kept.find(genuine); found != kept.end()) return &found->second.handle;
  const auto * specific = get_message_typesupport_handle(genuine, kFastDds);
  if (specific == nullptr) {
    rcutils_reset_error();
    throw std::runtime_error("the type has no type support for Fast DDS");
  }
  const auto & theirs = *static_cast<const message_type_support_callbacks_t *>(specific->data);
  BytesTypeSupport & made = kept[genuine];
  made.callbacks = theirs;
  made.callbacks.cdr_serialize = serialize;
  made.callbacks.cdr_deserialize = deserialize;
  made.callbacks.get_serialized_size = serialized_size;
  made.callbacks.max_serialized_size = most_bytes;
  made.handle = *specific;
  made.handle.data = &made.callbacks;
  made.handle.func = find_handle;
  made.genuine = genuine;
  return &made.handle;
}

const rosidl_service_type_support_t * bytes_service_type_support(const rosidl_service_type_support_t * genuine) {
  static std::mutex mutex;
  static auto & kept = *new std::map<const rosidl_service_type_support_t *, BytesServiceTypeSupport>();
  std::lock_guard<std::mutex> lock(mutex);
  if (const auto found = kept.find(genuine); found != kept.end()) return &found->second.handle;
  const auto * specific = get_service_typesupport_handle(genuine, kFastDds);
  if (specific == nullptr) {
    rcutils_reset_error();
    throw std::runtime_error("the type has no type support for Fast DDS");
  }
  const auto * request = bytes_type_support(genuine->request_typesupport);
  const auto * response = bytes_type_support(genuine->response_typesupport);
  BytesServiceTypeSupport & made = kept[genuine];
  made.callbacks = *static_cast<const service_type_support_callbacks_t *>(specific->data);
  made.callbacks.request_members_ = request;
  made.callbacks.response_members_ = response;
  made.handle = *specific;
  made.handle.data = &made.callbacks;
  made.handle.func = find_service_handle;
  made.handle.request_typesupport = request;
  made.handle.response_typesupport = response;
  made.genuine = genuine;
  return &made.handle;
}

}  // namespace plane
