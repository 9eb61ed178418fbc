// What Python calls (native.py) for services.
#include "c_api.hpp"
#include "services_in_ros1.hpp"
#include "services_in_ros2.hpp"

using namespace plane;

// The same, field by field, in native.py.
struct PlaneServiceSpecification {
  const char * ros1_service;
  const char * ros1_type;
  const char * md5sum;
  const char * ros2_service;
  void * node;
  const void * type_support;
  const uint32_t * request_program;
  uint64_t request_operations;
  const uint32_t * response_program;
  uint64_t response_operations;
  int64_t timeout_ns;
  uint64_t token;
  int32_t converts;
  int32_t refusal_has_flag;
  int32_t refusal_has_text;
  const char * refusal_before;
  uint64_t refusal_before_bytes;
  const char * refusal_after;
  uint64_t refusal_after_bytes;
};

namespace {

ServiceSpecification specification_of(const PlaneServiceSpecification & from) {
  return {{from.ros1_service, from.ros1_type, from.md5sum}, from.ros2_service, static_cast<rcl_node_t *>(from.node),
    bytes_service_type_support(static_cast<const rosidl_service_type_support_t *>(from.type_support)),
    program_of(from.request_program, from.request_operations), program_of(from.response_program, from.response_operations), from.timeout_ns,
    {from.refusal_has_flag != 0, from.refusal_has_text != 0, {from.refusal_before, from.refusal_before_bytes},
      {from.refusal_after, from.refusal_after_bytes}},
    from.token, from.converts != 0};
}

}  // namespace

PLANE_API void * plane_service_in_ros1_new(void * context, const PlaneServiceSpecification * specification) {
  return guarded<void *>(nullptr, [&]() -> Route * {
    return new ServiceInRos1(*static_cast<Context *>(context), specification_of(*specification));
  });
}

PLANE_API void * plane_service_in_ros2_new(void * context, const PlaneServiceSpecification * specification) {
  return guarded<void *>(nullptr, [&]() -> Route * {
    return new ServiceInRos2(*static_cast<Context *>(context), specification_of(*specification));
  });
}

PLANE_API void plane_service_found(void * route, const char * address, uint16_t port) {
  static_cast<ServiceInRos1 *>(static_cast<Route *>(route))->found(address, port);
}

PLANE_API void plane_service_not_found(void * route, const char * reason) {
  static_cast<ServiceInRos1 *>(static_cast<Route *>(route))->not_found(reason);
}
