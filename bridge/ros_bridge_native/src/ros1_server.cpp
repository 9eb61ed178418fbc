#include "ros1_server.hpp"

#include <fcntl.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
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
  const Place place(address, 0);
  fd_ = socket(place.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  spare_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
  sockaddr_in6 own{};  // the port is at the same place for both kinds of addresses
  socklen_t size = sizeof own;
  // A second socket of this process may have the port, too: one that asks about the other end of a connection that is no more.
  const int yes = 1;
  setsockopt(fd_, SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes);
  if (!place.known() || bind(fd_, place.address(), place.size()) != 0 || listen(fd_, SOMAXCONN) != 0 ||
      getsockname(fd_, reinterpret_cast<sockaddr *>(&own), &size) != 0) {
    throw std::runtime_error("can't listen on " + address + ": " + std::strerror(errno));
  }
  port_ = ntohs(own.sin6_port);
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

std::vector<std::shared_ptr<Ros1Publisher>> Server::find(const std::string & topic) {
  std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::shared_ptr<Ros1Publisher>> found;
  const auto [first, last] = publishers_.equal_range(topic);
  for (auto entry = first; entry != last; ++entry) found.push_back(entry->second);
  return found;
}

void Server::offer(const std::shared_ptr<Ros1Publisher> & publisher) {
  const TopicIdentity & own = publisher->identity;
  const auto others = find(own.topic);
  if (!others.empty() && others.front()->identity.md5sum != own.md5sum) {
    throw std::runtime_error("the bridge publishes " + own.topic + " in ROS 1 already, as " + others.front()->identity.type);
  }
  loop.run_and_wait([&] {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      publishers_.emplace(own.topic, publisher);
    }
    if (others.empty()) return;
    for (const auto & connection : others.front()->connections()) join(connection, publisher);
  });
}

void Server::withdraw(const std::shared_ptr<Ros1Publisher> & publisher) {
  loop.run_and_wait([&] {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      const auto [first, last] = publishers_.equal_range(publisher->identity.topic);
      const auto found = std::find_if(first, last, [&](const auto & entry) { return entry.second == publisher; });
      if (found != last) publishers_.erase(found);
    }
    for (const auto & connection : publisher->connections()) leave(connection, publisher);
  });
}

ServiceHandler * Server::find_service(const std::string & service) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = services_.find(service);
  return found == services_.end() ? nullptr : found->second;
}

void Server::offer_service(ServiceHandler & handler) {
  std::lock_guard<std::mutex> lock(mutex_);
  services_[handler.identity().service] = &handler;
}

void Server::withdraw_service(ServiceHandler & handler) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = services_.find(handler.identity().service);
  if (found != services_.end() && found->second == &handler) services_.erase(found);
}

}  // namespace plane
