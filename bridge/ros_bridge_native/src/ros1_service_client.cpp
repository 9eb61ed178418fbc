#include "ros1_service_client.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "counters.hpp"
#include "layout.hpp"
#include "ros1_subscription.hpp"
#include "sockets.hpp"

namespace plane {
namespace {

constexpr size_t kLeastRoom = 4096;

}  // namespace

CallConnection::CallConnection(Loop & loop, CallListener & listener, const ServiceIdentity & identity, const std::string & caller_id)
: loop_(loop), listener_(listener),
  greeting_(encode({{"callerid", caller_id}, {"md5sum", identity.md5sum}, {"persistent", "1"}, {"service", identity.service}})),
  born_ns_(now_ns()) {}

CallConnection::~CallConnection() {
  if (fd_ >= 0) ::close(fd_);
}

void CallConnection::begin(const std::string & address, uint16_t port) {
  place_ = address + ':' + std::to_string(port);
  const Place place(address, port);
  if (!place.known()) return lose(Loss::kUnreachable, "no such address: " + address);
  fd_ = socket(place.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) return lose(Loss::kUnreachable, std::strerror(errno));
  set_options(fd_);
  const int code = connect(fd_, place.address(), place.size());
  if (code != 0 && errno != EINPROGRESS) return lose(Loss::kUnreachable, std::strerror(errno));
  watched_ = EPOLLOUT;
  key_ = loop_.add(fd_, shared_from_this(), watched_, true);
}

bool CallConnection::on_tick(int64_t now) {
  if (state_ == State::kClosed) return false;
  if (state_ == State::kIdle || state_ == State::kCalling) {
    life_.look(fd_, now);
    return true;
  }
  if (now - born_ns_ < (state_ == State::kConnecting ? kConnectNs : kHandshakeNs)) return true;
  if (state_ == State::kConnecting) lose(Loss::kUnreachable, place_ + " does not answer");
  else lose(Loss::kRefused, "no connection to the server at " + place_ + ": no connection header within 5 s");
  return false;
}

void CallConnection::on_ready(uint32_t epoll_events) {
  if (state_ == State::kConnecting) return on_connected();
  const auto keep_alive = shared_from_this();
  if (epoll_events & EPOLLOUT) flush();
  if (state_ != State::kClosed && (epoll_events & (EPOLLIN | EPOLLHUP | EPOLLERR))) receive();
}

void CallConnection::on_connected() {
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) return lose(Loss::kUnreachable, std::strerror(error));
  // A fresh socket takes a header of any sensible length at once.
  const ssize_t written = send(fd_, greeting_.data(), greeting_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (written != static_cast<ssize_t>(greeting_.size())) return lose(Loss::kUnreachable, "the connection header could not be sent");
  state_ = State::kHeader;
  watch(EPOLLIN);
}

void CallConnection::receive() {
  make_room();
  const ssize_t number = recv(fd_, received_->data() + received_->size(), received_->capacity() - received_->size(), MSG_DONTWAIT);
  if (number < 0 && (errno == EAGAIN || errno == EINTR)) return;
  const char * problem = number < 0 ? std::strerror(errno) : nullptr;
  if (state_ == State::kIdle) return lose(Loss::kIdle, "");  // between calls there is nothing to say but goodbye
  if (number <= 0 && state_ == State::kHeader) {
    return lose(Loss::kRefused, "no connection to the server at " + place_ + ": " + (problem ? problem : "it has closed the connection"));
  }
  if (number < 0) return lose(Loss::kInCall, std::string("the server broke the connection in the call: ") + problem);
  if (number == 0) return lose(Loss::kInCall, "the server ended in the call");
  received_->set_size(received_->size() + static_cast<size_t>(number));
  if (state_ == State::kHeader) take_header();
  else take_answer();
}

// What a length promises is not believed: the room grows with what has come.
void CallConnection::make_room() {
  if (received_->size() < received_->capacity()) return;
  received_->reserve(received_->size() < kLeastRoom ? kLeastRoom : std::max(2 * received_->size(), kLargeBytes));
}

void CallConnection::take_header() {
  constexpr size_t kLengthBytes = sizeof(uint32_t);
  if (received_->size() < kLengthBytes) return;
  const uint32_t length = length_at(received_->data());
  const std::string nonsense = "no connection to the server at " + place_ + ": what it sent is no connection header";
  if (length > kMostHeaderBytes) return lose(Loss::kRefused, nonsense);
  if (received_->size() < kLengthBytes + length) return;
  Fields fields;
  if (!decode(received_->data() + kLengthBytes, length, fields)) return lose(Loss::kRefused, nonsense);
  if (fields.count("error")) return lose(Loss::kRefused, "the server refuses the connection: " + fields["error"]);
  if (received_->size() > kLengthBytes + length) return lose(Loss::kRefused, nonsense);  // an answer without a request
  received_->set_size(0);
  state_ = State::kIdle;
  used_ns = now_ns();
  listener_.on_open(shared_from_this());
}

bool CallConnection::call(Frame request) {
  uint8_t byte;
  if (recv(fd_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) >= 0 || (errno != EAGAIN && errno != EINTR)) {
    lose(Loss::kIdle, "");
    return false;
  }
  state_ = State::kCalling;
  request_ = std::move(request);
  sent_ = 0;
  flush();
  return true;
}

void CallConnection::flush() {
  while (request_ && state_ == State::kCalling) {
    const ssize_t written = send(fd_, request_->data() + sent_, request_->size() - sent_, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno == EAGAIN) return watch(EPOLLIN | EPOLLOUT);
    // What the server has said before it closed the connection is read first; then reading tells that it ended.
    if (written < 0) return request_.reset(), watch(EPOLLIN);
    sent_ += static_cast<size_t>(written);
    if (sent_ == request_->size()) request_.reset();
  }
  watch(EPOLLIN);
}

void CallConnection::take_answer() {
  if (received_->size() < kAnswerHeadBytes) return;
  const bool good = received_->data()[0] != 0;
  const size_t whole = kAnswerHeadBytes + length_at(received_->data() + 1);
  if (whole > kMostBytes) return lose(Loss::kInCall, "the server answers with " + std::to_string(whole) + " bytes: that can't be");
  if (received_->size() < whole) return;
  const bool clean = received_->size() == whole && !request_;
  const Frame answer = std::move(received_);
  received_ = std::make_shared<Buffer>();
  answer->set_size(whole);
  state_ = State::kIdle;
  used_ns = now_ns();
  const auto keep_alive = shared_from_this();
  if (!clean) drop();  // it talks more than it was asked
  listener_.on_answer(keep_alive, good, answer);
}

void CallConnection::drop() {
  if (state_ == State::kClosed) return;
  // A request that was given up is not sent again when a network that was away comes back: its close drops what was not acknowledged.
  const linger reset{1, 0};
  if (state_ == State::kCalling) setsockopt(fd_, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
  state_ = State::kClosed;
  if (key_) loop_.remove(key_, fd_);
  if (fd_ >= 0) ::shutdown(fd_, SHUT_RDWR);
}

void CallConnection::lose(Loss loss, const std::string & reason) {
  if (state_ == State::kClosed) return;
  const auto keep_alive = shared_from_this();
  drop();
  listener_.on_lost(keep_alive, loss, reason);
}

void CallConnection::watch(uint32_t epoll_events) {
  if (epoll_events == watched_) return;
  watched_ = epoll_events;
  loop_.change(key_, fd_, watched_);
}

}  // namespace plane
