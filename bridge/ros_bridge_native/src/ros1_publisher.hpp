// TCPROS, the sending side: a connection with a bounded queue for each subscriber; and the listening socket of all topics and services.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "buffer.hpp"
#include "connection_header.hpp"
#include "counters.hpp"
#include "events.hpp"
#include "loop.hpp"
#include "ros1_service_server.hpp"

namespace plane {

class OutConnection;

// A topic that ROS 1 can subscribe to.
class Ros1Publisher {
 public:
  Ros1Publisher(TopicIdentity identity, bool latched, size_t depth, Counters & counters);

  // Any thread. The frame is sent or queued; a full queue lets its oldest go. Never blocks. `sender` tells whose last message it replaces.
  void publish(const Frame & frame, const std::string & sender);
  bool wanted();

  const TopicIdentity identity;
  const bool latched;
  const size_t depth;

  // The server's, in the loop's thread:
  void attach(const std::shared_ptr<OutConnection> & connection);
  void detach(const std::shared_ptr<OutConnection> & connection);
  std::vector<std::shared_ptr<OutConnection>> connections();

 private:
  void keep(const Frame & frame, const std::string & sender);

  Counters & counters_;
  std::mutex mutex_;
  std::vector<std::shared_ptr<OutConnection>> connections_;
  std::deque<std::pair<std::string, Frame>> last_;  // the last message of each sender, the latest at the end
};

// The listening socket.
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

 private:
  friend class OutConnection;
  std::shared_ptr<Ros1Publisher> find(const std::string & topic);
  ServiceDesk * find_desk(const std::string & service);

  Loop & loop_;
  Events & events_;
  const std::string caller_id_;
  int fd_ = -1;
  int spare_ = -1;  // given up for a moment when descriptors have run out, to turn away who waits
  Key key_ = 0;
  uint16_t port_ = 0;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Ros1Publisher>> publishers_;
  std::map<std::string, ServiceDesk *> desks_;
};

}  // namespace plane
