// What Python calls (native.py): topics, and what all routes share. Every function catches everything; what failed is told by
// plane_error, for the thread that asked.
#include "c_api.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "routes.hpp"
#include "type_support.hpp"

using namespace plane;

namespace plane {

Program program_of(const uint32_t * words, size_t operations) {
  Program program;
  for (size_t i = 0; i < operations; ++i, words += 4) program.push_back({static_cast<Code>(words[0]), words[1], words[2], words[3]});
  if (!valid(program)) throw std::runtime_error("the layout program is not well formed");
  return program;
}

}  // namespace plane

// The structures are the same, field by field, in native.py.
struct PlaneSpecification {
  const char * ros1_topic;
  const char * ros1_type;
  const char * md5sum;
  const char * definition;
  const char * ros2_topic;
  void * node;
  const void * type_support;
  uint64_t depth;
  const uint32_t * program;
  uint64_t operations;
  uint64_t token;
  int32_t reliable;
  int32_t latched;
  int32_t converts;
  int32_t bulky;
};

struct PlaneFigures {
  uint64_t count;
  uint64_t bytes;
  uint64_t errors;
  uint64_t dropped_slow;
  uint64_t dropped_overrun;
  uint64_t peers;
  uint32_t bins[kBins];
};

// What Python receives or converts. The bytes are valid until plane_python_done.
struct PlanePythonMessage {
  void * message;
  uint64_t token;
  int32_t kind;
  const uint8_t * bytes;
  uint64_t size;
};

struct PlaneEvent {
  int32_t kind;
  uint64_t token;
  char text[plane::kMostEventBytes];
  int32_t size;
};

namespace {

Specification specification_of(const PlaneSpecification & from) {
  const auto * type = static_cast<const rosidl_message_type_support_t *>(from.type_support);
  return {{from.ros1_topic, from.ros1_type, from.md5sum, from.definition}, from.ros2_topic, static_cast<rcl_node_t *>(from.node),
    type == nullptr ? nullptr : bytes_type_support(type), {from.depth, from.reliable != 0, from.latched != 0},
    program_of(from.program, from.operations), from.token, from.converts != 0, from.bulky != 0};
}

}  // namespace

PLANE_API const char * plane_error() { return last_error.c_str(); }

PLANE_API void * plane_new(const char * caller_id, const char * address) {
  return guarded<void *>(nullptr, [&] {
    auto context = std::make_unique<Context>(caller_id);
    context->server->listen_on(address);
    return context.release();
  });
}

// All routes have to be deleted before.
PLANE_API void plane_delete(void * context) {
  static_cast<Context *>(context)->server->close();
  delete static_cast<Context *>(context);
}

PLANE_API int32_t plane_port(void * context) { return static_cast<Context *>(context)->server->port(); }

PLANE_API int32_t plane_next_event(void * context, int32_t timeout_ms, PlaneEvent * out) {
  Event event;
  if (!static_cast<Context *>(context)->events.next(timeout_ms, event)) return 0;
  out->kind = static_cast<int32_t>(event.kind);
  out->token = event.token;
  out->size = static_cast<int32_t>(std::min(event.text.size(), sizeof out->text));
  std::memcpy(out->text, event.text.data(), out->size);
  return 1;
}

PLANE_API void * plane_ros1_to_ros2_new(void * context, const PlaneSpecification * specification) {
  return guarded<void *>(nullptr, [&]() -> Route * { return new Ros1ToRos2Route(*static_cast<Context *>(context), specification_of(*specification)); });
}

PLANE_API int32_t plane_connect_publisher(void * route, uint64_t token, const char * address, uint16_t port) {
  return guarded(0, [&] {
    static_cast<Ros1ToRos2Route *>(static_cast<Route *>(route))->connect(token, address, port);
    return 1;
  });
}

PLANE_API int32_t plane_add_writer(void * route, uint64_t token) {
  return guarded(0, [&] {
    static_cast<Ros1ToRos2Route *>(static_cast<Route *>(route))->grant(token);
    return 1;
  });
}

PLANE_API void * plane_ros2_to_ros1_new(void * context, const PlaneSpecification * specification) {
  return guarded<void *>(nullptr, [&]() -> Route * { return new Ros2ToRos1Route(*static_cast<Context *>(context), specification_of(*specification)); });
}

PLANE_API int32_t plane_ros2_to_ros1_start(void * route) {
  return guarded(0, [&] {
    static_cast<Ros2ToRos1Route *>(static_cast<Route *>(route))->start();
    return 1;
  });
}

PLANE_API void plane_publish(void * route, const uint8_t * bytes, uint64_t size) {
  static_cast<Ros2ToRos1Route *>(static_cast<Route *>(route))->publish(bytes, size, "");
}

PLANE_API int32_t plane_python_next(void * context, int32_t timeout_ms, PlanePythonMessage * out) {
  auto message = static_cast<Context *>(context)->python.next(timeout_ms);
  if (!message) return 0;
  const Buffer & bytes = *message->bytes;
  *out = {nullptr, message->token, static_cast<int32_t>(message->kind), bytes.data() + message->offset, bytes.size() - message->offset};
  out->message = message.release();
  return 1;
}

// Hand back a message that Python has converted, or say why it could not.
PLANE_API void plane_python_converted(void * route, void * message, const uint8_t * bytes, uint64_t size, const char * problem) {
  static_cast<Route *>(route)->on_converted(*static_cast<PythonMessage *>(message), bytes, size, problem);
}

PLANE_API void plane_python_done(void * message) { delete static_cast<PythonMessage *>(message); }

PLANE_API void plane_end_older_connections(void * context, const char * subscriber) {
  auto & all = *static_cast<Context *>(context);
  all.loop.run_and_wait([&] { end_older(*all.server, subscriber); });
}

// Have plane_python_next return at once from here on.
PLANE_API void plane_python_close(void * context) { static_cast<Context *>(context)->python.close(); }

PLANE_API void plane_route_delete(void * route) { delete static_cast<Route *>(route); }

PLANE_API uint64_t plane_route_target_peers(void * route) { return static_cast<Route *>(route)->target_peers(); }

PLANE_API uint64_t plane_route_source_peers(void * route) { return static_cast<Route *>(route)->source_peers(); }

PLANE_API uint64_t plane_route_late_peers(void * route) { return static_cast<Route *>(route)->late_peers(); }

PLANE_API void plane_route_figures(void * route, PlaneFigures * out) {
  const Counters & counters = static_cast<Route *>(route)->counters;
  out->count = counters.count;
  out->bytes = counters.bytes;
  out->errors = counters.errors;
  out->dropped_slow = counters.dropped_slow;
  out->dropped_overrun = counters.dropped_overrun;
  out->peers = counters.peers;
  for (int i = 0; i < kBins; ++i) out->bins[i] = counters.bins[i];
}

// For tests of the layout programs: convert, and return the size, or -1 if the bytes are no message. `out` may be null to only measure.
PLANE_API int64_t plane_to_cdr(const uint32_t * words, uint64_t operations, const uint8_t * ros1, uint64_t size, uint8_t * out) {
  return guarded<int64_t>(-2, [&]() -> int64_t {
    const Program program = program_of(words, operations);
    const size_t needed = cdr_size(program, ros1, size);
    if (needed == SIZE_MAX) return -1;
    if (out != nullptr) write_cdr(program, ros1, size, out);
    return static_cast<int64_t>(needed);
  });
}

PLANE_API int64_t plane_to_ros1(const uint32_t * words, uint64_t operations, const uint8_t * cdr, uint64_t size, uint32_t sequence, uint8_t * out) {
  return guarded<int64_t>(-2, [&]() -> int64_t {
    const Program program = program_of(words, operations);
    const size_t needed = ros1_size(program, cdr, size);
    if (needed == SIZE_MAX) return -1;
    if (out != nullptr) write_ros1(program, cdr, size, sequence, out);
    return static_cast<int64_t>(needed);
  });
}
