#include "routes.hpp"

#include <algorithm>
#include <cstring>

namespace plane {
namespace {

constexpr size_t kMostWaitingBytes = 64u << 20;
constexpr size_t kMostWriters = 64;
constexpr size_t kMostSendersFollowed = 256;

}  // namespace

void Route::count_bad(Events & events, uint64_t token, const std::string & from) {
  const uint64_t number = counters.errors.fetch_add(1) + 1;
  if (number % 1000 == 1) events.put(EventKind::kBadMessage, token, "message " + std::to_string(number) + " from " + from);
}

UpRoute::UpRoute(Machinery & machinery, Specification specification)
: machinery_(machinery), specification_(std::move(specification)), tokens_(static_cast<double>(specification_.quality.depth)) {
  writers_.push_back({make_writer(), "", false});
}

UpRoute::~UpRoute() {
  machinery_.loop.run_and_wait([this] {
    const auto connections = connections_;
    for (const auto & [token, connection] : connections) connection->shut("the route ends");
  });
  machinery_.upward.forget(this);
}

std::unique_ptr<Ros2Publisher> UpRoute::make_writer() const {
  return std::make_unique<Ros2Publisher>(specification_.node, specification_.type, specification_.ros2_topic, specification_.quality);
}

void UpRoute::connect(uint64_t token, const std::string & address, uint16_t port) {
  machinery_.loop.run_and_wait([&] {
    const auto connection = std::make_shared<InConnection>(
      machinery_.loop, machinery_.events, *this, specification_.ros1, machinery_.caller_id, token);
    connections_[token] = connection;
    connection->begin(address, port);
  });
}

void UpRoute::disconnect(uint64_t token) {
  machinery_.loop.run_and_wait([&] {
    const auto found = connections_.find(token);
    if (found == connections_.end()) return;
    const auto connection = found->second;
    connection->shut("the publisher is gone");
  });
}

// Each latching publisher has a writer of its own, so that late joiners get the last message of each of them. The writer of one that has
// gone is kept for the next: what was written with it may still be on its way.
bool UpRoute::on_open(InConnection & connection) {
  count_peers();
  if (!specification_.quality.latched) return true;
  std::lock_guard<std::mutex> lock(writers_mutex_);
  auto chosen = std::find_if(writers_.begin(), writers_.end(), [&](auto & writer) { return !writer.taken && writer.peer == connection.peer; });
  if (chosen == writers_.end()) chosen = std::find_if(writers_.begin(), writers_.end(), [](auto & writer) { return !writer.taken; });
  if (chosen == writers_.end()) {
    if (writers_.size() >= kMostWriters) return true;
    machinery_.events.put(EventKind::kNeedsWriter, connection.token, connection.peer);
    return false;
  }
  chosen->taken = true;
  chosen->peer = connection.peer;
  connection.writer = static_cast<size_t>(chosen - writers_.begin());
  return true;
}

void UpRoute::grant(uint64_t token) {
  auto made = make_writer();
  machinery_.loop.run_and_wait([&] {
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

size_t UpRoute::target_peers() {
  std::lock_guard<std::mutex> lock(writers_mutex_);
  return writers_.front().publisher->peers();
}

// At most `depth` messages a millisecond go out. A burst, such as what has piled up while this process had no processor, would push older
// messages out of the queues of ROS 2's subscribers, which are mostly as deep, before they are scheduled to take them.
bool UpRoute::ready() {
  const auto most = static_cast<double>(specification_.quality.depth);
  const int64_t now = now_ns();
  tokens_ = std::min(most, tokens_ + static_cast<double>(now - tokens_at_ns_) * 1e-6 * most);
  tokens_at_ns_ = now;
  if (tokens_ < 1.0) return false;
  tokens_ -= 1.0;
  return true;
}

void UpRoute::on_small(InConnection & connection, const uint8_t * message, size_t size) {
  if (under_way_.load(std::memory_order_acquire) == 0) return publish(connection.writer, message, size, now_ns());
  Frame copy = pool_->get();
  copy->reserve(std::max<size_t>(size, 1));
  if (size) std::memcpy(copy->data(), message, size);
  copy->set_size(size);
  on_large(connection, std::move(copy));
}

void UpRoute::on_large(InConnection & connection, Frame message) {
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
  machinery_.upward.schedule(this);
}

void UpRoute::on_closed(InConnection & connection) {
  {
    std::lock_guard<std::mutex> lock(writers_mutex_);
    if (connection.writer < writers_.size() && writers_[connection.writer].peer == connection.peer) writers_[connection.writer].taken = false;
  }
  connections_.erase(connection.token);
  count_peers();
}

void UpRoute::count_peers() {
  counters.peers = connections_.size();
  counters.latching = std::count_if(connections_.begin(), connections_.end(), [](const auto & entry) { return entry.second->latching; });
}

void UpRoute::work() {
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

void UpRoute::publish(size_t writer, const uint8_t * message, size_t size, int64_t arrived_ns) {
  Ros2Publisher * publisher;
  {
    std::lock_guard<std::mutex> lock(writers_mutex_);
    publisher = writers_[writer].publisher.get();
  }
  if (publisher->publish(specification_.program, message, size)) {
    counters.crossed(arrived_ns, size);
  } else {
    count_bad(machinery_.events, specification_.token, specification_.ros1.topic);
  }
}

DownRoute::DownRoute(Machinery & machinery, Specification specification)
: machinery_(machinery), specification_(std::move(specification)),
  publisher_(std::make_shared<Ros1Publisher>(specification_.ros1, specification_.quality.latched, specification_.quality.depth, counters)) {
  machinery_.server->offer(publisher_);
}

DownRoute::~DownRoute() {
  if (subscription_) subscription_->stop_listening();
  machinery_.downward.forget(this);
  subscription_.reset();
  machinery_.server->withdraw(publisher_);
}

void DownRoute::start() {
  subscription_ = std::make_unique<Ros2Subscription>(
    specification_.node, specification_.type, specification_.ros2_topic, specification_.quality);
  subscription_->listen([this] { on_arrived(); });
}

void DownRoute::on_arrived() {
  if (large_.load(std::memory_order_acquire)) return machinery_.downward.schedule(this);
  drain();
}

void DownRoute::drain() {
  while (true) {
    const int64_t start_ns = now_ns();
    Frame frame = pool_->get();
    Incoming incoming{&specification_.program, frame.get(), sequence_ + 1, publisher_->wanted()};
    Sender sender;
    subscription_->take(incoming, sender);
    if (!incoming.touched) return;
    count_missed(sender);
    if (!incoming.good) {
      count_bad(machinery_.events, specification_.token, specification_.ros2_topic);
      continue;
    }
    ++sequence_;
    if (incoming.wanted) publisher_->publish(frame, std::string(sender.gid.begin(), sender.gid.end()));
    counters.crossed(start_ns, frame->size());
    if (!large_ && frame->size() > kLargeBytes) {
      large_.store(true, std::memory_order_release);
      return machinery_.downward.schedule(this);
    }
  }
}

// What DDS let go before it was taken shows as a gap in the sender's numbers.
void DownRoute::count_missed(const Sender & sender) {
  if (last_sequence_.size() >= kMostSendersFollowed && !last_sequence_.count(sender.gid)) last_sequence_.clear();
  uint64_t & last = last_sequence_[sender.gid];
  if (last && sender.sequence > last + 1) counters.dropped_overrun.fetch_add(sender.sequence - last - 1);
  last = std::max(last, sender.sequence);
}

}  // namespace plane
