#include "ros1_subscription.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "counters.hpp"
#include "layout.hpp"
#include "sockets.hpp"

namespace plane {
namespace {

constexpr size_t kReadBytes = kLargeBytes + sizeof(uint32_t);
constexpr size_t kMostRoomBytes = size_t{1} << 20;  // for small messages that wait
constexpr int kMostReads = 64;                      // of one connection in a row

}  // namespace

InConnection::InConnection(Loop & loop, Events & events, Inbox & inbox, const TopicIdentity & identity, const std::string & caller_id,
                           uint64_t token_)
: token(token_), loop_(loop), events_(events), inbox_(inbox),
  greeting_(encode({{"callerid", caller_id}, {"md5sum", identity.md5sum}, {"message_definition", identity.definition},
    {"tcp_nodelay", "1"}, {"topic", identity.topic}, {"type", identity.type}})),
  identity_(identity), born_ns_(now_ns()) {}

InConnection::~InConnection() {
  if (fd_ >= 0) ::close(fd_);
}

void InConnection::begin(const std::string & address, uint16_t port) {
  const Place place(address, port);
  if (!place.known()) return shut("no such address: " + address);
  fd_ = socket(place.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) return shut(std::strerror(errno));
  set_options(fd_);
  const int code = connect(fd_, place.address(), place.size());
  if (code != 0 && errno != EINPROGRESS) return shut(std::strerror(errno));
  key_ = loop_.add(fd_, shared_from_this(), EPOLLOUT, true);
}

void InConnection::on_ready(uint32_t) {
  if (state_ == State::kConnecting) return on_connected();
  receive();
}

bool InConnection::on_tick(int64_t now) {
  if (state_ == State::kClosed) return false;
  if (state_ == State::kOpen) {
    const bool was_silent = life_.silent(), was_missed = life_.missed();
    life_.look(fd_, now);
    if (life_.silent() != was_silent) inbox_.on_heard();
    if (life_.missed() && !was_missed) events_.put(EventKind::kMissed, token, peer);
    return true;
  }
  if (now - born_ns_ < (state_ == State::kConnecting ? kConnectNs : kHandshakeNs)) return true;
  shut(state_ == State::kConnecting ? "no connection within 1.5 s" : "no connection header within 5 s");
  return false;
}

void InConnection::on_connected() {
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) return shut(std::strerror(error));
  // A fresh socket takes a header of any sensible length at once.
  const ssize_t written = send(fd_, greeting_.data(), greeting_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (written != static_cast<ssize_t>(greeting_.size())) return shut("the connection header could not be sent");
  state_ = State::kHeader;
  loop_.change(key_, fd_, EPOLLIN);
}

// Returns whether there may be more to receive.
bool InConnection::receive() {
  uint8_t * to;
  size_t room;
  if (large_) {
    to = large_->data() + large_->size();
    room = large_bytes_ - large_->size();
  } else {
    received_.reserve(kReadBytes);
    if (received_.size() == received_.capacity()) make_room();
    if (received_.size() == received_.capacity()) return false;
    to = received_.data() + received_.size();
    room = received_.capacity() - received_.size();
  }
  const ssize_t number = recv(fd_, to, room, MSG_DONTWAIT);
  if (number < 0 && (errno == EAGAIN || errno == EINTR)) return false;
  if (number <= 0) {
    const char * reason = number == 0 ? "the publisher has closed the connection" : std::strerror(errno);
    if (!rests_) {
      shut(reason);
    } else {  // what it has sent before crosses first
      end_ = reason;
      loop_.remove(std::exchange(key_, 0), fd_);
    }
    return false;
  }
  if (large_) {
    large_->set_size(large_->size() + number);
    if (large_->size() == large_bytes_) end_large();
    return true;
  }
  received_.set_size(received_.size() + number);
  if (state_ == State::kHeader) take_header();
  if (state_ == State::kOpen && !rests_) take_messages();
  return static_cast<size_t>(number) == room;
}

void InConnection::make_room() {
  if (received_.capacity() < kMostRoomBytes) return received_.reserve(std::min(2 * received_.capacity(), kMostRoomBytes));
  skip_oldest(waiting() / 2);
}

// Count the messages that are here as a whole.
size_t InConnection::waiting() const {
  size_t number = 0;
  for (size_t at = 0; (at = behind_message(at)) != 0;) ++number;
  return number;
}

// Return where the message ends that begins there, or 0 if it is not here as a whole.
size_t InConnection::behind_message(size_t at) const {
  if (received_.size() - at < sizeof(uint32_t)) return 0;
  const size_t length = length_at(received_.data() + at);
  return received_.size() - at - sizeof(uint32_t) < length ? 0 : at + sizeof(uint32_t) + length;
}

void InConnection::skip_oldest(size_t kept) {
  const size_t all = waiting();
  if (all <= kept) return;
  size_t done = 0;
  for (size_t i = kept; i < all; ++i) done = behind_message(done);
  std::memmove(received_.data(), received_.data() + done, received_.size() - done);
  received_.set_size(received_.size() - done);
  inbox_.on_skipped(all - kept);
}

void InConnection::take_header() {
  if (received_.size() < sizeof(uint32_t)) return;
  const uint32_t length = length_at(received_.data());
  if (length > kMostHeaderBytes) return shut("what it sent is no connection header", EventKind::kRefused);
  const size_t whole = sizeof length + length;
  received_.reserve(whole + kReadBytes);
  if (received_.size() < whole) return;
  Fields fields;
  if (!decode(received_.data() + sizeof length, length, fields)) {
    return shut("what it sent is no connection header", EventKind::kRefused);
  }
  if (fields.count("error")) return shut("it refuses: " + fields["error"], EventKind::kRefused);
  const std::string reason = mismatch(fields, identity_);
  if (!reason.empty()) return shut(reason, EventKind::kRefused);
  std::memmove(received_.data(), received_.data() + whole, received_.size() - whole);
  received_.set_size(received_.size() - whole);
  peer = fields["callerid"];
  state_ = State::kOpen;
  const bool at_once = inbox_.on_open(*this);
  events_.put(EventKind::kConnected, token, peer);
  if (!at_once) {
    state_ = State::kHeader;
    loop_.change(key_, fd_, 0);
  }
}

void InConnection::resume() {
  if (state_ != State::kHeader) return;
  state_ = State::kOpen;
  loop_.change(key_, fd_, EPOLLIN);
  take_messages();
}

void InConnection::take_messages() {
  const auto keep_alive = shared_from_this();
  size_t done = 0;
  while (state_ == State::kOpen && received_.size() - done >= sizeof(uint32_t)) {
    const uint8_t * message = received_.data() + done;
    const size_t length = length_at(message);
    if (length > kMostBytes) return shut("a message of " + std::to_string(length) + " bytes: that can't be");
    if (length > kLargeBytes) {
      std::memmove(received_.data(), message, received_.size() - done);
      received_.set_size(received_.size() - done);
      done = 0;
      if (!begin_large()) return;
      continue;
    }
    if (received_.size() - done < sizeof(uint32_t) + length) break;
    if (!inbox_.ready()) {
      rests_ = true;
      loop_.rest(shared_from_this());
      loop_.change(key_, fd_, 0);  // a flood is read once a rest, not once a message: its receivers need the processor
      break;
    }
    inbox_.on_small(*this, message + sizeof(uint32_t), length);
    done += sizeof(uint32_t) + length;
  }
  if (done == 0) return;
  std::memmove(received_.data(), received_.data() + done, received_.size() - done);
  received_.set_size(received_.size() - done);
}

void InConnection::on_rested() {
  if (state_ != State::kOpen) return;
  for (int i = 0; i < kMostReads && end_.empty() && receive(); ++i) {}
  rests_ = false;
  skip_oldest(inbox_.room());
  take_messages();
  if (rests_ || state_ != State::kOpen) return;
  if (end_.empty()) loop_.change(key_, fd_, EPOLLIN);
  else shut(end_);
}

// The received bytes begin with a large message: move it to a buffer of its own. Returns whether it was there as a whole.
bool InConnection::begin_large() {
  large_bytes_ = length_at(received_.data());
  const size_t here = std::min(received_.size() - sizeof(uint32_t), large_bytes_);
  large_ = inbox_.buffer();
  large_->reserve(large_bytes_);
  std::memcpy(large_->data(), received_.data() + sizeof(uint32_t), here);
  large_->set_size(here);
  const size_t used = sizeof(uint32_t) + here;
  std::memmove(received_.data(), received_.data() + used, received_.size() - used);
  received_.set_size(received_.size() - used);
  if (large_->size() < large_bytes_) return false;
  end_large();
  return true;
}

void InConnection::end_large() {
  inbox_.on_large(*this, std::move(large_));
  large_.reset();
}

void InConnection::shut(const std::string & reason, EventKind kind) {
  if (state_ == State::kClosed) return;
  const auto keep_alive = shared_from_this();
  state_ = State::kClosed;
  if (key_) loop_.remove(key_, fd_);
  inbox_.on_closed(*this);
  events_.put(kind, token, reason);
}

}  // namespace plane
