#include "services_in_ros2.hpp"

#include <algorithm>
#include <utility>

namespace plane {
namespace {

constexpr size_t kRequestOffset = sizeof(uint32_t);
constexpr size_t kMostEarly = 256;

}  // namespace

ServiceInRos2::ServiceInRos2(Context & context, ServiceSpecification specification)
: context_(context), specification_(std::move(specification)),
  client_(std::make_unique<Ros2Client>(specification_.node, specification_.type, specification_.ros2_service)),
  timer_(std::make_shared<Timer>(context.loop, [this] { look(); })) {
  client_->listen([this](size_t number) { on_responses(number); });
  timer_->begin();
  context_.server->offer_service(*this);
}

ServiceInRos2::~ServiceInRos2() {
  client_->stop_listening();
  context_.loop.run_and_wait([this] {
    closed_ = true;
    timer_->end();
    context_.server->withdraw_service(*this);
    while (!calls_.empty()) fail(calls_.begin(), kBridgeEnds);
    const auto connections = connections_;
    for (const auto & connection : connections) connection->shut();
  });
  context_.calls.forget(this);
  context_.loop.run_and_wait([] {});  // what the worker has posted before
  context_.python.forget(specification_.token);
}

void ServiceInRos2::on_open(const std::shared_ptr<ServiceConnection> & connection) {
  connections_.insert(connection);
  counters.peers = connections_.size();
}

void ServiceInRos2::on_closed(const std::shared_ptr<ServiceConnection> & connection) {
  connections_.erase(connection);
  counters.peers = connections_.size();
  const auto call = std::find_if(calls_.begin(), calls_.end(), [&](const auto & entry) { return entry.second.connection == connection; });
  if (call == calls_.end()) return;
  numbers_.erase(call->second.sequence);
  calls_.erase(call);
}

void ServiceInRos2::on_request(const std::shared_ptr<ServiceConnection> & connection, Frame request) {
  const int64_t now = now_ns();
  const auto call = calls_.emplace_hint(calls_.end(), next_number_++, Call{connection, nullptr, now, now + specification_.timeout_ns});
  if (closed_) return fail(call, kBridgeEnds);
  if (!specification_.converts) return on_good_request(call, std::move(request));
  context_.python.put({specification_.token, PythonKind::kRequest, call->first, now, "", std::move(request), kRequestOffset}, SIZE_MAX);
  look_again();
}

void ServiceInRos2::on_good_request(Calls::iterator call, Frame request) {
  if (cdr_size(specification_.request, request->data() + kRequestOffset, request->size() - kRequestOffset) == SIZE_MAX) {
    return fail(call, "the request is none of " + specification_.ros1.type);
  }
  call->second.request = std::move(request);
  if (client_->ready()) hand_on(call);
  look_again();
}

void ServiceInRos2::on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) {
  context_.loop.post([this, kind = message.kind, number = message.number, frame = framed(bytes, size), problem] {
    const auto call = calls_.find(number);
    if (call == calls_.end()) return;  // its client has gone, or its time was over
    if (!problem.empty()) fail(call, "it can't be converted: " + problem);
    else if (kind == PythonKind::kRequest) on_good_request(call, frame);
    else answer(call, frame);
  });
}

// Large requests are the worker's, so that their copies hold up nothing else.
void ServiceInRos2::hand_on(Calls::iterator call) {
  const Frame request = std::move(call->second.request);
  if (request->size() <= kLargeBytes) return on_sent(call->first, send(request));
  ++with_worker_;
  {
    std::lock_guard<std::mutex> lock(large_mutex_);
    large_.emplace_back(call->first, request);
  }
  context_.calls.schedule(this);
}

void ServiceInRos2::work() {
  while (true) {
    std::pair<uint64_t, Frame> next;
    {
      std::lock_guard<std::mutex> lock(large_mutex_);
      if (large_.empty()) return;
      next = std::move(large_.front());
      large_.pop_front();
    }
    const int64_t sequence = send(next.second);
    context_.loop.post([this, number = next.first, sequence] {
      --with_worker_;
      on_sent(number, sequence);
      if (with_worker_ == 0) early_.clear();
    });
  }
}

int64_t ServiceInRos2::send(const Frame & request) const {
  const uint8_t * bytes = request->data() + kRequestOffset;
  const size_t size = request->size() - kRequestOffset;
  return client_->send({&specification_.request, bytes, size, cdr_size(specification_.request, bytes, size)});
}

void ServiceInRos2::on_sent(uint64_t number, int64_t sequence) {
  const auto call = calls_.find(number);
  if (call == calls_.end()) return;  // its client has gone, or its time was over
  if (sequence < 0) return fail(call, "the request could not be sent in ROS 2");
  call->second.sequence = sequence;
  numbers_[sequence] = number;
  const auto early = early_.find(sequence);
  if (early != early_.end()) finish(call, std::exchange(early->second, nullptr));
}

// In a thread of DDS.
void ServiceInRos2::on_responses(size_t number) {
  for (size_t i = 0; i < number; ++i) {
    Frame frame = pool_->get();
    Incoming incoming{&specification_.response, frame.get(), 0, true};
    const int64_t sequence = client_->take(incoming);
    if (!incoming.touched) continue;  // another client's
    if (!incoming.good) frame.reset();
    context_.loop.post([this, sequence, frame = std::move(frame)] { on_response(sequence, frame); });
  }
}

void ServiceInRos2::on_response(int64_t sequence, const Frame & response) {
  const auto number = numbers_.find(sequence);
  if (number == numbers_.end()) {
    if (with_worker_ && early_.size() < kMostEarly) early_[sequence] = response;
    return;
  }
  finish(calls_.find(number->second), response);
}

void ServiceInRos2::finish(Calls::iterator call, const Frame & response) {
  if (!response) return fail(call, "the response is none of " + specification_.ros1.type);
  if (!specification_.converts) return answer(call, response);
  numbers_.erase(std::exchange(call->second.sequence, -1));
  context_.python.put(
    {specification_.token, PythonKind::kResponse, call->first, call->second.start_ns, "", response, kRequestOffset}, SIZE_MAX);
}

void ServiceInRos2::answer(Calls::iterator call, const Frame & response) {
  const Call done = std::move(call->second);
  numbers_.erase(done.sequence);
  calls_.erase(call);
  counters.crossed(done.start_ns, response->size());
  done.connection->answer(true, response);
}

void ServiceInRos2::fail(Calls::iterator call, const std::string & reason) {
  const Call failed = std::move(call->second);
  numbers_.erase(failed.sequence);
  calls_.erase(call);
  counters.errors.fetch_add(1);
  const std::string text = specification_.ros1.service + " by the bridge: " + reason;
  context_.events.put(EventKind::kCallFailed, specification_.token, text);
  failed.connection->answer(false, framed(text.data(), text.size()));
}

// While there are calls: end those whose time is over or whose server has gone, and begin those whose server has come.
void ServiceInRos2::look() {
  const int64_t now = now_ns();
  const std::string late = "timed out: ";
  while (!calls_.empty() && calls_.begin()->second.deadline_ns <= now) {
    const bool waits = calls_.begin()->second.request != nullptr;
    fail(calls_.begin(), late + (waits ? "no server for " + specification_.ros2_service + " in ROS 2" : "the server in ROS 2 has not answered"));
  }
  const bool ready = !calls_.empty() && client_->ready();
  for (auto next = calls_.begin(); next != calls_.end();) {
    const auto call = next++;
    if (ready && call->second.request) hand_on(call);
    else if (!ready && call->second.sequence >= 0) fail(call, "the server in ROS 2 ended in the call");
  }
  look_again();
}

void ServiceInRos2::look_again() {
  if (!calls_.empty()) timer_->at(std::min(now_ns() + kLookEveryNs, calls_.begin()->second.deadline_ns));
}

}  // namespace plane
