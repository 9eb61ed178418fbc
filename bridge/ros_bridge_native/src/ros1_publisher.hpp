// TCPROS, the sending side: a topic, and for each subscriber a connection with a bounded queue.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "buffer.hpp"
#include "connection_header.hpp"
#include "counters.hpp"
#include "events.hpp"
#include "loop.hpp"

namespace plane {

class OutConnection;
class Ros1Publisher;
class Server;

// Read the header of a peer that has connected to the server, and become what it asks for: a subscriber's connection, or a service's.
void greet_peer(const std::shared_ptr<Server> & server, int fd);

// End the connections of a subscriber (its topic and its name) but for the newest. The loop's thread.
void end_older(Server & server, const std::string & subscriber);

// Let a subscriber receive from one more publisher of its topic, or from one less; without any its connection ends. The loop's thread.
void join(const std::shared_ptr<OutConnection> & connection, const std::shared_ptr<Ros1Publisher> & publisher);
void leave(const std::shared_ptr<OutConnection> & connection, const std::shared_ptr<Ros1Publisher> & publisher);

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
  // Count the peers again: a connection has become silent, or is heard again.
  void count();

 private:
  void count_heard();
  void keep(const Frame & frame, const std::string & sender);

  Counters & counters_;
  std::mutex mutex_;
  std::vector<std::shared_ptr<OutConnection>> connections_;
  std::deque<std::pair<std::string, Frame>> last_;  // the last message of each sender, the latest at the end
};

}  // namespace plane
