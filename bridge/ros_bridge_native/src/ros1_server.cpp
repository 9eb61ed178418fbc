#include "ros1_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "sockets.hpp"

namespace plane {

Server::Server(Loop & loop_, Events & events_, std::string caller_id_) : loop(loop_), events(events_), caller_id(std::move(caller_id_)) {}

Server::~Server() {
  if (fd_ >= 0) ::close(fd_);
  if (spare_ >= 0) ::close(spare_);
}

void Server::listen_on(const std::string & address) {
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  spare_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  socklen_t size = sizeof place;
  if (inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1 || bind(fd_, reinterpret_cast<sockaddr *>(&place), sizeof place) != 0 ||
      listen(fd_, SOMAXCONN) != 0 || getsockname(fd_, reinterpret_cast<sockaddr *>(&place), &size) != 0) {
    throw std::runtime_error("can't listen on " + address + ": " + std::strerror(errno));
  }
  port_ = ntohs(place.sin_port);
  key_ = loop.add(fd_, shared_from_this(), EPOLLIN);
}

void Server::close() { loop.run_and_wait([this] { loop.remove(key_, fd_); }); }

void Server::on_ready(uint32_t) {
  const int fd = accept4(fd_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd >= 0) {
    set_options(fd);
    greet_peer(shared_from_this(), fd);
  } else if (errno == EMFILE || errno == ENFILE) {
    ::close(spare_);
    ::close(accept(fd_, nullptr, nullptr));
    spare_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
    events.put(EventKind::kBadPeer, 0, "this process has no file descriptors left; a subscriber was turned away");
  }
}

std::shared_ptr<Ros1Publisher> Server::find(const std::string & topic) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = publishers_.find(topic);
  return found == publishers_.end() ? nullptr : found->second;
}

void Server::offer(const std::shared_ptr<Ros1Publisher> & publisher) {
  std::lock_guard<std::mutex> lock(mutex_);
  publishers_[publisher->identity.topic] = publisher;
}

void Server::withdraw(const std::shared_ptr<Ros1Publisher> & publisher) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    const auto found = publishers_.find(publisher->identity.topic);
    if (found != publishers_.end() && found->second == publisher) publishers_.erase(found);
  }
  loop.run_and_wait([&] {
    for (const auto & connection : publisher->connections()) connection->shut();
  });
}

ServiceDesk * Server::find_desk(const std::string & service) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = desks_.find(service);
  return found == desks_.end() ? nullptr : found->second;
}

void Server::open_desk(ServiceDesk & desk) {
  std::lock_guard<std::mutex> lock(mutex_);
  desks_[desk.identity().service] = &desk;
}

void Server::close_desk(ServiceDesk & desk) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = desks_.find(desk.identity().service);
  if (found != desks_.end() && found->second == &desk) desks_.erase(found);
}

}  // namespace plane
