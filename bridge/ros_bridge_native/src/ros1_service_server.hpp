// TCPROS services, the answering side (ROS wiki, "ROS/TCPROS"): a connection of one client, which has one call under way at a time.
#pragma once

#include <memory>
#include <string>

#include "buffer.hpp"
#include "connection_header.hpp"
#include "liveness.hpp"
#include "loop.hpp"

namespace plane {

class ServiceConnection;

// A service of this process. It is called in the loop's thread.
class ServiceHandler {
 public:
  virtual ~ServiceHandler() = default;
  virtual const ServiceIdentity & identity() const = 0;
  virtual void on_open(const std::shared_ptr<ServiceConnection> & connection) = 0;
  // The request is behind the four bytes of its length. The connection has to be answered once, now or later.
  virtual void on_request(const std::shared_ptr<ServiceConnection> & connection, Frame request) = 0;
  virtual void on_closed(const std::shared_ptr<ServiceConnection> & connection) = 0;
};

// The loop's thread only.
class ServiceConnection : public Handler, public std::enable_shared_from_this<ServiceConnection> {
 public:
  // The client's header fits the handler's identity; `rest` is what came behind it. Takes the descriptor.
  ServiceConnection(Loop & loop, ServiceHandler & handler, int fd, const Fields & header);
  ~ServiceConnection() override;

  // Say our own header, and wait for requests. A probe is told the header and nothing else.
  void begin(const std::string & caller_id, const Fields & header, const uint8_t * rest, size_t rest_bytes);
  // Answer the call under way: with a response, or with the text of an error, either behind four bytes of length.
  void answer(bool good, Frame body);
  void shut();

  void on_ready(uint32_t epoll_events) override;
  bool on_tick(int64_t now_ns) override;

 private:
  void receive();
  void make_room();
  void take_requests();
  Frame cut_request(size_t bytes);
  void flush();
  void watch(uint32_t epoll_events);

  Loop & loop_;
  ServiceHandler & handler_;
  const int fd_;
  const bool persistent_;
  Key key_ = 0;
  uint32_t watched_ = 0;
  bool closed_ = false;
  bool calling_ = false;  // from a request until its answer has been sent as a whole
  bool taking_ = false;
  Liveness life_;
  Frame received_ = std::make_shared<Buffer>();  // requests, or parts of one
  Frame body_;                                   // of the answer on its way
  uint8_t good_ = 0;
  size_t sent_ = 0;
};

}  // namespace plane
