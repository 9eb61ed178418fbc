// A service whose server is in ROS 2, for clients in ROS 1.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "ros1_service_server.hpp"
#include "ros2_services.hpp"
#include "service_route.hpp"
#include "timer.hpp"

namespace plane {

// Calls live in the loop's thread. Threads of DDS take the responses, and a worker sends large requests; both post what they have to the loop.
class ServiceInRos2 : public Route, public ServiceHandler, public Job {
 public:
  ServiceInRos2(Context & context, ServiceSpecification specification);
  ~ServiceInRos2() override;

  const ServiceIdentity & identity() const override { return specification_.ros1; }
  void on_converted(const PythonMessage & message, const uint8_t * bytes, size_t size, const std::string & problem) override;

 private:
  struct Call {
    std::shared_ptr<ServiceConnection> connection;
    Frame request;  // until it has been handed on
    int64_t start_ns;
    int64_t deadline_ns;
    int64_t sequence = -1;  // the request's in ROS 2, once it was sent
  };
  using Calls = std::map<uint64_t, Call>;  // by their numbers, so in the order of their deadlines

  void on_open(const std::shared_ptr<ServiceConnection> & connection) override;
  void on_request(const std::shared_ptr<ServiceConnection> & connection, Frame request) override;
  void on_closed(const std::shared_ptr<ServiceConnection> & connection) override;
  void work() override;

  void on_good_request(Calls::iterator call, Frame request);
  void hand_on(Calls::iterator call);
  int64_t send(const Frame & request) const;
  void on_sent(uint64_t number, int64_t sequence);
  void on_responses(size_t number);
  void on_response(int64_t sequence, const Frame & response);
  void finish(Calls::iterator call, const Frame & response);
  void answer(Calls::iterator call, const Frame & response);
  void fail(Calls::iterator call, const std::string & reason);
  void look();
  void look_again();

  Context & context_;
  const ServiceSpecification specification_;
  std::shared_ptr<Pool> pool_ = std::make_shared<Pool>();
  std::unique_ptr<Ros2Client> client_;
  std::shared_ptr<Timer> timer_;

  // The loop's thread only:
  bool closed_ = false;
  uint64_t next_number_ = 1;
  Calls calls_;
  std::map<int64_t, uint64_t> numbers_;   // of calls, by their requests' sequence numbers
  std::map<int64_t, Frame> early_;        // responses to requests of which the worker has not told the number yet
  size_t with_worker_ = 0;
  std::set<std::shared_ptr<ServiceConnection>> connections_;

  std::mutex large_mutex_;
  std::deque<std::pair<uint64_t, Frame>> large_;  // calls' numbers and requests, for the worker
};

}  // namespace plane
