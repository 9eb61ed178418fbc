#include "services_in_ros1.hpp"

#include <algorithm>
#include <utility>

namespace plane {
namespace {

constexpr size_t kConcurrentCalls = 16;
constexpr size_t kWaitingCalls = 32;
constexpr size_t kMostPosted = 256;
constexpr size_t kRequestHeadBytes = sizeof(uint32_t);
// After that the master is asked again: the service may have moved to another node.
constexpr int64_t kReuseWithinNs = 2'000'000'000;
// How long the last answers may take to their clients. A server that is no more takes back what they have not got yet.
constexpr int64_t kFarewellNs = 200'000'000;
constexpr const char * kNotAsked = "the ROS master has not answered, asked";

}  // namespace

ServiceInRos1::ServiceInRos1(Context & context, ServiceSpecification specification)
: context_(context), specification_(std::move(specification)), timer_(std::make_shared<Timer>(context.loop, [this] { look(); })),
  service_(std::make_unique<Ros2Service>(specification_.node, specification_.type, specification_.ros2_service)),
  replies_(context, specification_, *service_, counters) {
  timer_->begin();
  try {
    service_->listen([this](size_t) { take_requests(); });
  } catch (...) {
    timer_->end();
    throw;
  }
}

ServiceInRos1::~ServiceInRos1() {
  service_->stop_listening();
  bool answered = false;
  context_.loop.run_and_wait([&] {
    closed_ = true;
    answered = !calls_.empty();
    replies_.stop_deferring();
    timer_->end();
    while (!calls_.empty()) fail(calls_.begin(), kBridgeEnds);
    for (const auto & connections : {idle_, attempts_}) {
      for (const auto & connection : connections) connection->drop();
    }
  });
  replies_.finish();
  context_.loop.run_and_wait([] {});  // what was posted meanwhile
  context_.python.forget(specification_.token);
  if (answered) service_->wait_for_arrival(kFarewellNs);
}

// In a thread of DDS; in the loop's when it had too many. DDS keeps or drops requests that are not taken.
void ServiceInRos1::take_requests() {
  while (true) {
    if (posted_.load() >= kMostPosted) {
      left_over_ = true;
      if (posted_.load() >= kMostPosted || !left_over_.exchange(false)) return;
    }
    Frame frame = pool_->get();
    Incoming incoming{&specification_.request, frame.get(), sequence_.load() + 1, true};
    rmw_request_id_t request_id{};
    const int64_t start_ns = now_ns();
    service_->take(incoming, request_id);
    if (!incoming.touched) return;
    ++sequence_;
    ++posted_;
    if (!incoming.good) frame.reset();
    context_.loop.post([this, request_id, frame = std::move(frame), start_ns] {
      on_request(request_id, frame, start_ns);
      if (--posted_ == 0 && !closed_ && left_over_.exchange(false)) take_requests();
    });
  }
}

void ServiceInRos1::on_request(const rmw_request_id_t & request_id, Frame request, int64_t start_ns) {
  if (closed_) return replies_.refuse(request_id, kBridgeEnds);
  if (!request) return replies_.refuse(request_id, "the request is none of " + specification_.ros1.type);
  if (calls_.size() >= kConcurrentCalls + kWaitingCalls) {
    const std::string calls = std::to_string(kConcurrentCalls + kWaitingCalls) + " calls";
    return replies_.refuse(request_id, "the bridge has " + calls + " of this service waiting");
  }
  if (calls_.empty()) problem_ = kNotAsked;
  const uint64_t number = next_number_++;
  const int64_t deadline_ns = start_ns + specification_.timeout_ns;
  Call & call = calls_.emplace_hint(calls_.end(), number, Call{request_id, nullptr, start_ns, deadline_ns, nullptr})->second;
  if (specification_.converts) {
    context_.python.put({specification_.token, PythonKind::kRequest, number, start_ns, "", std::move(request), kRequestHeadBytes}, SIZE_MAX);
  } else {
    call.request = std::move(request);
    waiting_.push_back(number);
    begin_waiting();
  }
  look_again();
}

void ServiceInRos1::on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) {
  context_.loop.post([this, kind = message.kind, number = message.number, frame = framed(bytes, size), problem] {
    const auto call = calls_.find(number);
    if (call == calls_.end()) return;  // its time was over
    if (!problem.empty()) {
      fail(call, "it can't be converted: " + problem);
    } else if (kind == PythonKind::kRequest) {
      call->second.request = frame;
      waiting_.push_back(number);
    } else {
      on_good_answer(call, frame, kRequestHeadBytes);
    }
    begin_waiting();
    look_again();
  });
}

// Begin what waits: over idle connections, and where there is none over new ones.
void ServiceInRos1::begin_waiting() {
  while (!waiting_.empty() && begin_one(waiting_.front())) waiting_.pop_front();
  if (closed_ || attempts_.size() >= wanted_attempts()) return;
  if (now_ns() < place_until_ns_) return attempt();
  if (asked_ || now_ns() < ask_after_ns_) return;
  asked_ = true;
  context_.events.put(EventKind::kNeedsServer, specification_.token, "");
}

size_t ServiceInRos1::wanted_attempts() const {
  const size_t busy = calls_.size() - waiting_.size();
  return busy >= kConcurrentCalls ? 0 : std::min(waiting_.size(), kConcurrentCalls - busy);
}

void ServiceInRos1::attempt() {
  while (now_ns() < place_until_ns_ && attempts_.size() < wanted_attempts()) {
    attempts_.push_back(std::make_shared<CallConnection>(context_.loop, *this, specification_.ros1, context_.caller_id));
    const auto begun = attempts_.back();
    begun->begin(address_, port_);
  }
}

bool ServiceInRos1::begin_one(uint64_t number) {
  Call & call = calls_.at(number);
  while (!idle_.empty()) {
    const auto connection = std::move(idle_.back());
    idle_.pop_back();
    call.connection = connection;
    connection->call_number = number;
    if (connection->call(call.request)) {
      call.request.reset();
      return true;
    }
    call.connection = nullptr;
  }
  return false;
}

void ServiceInRos1::found(const std::string & address, uint16_t port) {
  context_.loop.post([this, address, port] {
    asked_ = false;
    problem_ = "no server";
    address_ = address;
    port_ = port;
    place_until_ns_ = now_ns() + kLookEveryNs;
    begin_waiting();
    look_again();
  });
}

void ServiceInRos1::not_found(const std::string & reason) {
  context_.loop.post([this, reason] {
    asked_ = false;
    problem_ = reason;
    ask_after_ns_ = now_ns() + kLookEveryNs;
  });
}

void ServiceInRos1::on_open(const std::shared_ptr<CallConnection> & connection) {
  attempts_.erase(std::remove(attempts_.begin(), attempts_.end(), connection), attempts_.end());
  idle_.push_back(connection);
  begin_waiting();
  look_again();
}

ServiceInRos1::Calls::iterator ServiceInRos1::of(const CallConnection & connection) {
  const auto call = calls_.find(connection.call_number);
  return call != calls_.end() && call->second.connection.get() == &connection ? call : calls_.end();
}

void ServiceInRos1::on_answer(const std::shared_ptr<CallConnection> & connection, bool good, Frame answer) {
  const auto call = of(*connection);
  if (connection->open()) idle_.push_back(connection);
  if (call != calls_.end()) {
    const auto * payload = answer->data() + kAnswerHeadBytes;
    const size_t size = answer->size() - kAnswerHeadBytes;
    if (!good) {
      fail(call, std::string(reinterpret_cast<const char *>(payload), size));
    } else if (specification_.converts) {
      call->second.connection = nullptr;
      context_.python.put(
        {specification_.token, PythonKind::kResponse, call->first, call->second.start_ns, "", std::move(answer), kAnswerHeadBytes}, SIZE_MAX);
    } else {
      on_good_answer(call, std::move(answer), kAnswerHeadBytes);
    }
  }
  begin_waiting();
  look_again();
}

void ServiceInRos1::on_good_answer(Calls::iterator call, Frame answer, size_t offset) {
  if (cdr_size(specification_.response, answer->data() + offset, answer->size() - offset) == SIZE_MAX) {
    return fail(call, "the answer is none of " + specification_.ros1.type);
  }
  const Call done = std::move(call->second);
  calls_.erase(call);
  replies_.answer(done.request_id, std::move(answer), offset, done.start_ns);
}

void ServiceInRos1::on_lost(const std::shared_ptr<CallConnection> & connection, Loss loss, const std::string & reason) {
  for (auto * connections : {&idle_, &attempts_}) {
    connections->erase(std::remove(connections->begin(), connections->end(), connection), connections->end());
  }
  if (closed_) return;
  if (loss != Loss::kIdle) place_until_ns_ = 0;  // the server may be gone from there
  if (loss == Loss::kUnreachable || loss == Loss::kRefused) ask_after_ns_ = now_ns() + kLookEveryNs;
  if (loss == Loss::kUnreachable) problem_ = "no server can be reached: " + reason;
  if (loss == Loss::kRefused && !waiting_.empty()) fail(calls_.find(waiting_.front()), reason);
  const auto call = loss == Loss::kInCall ? of(*connection) : calls_.end();
  if (call != calls_.end()) fail(call, reason);
  if (loss == Loss::kInCall) begin_waiting();
  look_again();
}

void ServiceInRos1::fail(Calls::iterator call, const std::string & reason) {
  const Call failed = std::move(call->second);
  waiting_.erase(std::remove(waiting_.begin(), waiting_.end(), call->first), waiting_.end());
  calls_.erase(call);
  if (failed.connection && failed.connection->calling()) failed.connection->drop();  // no caller waits for its answer any more
  end_spare_attempts();
  replies_.refuse(failed.request_id, reason);
}

void ServiceInRos1::end_spare_attempts() {
  while (attempts_.size() > waiting_.size()) {
    attempts_.front()->drop();
    attempts_.erase(attempts_.begin());
  }
}

std::string ServiceInRos1::why_late(const Call & call) const {
  if (call.connection) return "the server has not answered";
  if (calls_.size() - waiting_.size() >= kConcurrentCalls) return std::to_string(kConcurrentCalls) + " calls before it have not ended";
  return problem_ + " for " + specification_.ros1.service + " in ROS 1";
}

// End calls whose time is over and connections that have not been used lately; look for a server for those that wait.
void ServiceInRos1::look() {
  const int64_t now = now_ns();
  while (!calls_.empty() && calls_.begin()->second.deadline_ns <= now) {
    fail(calls_.begin(), "timed out: " + why_late(calls_.begin()->second));
  }
  const auto old = std::stable_partition(idle_.begin(), idle_.end(), [&](const auto & one) { return now - one->used_ns < kReuseWithinNs; });
  for (auto one = old; one != idle_.end(); ++one) (*one)->drop();
  idle_.erase(old, idle_.end());
  begin_waiting();
  look_again();
}

void ServiceInRos1::look_again() {
  if (closed_) return;
  int64_t next = INT64_MAX;
  if (!calls_.empty()) next = std::min(now_ns() + kLookEveryNs, calls_.begin()->second.deadline_ns);
  for (const auto & one : idle_) next = std::min(next, one->used_ns + kReuseWithinNs);
  if (next != INT64_MAX) timer_->at(next);
}

}  // namespace plane
