// What crosses: the base of all routes, and topics. Services are in services_in_ros1.hpp and services_in_ros2.hpp.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "counters.hpp"
#include "events.hpp"
#include "loop.hpp"
#include "pace.hpp"
#include "python_queue.hpp"
#include "ros1_publisher.hpp"
#include "ros1_server.hpp"
#include "ros1_subscription.hpp"
#include "ros2_ends.hpp"
#include "worker.hpp"

namespace plane {

// What all routes share.
struct Context {
  explicit Context(const std::string & caller_id_) : caller_id(caller_id_), server(std::make_shared<Server>(loop, events, caller_id_)) {}

  const std::string caller_id;
  Events events;
  PythonQueue python;
  Loop loop;
  Worker upward{"plane_to_ros2"};
  Worker downward{"plane_to_ros1"};
  Worker calls{"plane_calls"};
  std::shared_ptr<Server> server;
};

struct Specification {
  TopicIdentity ros1;
  std::string ros2_topic;
  rcl_node_t * node;  // none: Python is the other end
  const rosidl_message_type_support_t * type;
  Quality quality;
  Program program;
  uint64_t token;  // names the route in events
  bool converts;   // Python converts between ROS 1's layout and ROS 2's, which is that of the program
  bool bulky;      // messages may be images, clouds or maps: not more of them than `depth` are kept
};

class Route {
 public:
  virtual ~Route() = default;
  // How many peers the end has that messages go out of, and the one that they come from.
  virtual size_t target_peers() { return 0; }
  virtual size_t source_peers() { return 0; }
  // How many of these may still bring, late, what they had sent while they were away.
  virtual size_t late_peers() { return 0; }
  // Take back what Python has converted, or why it could not. Any thread.
  virtual void on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) = 0;
  Counters counters;

 protected:
  // Count a message that is none of the type, and report the first and each thousandth.
  void count_bad(Events & events, uint64_t token, const std::string & from);
};

// ROS 1 to ROS 2.
class Ros1ToRos2Route : public Route, public Inbox, public Job {
 public:
  Ros1ToRos2Route(Context & context, Specification specification);
  ~Ros1ToRos2Route() override;

  void connect(uint64_t token, const std::string & address, uint16_t port);
  // Give a connection whose on_open asked for it a writer of its own.
  void grant(uint64_t token);
  size_t target_peers() override;
  size_t source_peers() override { return counters.peers; }
  size_t late_peers() override;
  void on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) override;

 private:
  struct Large {
    Frame message;
    size_t writer;
    int64_t arrived_ns;
  };
  struct Writer {
    std::unique_ptr<Ros2Publisher> publisher;
    std::string peer;
    bool taken = false;
  };

  bool on_open(InConnection & connection) override;
  bool ready() override { return pace_.take(now_ns()); }
  size_t room() const override;
  void on_skipped(size_t number) override { counters.dropped_overrun.fetch_add(number); }
  void on_small(InConnection & connection, const uint8_t * message, size_t size) override;
  Frame buffer() override { return pool_->get(); }
  void on_large(InConnection & connection, Frame message) override;
  void on_closed(InConnection & connection) override;
  void on_heard() override { count_peers(); }
  void work() override;
  bool through_python() const { return specification_.converts || specification_.node == nullptr; }
  void hand_to_python(size_t writer, Frame message);
  void publish(size_t writer, const uint8_t * message, size_t size, int64_t arrived_ns);
  bool replace_older(InConnection & newer);
  bool is_new(InConnection & connection, const uint8_t * message, size_t size);
  void queue(InConnection & connection, Frame message);
  void count_peers();
  Quality writer_quality() const;
  std::unique_ptr<Ros2Publisher> make_writer() const;

  Context & context_;
  const Specification specification_;
  std::map<uint64_t, std::shared_ptr<InConnection>> connections_;  // the loop's thread only
  std::atomic<size_t> late_{0};
  Pace pace_;                                                      // the loop's thread only
  std::mutex writers_mutex_;
  std::vector<Writer> writers_;
  std::shared_ptr<Pool> pool_ = std::make_shared<Pool>();
  std::mutex large_mutex_;
  std::deque<Large> large_;
  std::atomic<size_t> under_way_{0};  // large ones not published yet: smaller ones wait their turn behind them
};

// ROS 2 to ROS 1.
class Ros2ToRos1Route : public Route, public Job {
 public:
  Ros2ToRos1Route(Context & context, Specification specification);
  ~Ros2ToRos1Route() override;

  void start();
  // Send what Python has. Any thread.
  void publish(const uint8_t * bytes, size_t size, const std::string & sender);
  size_t target_peers() override { return counters.peers; }
  size_t source_peers() override { return subscription_ ? subscription_->peers() : 0; }
  void on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) override;

 private:
  void on_arrived();
  void work() override { drain(); }
  void drain();
  void hand_to_python(int64_t start_ns, const std::string & sender, Frame message);
  void count_missed(const Sender & sender);

  Context & context_;
  const Specification specification_;
  std::shared_ptr<Ros1Publisher> publisher_;
  std::shared_ptr<Pool> pool_ = std::make_shared<Pool>();
  std::atomic<bool> large_{false};  // once a large message has come, a worker takes them all
  uint32_t sequence_ = 0;
  std::map<Gid, uint64_t> last_sequence_;
  std::unique_ptr<Ros2Subscription> subscription_;
};

}  // namespace plane
