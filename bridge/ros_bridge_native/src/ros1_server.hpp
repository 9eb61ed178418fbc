// The port that ROS 1's subscribers and clients connect to.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

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

  // A topic may have several publishers here; each subscriber gets the messages of all. Throws std::runtime_error if their types differ.
  void offer(const std::shared_ptr<Ros1Publisher> & publisher);
  void withdraw(const std::shared_ptr<Ros1Publisher> & publisher);  // returns when it has no subscriber left
  void offer_service(ServiceHandler & handler);
  void withdraw_service(ServiceHandler & handler);  // in the loop's thread; clients that are connected stay so

  void on_ready(uint32_t epoll_events) override;

  // For the connections:
  std::vector<std::shared_ptr<Ros1Publisher>> find(const std::string & topic);
  ServiceHandler * find_service(const std::string & service);
  Loop & loop;
  Events & events;
  const std::string caller_id;

 private:
  int fd_ = -1;
  int spare_ = -1;  // given up for a moment when descriptors have run out, to turn away the connection that waits
  Key key_ = 0;
  uint16_t port_ = 0;
  std::mutex mutex_;
  std::multimap<std::string, std::shared_ptr<Ros1Publisher>> publishers_;
  std::map<std::string, ServiceHandler *> services_;
};

}  // namespace plane
