#include "ros1_service_server.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "layout.hpp"
#include "ros1_subscription.hpp"

namespace plane {
namespace {

constexpr size_t kFewBytes = 4096;
constexpr size_t kLengthBytes = sizeof(uint32_t);

bool says_yes(const Fields & header, const char * name) {
  const auto found = header.find(name);
  return found != header.end() && (found->second == "1" || found->second == "true" || found->second == "True");
}

}  // namespace

ServiceConnection::ServiceConnection(Loop & loop, ServiceHandler & handler, int fd, const Fields & header)
: loop_(loop), handler_(handler), fd_(fd), persistent_(says_yes(header, "persistent")) {}

ServiceConnection::~ServiceConnection() { ::close(fd_); }

void ServiceConnection::begin(const std::string & caller_id, const Fields & header, const uint8_t * rest, size_t rest_bytes) {
  const ServiceIdentity & own = handler_.identity();
  const std::string greeting = encode({{"callerid", caller_id}, {"md5sum", own.md5sum}, {"request_type", own.type + "Request"},
    {"response_type", own.type + "Response"}, {"service", own.service}, {"type", own.type}});
  watched_ = EPOLLIN | EPOLLRDHUP;
  key_ = loop_.add(fd_, shared_from_this(), watched_, true);
  handler_.on_open(shared_from_this());
  // A fresh socket takes a header of any sensible length at once.
  const ssize_t written = send(fd_, greeting.data(), greeting.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (written != static_cast<ssize_t>(greeting.size()) || says_yes(header, "probe")) return shut();
  received_->reserve(std::max(rest_bytes, kFewBytes));
  std::memcpy(received_->data(), rest, rest_bytes);
  received_->set_size(rest_bytes);
  take_requests();
}

void ServiceConnection::on_ready(uint32_t epoll_events) {
  if (epoll_events & EPOLLOUT) flush();
  if (closed_) return;
  if (calling_) {
    // One that has gone does not wait for its answer any more; one that sends its next request already does.
    if (epoll_events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) return shut();
    if (epoll_events & EPOLLIN) watch(watched_ & ~EPOLLIN);
    return;
  }
  if (epoll_events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR)) receive();
}

bool ServiceConnection::on_tick(int64_t now) {
  if (!closed_) life_.look(fd_, now);
  return !closed_;
}

void ServiceConnection::receive() {
  make_room();
  const ssize_t number = recv(fd_, received_->data() + received_->size(), received_->capacity() - received_->size(), MSG_DONTWAIT);
  if (number < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (number <= 0) return shut();
  received_->set_size(received_->size() + static_cast<size_t>(number));
  take_requests();
}

// What a length promises is not believed: the room grows with what has come.
void ServiceConnection::make_room() {
  if (received_->size() < received_->capacity()) return;
  const size_t promised = received_->size() < kLengthBytes ? kFewBytes : kLengthBytes + length_at(received_->data());
  received_->reserve(std::max(kFewBytes, std::min(promised, std::max(2 * received_->size(), kLargeBytes))));
  if (received_->size() == received_->capacity()) received_->reserve(received_->size() + kFewBytes);
}

void ServiceConnection::take_requests() {
  if (taking_) return;  // an answer was given at once: the loop below goes on
  taking_ = true;
  const auto keep_alive = shared_from_this();
  while (!closed_ && !calling_ && received_->size() >= kLengthBytes) {
    const size_t bytes = kLengthBytes + length_at(received_->data());
    if (bytes > kMostBytes) shut();
    if (closed_ || received_->size() < bytes) break;
    calling_ = true;
    handler_.on_request(shared_from_this(), cut_request(bytes));
  }
  taking_ = false;
}

// The first request goes with its memory; what came behind it is copied.
Frame ServiceConnection::cut_request(size_t bytes) {
  const Frame request = std::move(received_);
  const size_t rest = request->size() - bytes;
  received_ = std::make_shared<Buffer>();
  received_->reserve(std::max(rest, kFewBytes));
  std::memcpy(received_->data(), request->data() + bytes, rest);
  received_->set_size(rest);
  request->set_size(bytes);
  return request;
}

void ServiceConnection::answer(bool good, Frame body) {
  if (closed_) return;
  good_ = good ? 1 : 0;
  body_ = std::move(body);
  sent_ = 0;
  flush();
}

void ServiceConnection::flush() {
  if (!body_) return;
  while (body_) {
    iovec parts[] = {{&good_, 1}, {body_->data(), body_->size()}};
    const size_t skipped = sent_ == 0 ? 0 : 1;
    if (skipped) parts[1] = {body_->data() + sent_ - 1, body_->size() - (sent_ - 1)};
    msghdr message{};
    message.msg_iov = parts + skipped;
    message.msg_iovlen = 2 - skipped;
    const ssize_t written = sendmsg(fd_, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno == EAGAIN) return watch(watched_ | EPOLLOUT);
    if (written < 0) return shut();
    sent_ += static_cast<size_t>(written);
    if (sent_ == body_->size() + 1) body_.reset();
  }
  calling_ = false;
  if (!persistent_) return shut();
  watch(EPOLLIN | EPOLLRDHUP);
  take_requests();
}

void ServiceConnection::watch(uint32_t epoll_events) {
  if (epoll_events == watched_) return;
  watched_ = epoll_events;
  loop_.change(key_, fd_, watched_);
}

void ServiceConnection::shut() {
  if (closed_) return;
  closed_ = true;
  loop_.remove(key_, fd_);
  ::shutdown(fd_, SHUT_RDWR);
  handler_.on_closed(shared_from_this());
}

}  // namespace plane
