// A service whose server is in ROS 1, for clients in ROS 2.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "replies.hpp"
#include "ros1_service_client.hpp"
#include "ros2_services.hpp"
#include "service_route.hpp"
#include "timer.hpp"

namespace plane {

// Calls live in the loop's thread. Threads of DDS take the requests and post them to it.
// A request is sent once: a server that died in a call may have carried it out, so it is not repeated.
class ServiceInRos1 : public Route, public CallListener {
 public:
  ServiceInRos1(Context & context, ServiceSpecification specification);
  ~ServiceInRos1() override;

  // Any thread. What became of asking the master (kNeedsServer): where the server is, or why that is not known.
  void found(const std::string & address, uint16_t port);
  void not_found(const std::string & reason);
  void on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) override;

 private:
  struct Call {
    rmw_request_id_t request_id;
    Frame request;  // until it has been handed on
    int64_t start_ns;
    int64_t deadline_ns;
    std::shared_ptr<CallConnection> connection;
  };
  using Calls = std::map<uint64_t, Call>;  // by their numbers, so in the order of their deadlines

  void on_open(const std::shared_ptr<CallConnection> & connection) override;
  void on_answer(const std::shared_ptr<CallConnection> & connection, bool good, Frame answer) override;
  void on_lost(const std::shared_ptr<CallConnection> & connection, Loss loss, const std::string & reason) override;

  void take_requests();
  void on_request(const rmw_request_id_t & request_id, Frame request, int64_t start_ns);
  void on_good_answer(Calls::iterator call, Frame answer, size_t offset);
  void begin_waiting();
  bool begin_one(uint64_t number);
  size_t wanted_attempts() const;
  void attempt();
  void end_spare_attempts();
  Calls::iterator of(const CallConnection & connection);
  void fail(Calls::iterator call, const std::string & reason);
  std::string why_late(const Call & call) const;
  void look();
  void look_again();

  Context & context_;
  const ServiceSpecification specification_;
  std::shared_ptr<Pool> pool_ = std::make_shared<Pool>();
  std::shared_ptr<Timer> timer_;
  std::unique_ptr<Ros2Service> service_;
  Replies replies_;
  std::atomic<size_t> posted_{0};       // requests that the loop has not seen yet
  std::atomic<bool> left_over_{false};  // DDS has more of them
  std::atomic<uint32_t> sequence_{0};

  // The loop's thread only:
  bool closed_ = false;
  uint64_t next_number_ = 1;
  Calls calls_;
  std::deque<uint64_t> waiting_;  // of the calls, those without a connection
  std::vector<std::shared_ptr<CallConnection>> idle_;
  std::vector<std::shared_ptr<CallConnection>> attempts_;
  bool asked_ = false;  // for the server's place
  int64_t ask_after_ns_ = 0;
  std::string address_;  // the server's, to be trusted for a moment
  uint16_t port_ = 0;
  int64_t place_until_ns_ = 0;
  std::string problem_;  // why there is no connection
};

}  // namespace plane
