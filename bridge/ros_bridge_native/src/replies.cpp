#include "replies.hpp"

#include <cstring>
#include <utility>

namespace plane {
namespace {

constexpr size_t kMostKnown = 256;
// Each takes the 100 ms that rmw waits for a client that it sees but is not connected to; one that has gone is not waited for.
constexpr int kTries = 20, kLastTries = 3;

Gid gid_of(const rmw_request_id_t & request_id) {
  Gid gid{};
  static_assert(sizeof request_id.writer_guid <= sizeof gid);
  std::memcpy(gid.data(), request_id.writer_guid, sizeof request_id.writer_guid);
  return gid;
}

}  // namespace

Replies::Replies(Context & context, const ServiceSpecification & specification, const Ros2Service & service, Counters & counters)
: context_(context), specification_(specification), service_(service), counters_(counters) {}

void Replies::answer(const rmw_request_id_t & request_id, Frame bytes, size_t offset, int64_t start_ns) {
  send_soon({request_id, std::move(bytes), offset, start_ns});
}

void Replies::refuse(const rmw_request_id_t & request_id, const std::string & reason) {
  counters_.errors.fetch_add(1);
  const std::string text = specification_.ros2_service + " by the bridge: " + reason;
  context_.events.put(EventKind::kCallFailed, specification_.token, text);
  if (specification_.refusal.has_flag) send_soon({request_id, refusal_frame(specification_.refusal, text), sizeof(uint32_t), 0});
}

void Replies::send_soon(Reply reply) {
  const Gid client = gid_of(reply.request_id);
  if (!defers_ || (reply.bytes->size() <= kLargeBytes && known_.count(client))) return send(reply);
  if (known_.size() >= kMostKnown) known_.clear();
  known_.insert(client);
  {
    std::lock_guard<std::mutex> lock(slow_mutex_);
    slow_.push_back(std::move(reply));
  }
  context_.calls.schedule(this);
}

void Replies::send(const Reply & reply) {
  const uint8_t * bytes = reply.bytes->data() + reply.offset;
  const size_t size = reply.bytes->size() - reply.offset;
  const Outgoing response{&specification_.response, bytes, size, cdr_size(specification_.response, bytes, size)};
  bool sent = service_.answer(response, reply.request_id);
  for (int i = 1; !sent && i < (defers_ ? kTries : kLastTries); ++i) sent = service_.answer(response, reply.request_id);
  if (reply.start_ns == 0) return;
  if (sent) counters_.crossed(reply.start_ns, size);
  else counters_.errors.fetch_add(1);
}

void Replies::work() {
  while (true) {
    Reply next;
    {
      std::lock_guard<std::mutex> lock(slow_mutex_);
      if (slow_.empty()) return;
      next = std::move(slow_.front());
      slow_.pop_front();
    }
    send(next);
  }
}

void Replies::finish() {
  context_.calls.forget(this);
  work();
}

}  // namespace plane
