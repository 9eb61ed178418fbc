// The port that ROS 1's subscribers and clients connect to.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "events.hpp"
#include "loop.hpp"
#include "ros1_publisher.hpp"
#include "ros1_service_server.hpp"

namespace plane {

// The listening socket of all topics and services.
class Server : public Handler, public std::enable_shared_from_this<Server> {
 public:
  Server(Loop & loop, Events & events, std::string caller_id);
  ~Server() override;

  void listen_on(const std::string & address);  // throws std::runtime_error
  void close();
  uint16_t port() const { return port_; }

  void offer(const std::shared_ptr<Ros1Publisher> & publisher);
  void withdraw(const std::shared_ptr<Ros1Publisher> & publisher);  // returns when no connection is left
  void open_desk(ServiceDesk & desk);
  void close_desk(ServiceDesk & desk);  // in the loop's thread; who is connected stays so

  void on_ready(uint32_t epoll_events) override;

  // For those who connect:
  std::shared_ptr<Ros1Publisher> find(const std::string & topic);
  ServiceDesk * find_desk(const std::string & service);
  Loop & loop;
  Events & events;
  const std::string caller_id;

 private:
  int fd_ = -1;
  int spare_ = -1;  // given up for a moment when descriptors have run out, to turn away who waits
  Key key_ = 0;
  uint16_t port_ = 0;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Ros1Publisher>> publishers_;
  std::map<std::string, ServiceDesk *> desks_;
};

}  // namespace plane
