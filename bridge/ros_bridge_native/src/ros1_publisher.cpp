#include "ros1_publisher.hpp"

#include <sys/epoll.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "liveness.hpp"
#include "ros1_server.hpp"
#include "sockets.hpp"

namespace plane {
namespace {

constexpr int kFramesAtOnce = 64;
constexpr size_t kMostSenders = 256;  // of latched messages that are kept

}  // namespace

// One subscriber: first its connection header is read and answered, then it is sent to. A service's client gets another connection then.
class OutConnection : public Handler, public std::enable_shared_from_this<OutConnection> {
 public:
  OutConnection(std::shared_ptr<Server> server, int fd) : server_(std::move(server)), fd_(fd), born_ns_(now_ns()) {}
  ~OutConnection() override {
    if (fd_ >= 0) ::close(fd_);
  }

  void begin() { key_ = server_->loop.add(fd_, shared_from_this(), EPOLLIN, true); }

  void on_ready(uint32_t epoll_events) override {
    if (epoll_events & EPOLLOUT) on_writable();
    if (epoll_events & (EPOLLIN | EPOLLHUP | EPOLLERR)) on_readable();
  }

  bool on_tick(int64_t now) override {
    if (closed_) return false;
    if (publishers_.empty()) {
      if (now - born_ns_ < kHandshakeNs) return true;
      turn_away("it sent no connection header within 5 s");
      return false;
    }
    const bool was_silent = life_.silent(), was_missed = life_.missed();
    life_.look(fd_, now);
    if (life_.missed() != was_missed && !subscriber_.empty()) server_->events.put(life_.missed() ? EventKind::kUnheard : EventKind::kHeard, 0, subscriber_);
    if (life_.silent() != was_silent) {
      for (const auto & publisher : publishers_) publisher->count();
    }
    return true;
  }

  bool heard() const { return !life_.silent(); }
  const std::string & subscriber() const { return subscriber_; }

  // Any thread. Returns how many queued frames had to go.
  size_t send(const Frame & frame, size_t depth) {
    std::lock_guard<std::mutex> lock(mutex_);
    size_t gone = 0;
    const size_t begun = sent_ || greeting_ ? 1 : 0;
    while (queue_.size() >= depth + begun) {
      queue_.erase(queue_.begin() + begun);
      ++gone;
    }
    queue_.push_back(frame);
    if (!waits_for_room_) flush();
    return gone;
  }

  // The loop's thread only.
  void join(const std::shared_ptr<Ros1Publisher> & publisher) {
    publishers_.push_back(publisher);
    publisher->attach(shared_from_this());
  }

  void leave(const std::shared_ptr<Ros1Publisher> & publisher) {
    publisher->detach(shared_from_this());
    publishers_.erase(std::remove(publishers_.begin(), publishers_.end(), publisher), publishers_.end());
    if (publishers_.empty()) shut();
  }

  void shut() {
    if (closed_) return;
    closed_ = true;
    for (const auto & publisher : publishers_) publisher->detach(shared_from_this());
    if (!subscriber_.empty()) server_->events.put(EventKind::kUnsubscribed, 0, subscriber_ + ' ' + ends_);
    server_->loop.remove(key_, fd_);
    ::shutdown(fd_, SHUT_RDWR);
    std::lock_guard<std::mutex> lock(mutex_);
    broken_ = true;
    queue_.clear();
  }

 private:
  void on_readable() {
    uint8_t bytes[4096];
    const ssize_t number = recv(fd_, bytes, sizeof bytes, MSG_DONTWAIT);
    if (number == 0 || (number < 0 && errno != EAGAIN && errno != EINTR)) return shut();
    if (number > 0 && publishers_.empty()) read_header(bytes, static_cast<size_t>(number));
    // A subscriber has nothing to say after its header; what it says nevertheless is thrown away.
  }

  void read_header(const uint8_t * bytes, size_t number) {
    header_.append(reinterpret_cast<const char *>(bytes), number);
    uint32_t length;
    if (header_.size() < sizeof length) return;
    std::memcpy(&length, header_.data(), sizeof length);
    if (length > kMostHeaderBytes) return turn_away("its connection header would have " + std::to_string(length) + " bytes");
    if (header_.size() < sizeof length + length) return;
    Fields fields;
    if (!decode(reinterpret_cast<const uint8_t *>(header_.data()) + sizeof length, length, fields)) {
      return turn_away("what it sent is no connection header");
    }
    if (fields.count("service")) return hand_over(fields, sizeof length + length);
    const auto publishers = server_->find(fields["topic"]);
    if (publishers.empty()) {
      server_->events.put(EventKind::kNotPublished, 0, header_.substr(sizeof length, kMostEventBytes));
      return turn_away("topic [" + fields["topic"] + "] is not published here");
    }
    const std::string reason = mismatch(fields, publishers.front()->identity);
    if (!reason.empty()) {
      server_->events.put(EventKind::kOtherVersion, 0, header_.substr(sizeof length, kMostEventBytes));
      return turn_away(fields["callerid"] + " on " + fields["topic"] + ": " + reason);
    }
    replace_missed(publishers.front(), fields["callerid"]);
    accept(publishers);
    if (!is_name(fields["callerid"])) return;  // nobody can be asked to connect again
    subscriber_ = fields["topic"] + ' ' + fields["callerid"];
    ends_ = ends_of(fd_);
    server_->events.put(EventKind::kSubscribed, 0, subscriber_);
  }

  static bool is_name(const std::string & text) {
    constexpr size_t most = 200;
    return !text.empty() && text.size() <= most && text.find_first_of(" \t\r\n") == std::string::npos;
  }

  // A subscriber that connects again, as its own end was gone when the network came back, has left its older connection for good.
  void replace_missed(const std::shared_ptr<Ros1Publisher> & publisher, const std::string & name) {
    const std::string same = publisher->identity.topic + ' ' + name;
    for (const auto & older : publisher->connections()) {
      if (older->subscriber_ == same && older->life_.missed()) older->shut();
    }
  }

  // It is a client, not a subscriber.
  void hand_over(const Fields & fields, size_t header_bytes) {
    const std::string & service = fields.at("service");
    ServiceHandler * handler = server_->find_service(service);
    if (handler == nullptr) return turn_away("service [" + service + "] is not provided here");
    const std::string reason = mismatch(fields, handler->identity());
    const auto caller = fields.find("callerid");
    if (!reason.empty()) return turn_away((caller == fields.end() ? "?" : caller->second) + " on " + service + ": " + reason);
    server_->loop.remove(key_, fd_);
    closed_ = true;
    const auto connection = std::make_shared<ServiceConnection>(server_->loop, *handler, std::exchange(fd_, -1), fields);
    connection->begin(server_->caller_id, fields, reinterpret_cast<const uint8_t *>(header_.data()) + header_bytes,
      header_.size() - header_bytes);
  }

  void accept(const std::vector<std::shared_ptr<Ros1Publisher>> & publishers) {
    header_.clear();
    header_.shrink_to_fit();
    const auto & own = publishers.front()->identity;
    const bool latching = std::any_of(publishers.begin(), publishers.end(), [](const auto & publisher) { return publisher->latched; });
    const std::string answer = encode({{"callerid", server_->caller_id}, {"latching", latching ? "1" : "0"},
      {"md5sum", own.md5sum}, {"message_definition", own.definition}, {"topic", own.topic}, {"type", own.type}});
    auto frame = std::make_shared<Buffer>();
    frame->reserve(answer.size());
    std::memcpy(frame->data(), answer.data(), answer.size());
    frame->set_size(answer.size());
    send(frame, 1);
    for (const auto & publisher : publishers) join(publisher);
  }

  void turn_away(const std::string & reason) {
    server_->events.put(EventKind::kBadPeer, 0, reason);
    const std::string answer = encode({{"error", reason}});
    (void)!::send(fd_, answer.data(), answer.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    shut();
  }

  void on_writable() {
    std::lock_guard<std::mutex> lock(mutex_);
    waits_for_room_ = false;
    flush();
    if (!waits_for_room_ && !broken_) server_->loop.change(key_, fd_, EPOLLIN);
  }

  // With the lock: send what the socket takes; ask to be called again if there is more.
  void flush() {
    while (!queue_.empty() && !broken_) {
      iovec parts[kFramesAtOnce];
      const int number = static_cast<int>(std::min<size_t>(queue_.size(), kFramesAtOnce));
      for (int i = 0; i < number; ++i) parts[i] = {queue_[i]->data(), queue_[i]->size()};
      parts[0].iov_base = static_cast<uint8_t *>(parts[0].iov_base) + sent_;
      parts[0].iov_len -= sent_;
      msghdr message{};
      message.msg_iov = parts;
      message.msg_iovlen = number;
      const ssize_t written = sendmsg(fd_, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0 && errno == EAGAIN) {
        waits_for_room_ = true;
        return server_->loop.change(key_, fd_, EPOLLIN | EPOLLOUT);
      }
      if (written < 0) {
        broken_ = true;  // the loop sees the same on its side, and shuts the connection
        return queue_.clear();
      }
      forget_sent(static_cast<size_t>(written));
    }
  }

  void forget_sent(size_t written) {
    sent_ += written;
    while (!queue_.empty() && sent_ >= queue_.front()->size()) {
      sent_ -= queue_.front()->size();
      queue_.pop_front();
      greeting_ = false;
    }
  }

  const std::shared_ptr<Server> server_;
  int fd_;
  const int64_t born_ns_;
  Key key_ = 0;
  bool closed_ = false;
  std::string header_;
  std::string subscriber_;  // its topic and its name
  std::string ends_;        // of the connection: our address, the peer's and its port
  Liveness life_;
  std::vector<std::shared_ptr<Ros1Publisher>> publishers_;  // of its topic
  std::mutex mutex_;
  std::deque<Frame> queue_;
  size_t sent_ = 0;  // bytes of the first frame
  bool greeting_ = true;  // the first frame is our connection header
  bool waits_for_room_ = false;
  bool broken_ = false;
};

Ros1Publisher::Ros1Publisher(TopicIdentity own, bool latched_, size_t depth_, Counters & counters)
: identity(std::move(own)), latched(latched_), depth(depth_), counters_(counters) {}

void Ros1Publisher::publish(const Frame & frame, const std::string & sender) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (latched) keep(frame, sender);
  for (const auto & connection : connections_) {
    const size_t gone = connection->send(frame, depth);
    if (gone) counters_.dropped_slow.fetch_add(gone, std::memory_order_relaxed);
  }
}

void Ros1Publisher::keep(const Frame & frame, const std::string & sender) {
  const auto old = std::find_if(last_.begin(), last_.end(), [&](const auto & entry) { return entry.first == sender; });
  if (old != last_.end()) last_.erase(old);
  if (last_.size() >= kMostSenders) last_.pop_front();
  last_.emplace_back(sender, frame);
}

bool Ros1Publisher::wanted() {
  std::lock_guard<std::mutex> lock(mutex_);
  return latched || !connections_.empty();
}

void Ros1Publisher::attach(const std::shared_ptr<OutConnection> & connection) {
  std::lock_guard<std::mutex> lock(mutex_);
  for (const auto & [sender, frame] : last_) connection->send(frame, kMostSenders + 1);
  connections_.push_back(connection);
  count_heard();
}

void Ros1Publisher::detach(const std::shared_ptr<OutConnection> & connection) {
  std::lock_guard<std::mutex> lock(mutex_);
  connections_.erase(std::remove(connections_.begin(), connections_.end(), connection), connections_.end());
  count_heard();
}

void Ros1Publisher::count() {
  std::lock_guard<std::mutex> lock(mutex_);
  count_heard();
}

void Ros1Publisher::count_heard() {
  counters_.peers = std::count_if(connections_.begin(), connections_.end(), [](const auto & connection) { return connection->heard(); });
}

std::vector<std::shared_ptr<OutConnection>> Ros1Publisher::connections() {
  std::lock_guard<std::mutex> lock(mutex_);
  return connections_;
}

void end_older(Server & server, const std::string & subscriber) {
  const auto publishers = server.find(subscriber.substr(0, subscriber.find(' ')));
  if (publishers.empty()) return;
  auto connections = publishers.front()->connections();  // the newest is the last
  connections.erase(std::remove_if(connections.begin(), connections.end(), [&](const auto & one) { return one->subscriber() != subscriber; }),
    connections.end());
  for (size_t i = 0; i + 1 < connections.size(); ++i) connections[i]->shut();
}

void join(const std::shared_ptr<OutConnection> & connection, const std::shared_ptr<Ros1Publisher> & publisher) { connection->join(publisher); }

void leave(const std::shared_ptr<OutConnection> & connection, const std::shared_ptr<Ros1Publisher> & publisher) {
  connection->leave(publisher);
}

void greet_peer(const std::shared_ptr<Server> & server, int fd) { std::make_shared<OutConnection>(server, fd)->begin(); }

}  // namespace plane
