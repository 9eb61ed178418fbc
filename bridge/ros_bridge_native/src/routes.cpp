#include "routes.hpp"

#include <algorithm>
#include <cstring>
#include <functional>
#include <string_view>

namespace plane {
namespace {

constexpr size_t kMostWaitingBytes = 64u << 20;
constexpr size_t kRoom = 1000, kRoomPerDepth = 10;  // small messages of a backlog
constexpr size_t kMostWriters = 64;
constexpr size_t kMostSendersFollowed = 256;
constexpr size_t kDigestedBytes = 256;  // the beginning, where a header with its number and stamp is

uint64_t digest(const uint8_t * message, size_t size) {
  const std::string_view beginning(reinterpret_cast<const char *>(message), std::min(size, kDigestedBytes));
  return std::hash<std::string_view>{}(beginning) ^ (size * 0x9e3779b97f4a7c15u);
}

}  // namespace

void Route::count_bad(Events & events, uint64_t token, const std::string & from) {
  const uint64_t number = counters.errors.fetch_add(1) + 1;
  if (number % 1000 == 1) events.put(EventKind::kBadMessage, token, "message " + std::to_string(number) + " from " + from);
}

Ros1ToRos2Route::Ros1ToRos2Route(Context & context, Specification specification)
: context_(context), specification_(std::move(specification)), pace_(specification_.quality.depth) {
  if (specification_.node != nullptr) writers_.push_back({make_writer(), "", false});
}

Ros1ToRos2Route::~Ros1ToRos2Route() {
  context_.loop.run_and_wait([this] {
    const auto connections = connections_;
    for (const auto & [token, connection] : connections) connection->shut("the route ends");
  });
  context_.upward.forget(this);
  context_.python.forget(specification_.token);
}

// What DDS loses on its way to a reader, such as one that gets no processor, it sends again on request, which takes it 10 ms and more: of
// a fast topic, `depth` messages would be gone by then. So the writer keeps as many as may wait in a burst; DDS lets go of each when all
// readers have it. What is latched goes to late joiners, who are promised `depth`.
Quality Ros1ToRos2Route::writer_quality() const {
  Quality quality = specification_.quality;
  if (!quality.latched && !specification_.bulky) quality.depth = room();
  return quality;
}

std::unique_ptr<Ros2Publisher> Ros1ToRos2Route::make_writer() const {
  return std::make_unique<Ros2Publisher>(specification_.node, specification_.type, specification_.ros2_topic, writer_quality());
}

void Ros1ToRos2Route::connect(uint64_t token, const std::string & address, uint16_t port) {
  context_.loop.run_and_wait([&] {
    const auto connection = std::make_shared<InConnection>(
      context_.loop, context_.events, *this, specification_.ros1, context_.caller_id, token);
    connections_[token] = connection;
    connection->begin(address, port);
  });
}

// Each latching publisher has a writer of its own, so that late joiners get the last message of each of them. The writer of one that has
// gone is kept for the next: what was written with it may still be on its way.
bool Ros1ToRos2Route::on_open(InConnection & connection) {
  const bool replaces = replace_older(connection);
  count_peers();
  if (replaces || !specification_.quality.latched) return true;
  std::lock_guard<std::mutex> lock(writers_mutex_);
  auto chosen = std::find_if(writers_.begin(), writers_.end(), [&](auto & writer) { return !writer.taken && writer.peer == connection.peer; });
  if (chosen == writers_.end()) chosen = std::find_if(writers_.begin(), writers_.end(), [](auto & writer) { return !writer.taken; });
  if (chosen == writers_.end()) {
    if (writers_.size() >= kMostWriters) return true;
    context_.events.put(EventKind::kNeedsWriter, connection.token, connection.peer);
    return false;
  }
  chosen->taken = true;
  chosen->peer = connection.peer;
  connection.writer = static_cast<size_t>(chosen - writers_.begin());
  return true;
}

// A publisher sends a topic on one connection to us, and on a second one since it was missed. On the first may come, late, what it has sent
// while it was away; so that is kept until something comes on the second. What both bring crosses once, and nothing old after something new.
bool Ros1ToRos2Route::replace_older(InConnection & newer) {
  InConnection * latest = nullptr;
  const auto connections = connections_;
  for (const auto & [token, connection] : connections) {
    if (connection.get() == &newer || !connection->open() || newer.peer.empty() || connection->peer != newer.peer) continue;
    if (latest != nullptr) latest->shut("it has connected again");
    latest = connection.get();
  }
  if (latest == nullptr) return false;
  newer.replaces = true;
  newer.writer = latest->writer;
  return true;
}

// Return whether a message has not come on an older connection of the same publisher already; end that.
bool Ros1ToRos2Route::is_new(InConnection & connection, const uint8_t * message, size_t size) {
  connection.last = digest(message, size);
  if (!connection.replaces) return true;
  connection.replaces = false;
  bool is_new = true;
  const auto connections = connections_;
  for (const auto & [token, other] : connections) {
    if (other->token >= connection.token || other->peer != connection.peer || !other->open()) continue;
    if (other->last == connection.last) is_new = false;
    other->shut("it has connected again");
  }
  return is_new;
}

size_t Ros1ToRos2Route::late_peers() { return late_; }

void Ros1ToRos2Route::grant(uint64_t token) {
  auto made = make_writer();
  context_.loop.run_and_wait([&] {
    const auto found = connections_.find(token);
    if (found == connections_.end()) return;
    const auto connection = found->second;
    {
      std::lock_guard<std::mutex> lock(writers_mutex_);
      connection->writer = writers_.size();
      writers_.push_back({std::move(made), connection->peer, true});
    }
    connection->resume();
  });
}

size_t Ros1ToRos2Route::target_peers() {
  std::lock_guard<std::mutex> lock(writers_mutex_);
  return writers_.empty() ? 0 : writers_.front().publisher->peers();
}

size_t Ros1ToRos2Route::room() const { return std::max(kRoom, kRoomPerDepth * specification_.quality.depth); }

void Ros1ToRos2Route::on_small(InConnection & connection, const uint8_t * message, size_t size) {
  if (!is_new(connection, message, size)) return;
  if (!through_python() && under_way_.load(std::memory_order_acquire) == 0) return publish(connection.writer, message, size, now_ns());
  Frame copy = pool_->get();
  copy->reserve(std::max<size_t>(size, 1));
  if (size) std::memcpy(copy->data(), message, size);
  copy->set_size(size);
  queue(connection, std::move(copy));
}

void Ros1ToRos2Route::on_large(InConnection & connection, Frame message) {
  if (is_new(connection, message->data(), message->size())) queue(connection, std::move(message));
}

void Ros1ToRos2Route::queue(InConnection & connection, Frame message) {
  if (through_python()) return hand_to_python(connection.writer, std::move(message));
  const size_t size = std::max<size_t>(message->size(), 1);
  const size_t most = std::max<size_t>(2, std::min(specification_.quality.depth, kMostWaitingBytes / size));
  {
    std::lock_guard<std::mutex> lock(large_mutex_);
    while (large_.size() >= most) {
      large_.pop_front();
      under_way_.fetch_sub(1);
      counters.dropped_overrun.fetch_add(1);
    }
    under_way_.fetch_add(1);
    large_.push_back({std::move(message), connection.writer, now_ns()});
  }
  context_.upward.schedule(this);
}

void Ros1ToRos2Route::hand_to_python(size_t writer, Frame message) {
  const size_t gone = context_.python.put(
    {specification_.token, PythonKind::kMessage, writer, now_ns(), "", std::move(message), 0}, specification_.quality.depth);
  if (gone) counters.dropped_overrun.fetch_add(gone);
}

void Ros1ToRos2Route::on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) {
  if (!problem.empty()) return count_bad(context_.events, specification_.token, specification_.ros1.topic + ": " + problem);
  publish(message.number, bytes, size, message.start_ns);
}

void Ros1ToRos2Route::on_closed(InConnection & connection) {
  {
    std::lock_guard<std::mutex> lock(writers_mutex_);
    std::vector<std::shared_ptr<InConnection>> left;
    for (const auto & [token, other] : connections_) {
      if (other.get() != &connection && other->open() && other->peer == connection.peer) left.push_back(other);
    }
    if (left.size() == 1) left.front()->replaces = false;
    if (left.empty() && connection.writer < writers_.size() && writers_[connection.writer].peer == connection.peer) {
      writers_[connection.writer].taken = false;
    }
  }
  connections_.erase(connection.token);
  count_peers();
}

void Ros1ToRos2Route::count_peers() {
  size_t heard = 0, late = 0;
  for (const auto & [token, connection] : connections_) {
    if (!connection->heard()) continue;
    ++heard;
    if (connection->replaces) ++late;
  }
  late_ = late;
  counters.peers = heard - std::min(heard, late);
}

void Ros1ToRos2Route::work() {
  while (true) {
    Large next;
    {
      std::lock_guard<std::mutex> lock(large_mutex_);
      if (large_.empty()) return;
      next = std::move(large_.front());
      large_.pop_front();
    }
    publish(next.writer, next.message->data(), next.message->size(), next.arrived_ns);
    under_way_.fetch_sub(1, std::memory_order_release);
  }
}

void Ros1ToRos2Route::publish(size_t writer, const uint8_t * message, size_t size, int64_t arrived_ns) {
  Ros2Publisher * publisher;
  {
    std::lock_guard<std::mutex> lock(writers_mutex_);
    publisher = writers_[writer].publisher.get();
  }
  if (publisher->publish(specification_.program, message, size)) {
    counters.crossed(arrived_ns, size);
  } else {
    count_bad(context_.events, specification_.token, specification_.ros1.topic);
  }
}

Ros2ToRos1Route::Ros2ToRos1Route(Context & context, Specification specification)
: context_(context), specification_(std::move(specification)),
  publisher_(std::make_shared<Ros1Publisher>(specification_.ros1, specification_.quality.latched, specification_.quality.depth, counters)) {
  context_.server->offer(publisher_);
}

Ros2ToRos1Route::~Ros2ToRos1Route() {
  if (subscription_) subscription_->stop_listening();
  context_.downward.forget(this);
  subscription_.reset();
  context_.python.forget(specification_.token);
  context_.server->withdraw(publisher_);
}

void Ros2ToRos1Route::start() {
  subscription_ = std::make_unique<Ros2Subscription>(
    specification_.node, specification_.type, specification_.ros2_topic, specification_.quality);
  subscription_->listen([this] { on_arrived(); });
}

void Ros2ToRos1Route::on_arrived() {
  if (large_.load(std::memory_order_acquire)) return context_.downward.schedule(this);
  drain();
}

void Ros2ToRos1Route::drain() {
  while (true) {
    const int64_t start_ns = now_ns();
    Frame frame = pool_->get();
    Incoming incoming{&specification_.program, frame.get(), sequence_ + 1, publisher_->wanted()};
    Sender sender;
    subscription_->take(incoming, sender);
    if (!incoming.touched) return;
    count_missed(sender);
    if (!incoming.good) {
      count_bad(context_.events, specification_.token, specification_.ros2_topic);
      continue;
    }
    ++sequence_;
    const std::string from(sender.gid.begin(), sender.gid.end());
    if (specification_.converts) {
      if (incoming.wanted) hand_to_python(start_ns, from, std::move(frame));
      continue;
    }
    if (incoming.wanted) publisher_->publish(frame, from);
    counters.crossed(start_ns, frame->size());
    if (!large_ && frame->size() > kLargeBytes) {
      large_.store(true, std::memory_order_release);
      return context_.downward.schedule(this);
    }
  }
}

void Ros2ToRos1Route::hand_to_python(int64_t start_ns, const std::string & sender, Frame message) {
  const size_t gone = context_.python.put(
    {specification_.token, PythonKind::kMessage, 0, start_ns, sender, std::move(message), sizeof(uint32_t)}, specification_.quality.depth);
  if (gone) counters.dropped_overrun.fetch_add(gone);
}

void Ros2ToRos1Route::on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) {
  if (!problem.empty()) return count_bad(context_.events, specification_.token, specification_.ros2_topic + ": " + problem);
  publish(bytes, size, message.sender);
  counters.crossed(message.start_ns, size);
}

void Ros2ToRos1Route::publish(const uint8_t * bytes, size_t size, const std::string & sender) {
  publisher_->publish(framed(bytes, size), sender);
}

// What DDS let go before it was taken shows as a gap in the sender's numbers.
void Ros2ToRos1Route::count_missed(const Sender & sender) {
  if (last_sequence_.size() >= kMostSendersFollowed && !last_sequence_.count(sender.gid)) last_sequence_.clear();
  uint64_t & last = last_sequence_[sender.gid];
  if (last && sender.sequence > last + 1) counters.dropped_overrun.fetch_add(sender.sequence - last - 1);
  last = std::max(last, sender.sequence);
}

}  // namespace plane
