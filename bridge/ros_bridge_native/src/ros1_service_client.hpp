// TCPROS services, the calling side: a connection to one server, kept for one call after the other.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "buffer.hpp"
#include "connection_header.hpp"
#include "liveness.hpp"
#include "loop.hpp"

namespace plane {

class CallConnection;

// Why a connection is no more.
enum class Loss {
  kUnreachable,  // it did not come about: trying again makes sense
  kRefused,      // the server says no, or is none
  kInCall,       // it ended while a call was under way
  kIdle,
};

// The maker of calls. It is called in the loop's thread.
class CallListener {
 public:
  virtual ~CallListener() = default;
  virtual void on_open(const std::shared_ptr<CallConnection> & connection) = 0;
  // The answer, or the text of an error, is behind the five bytes of the protocol. The connection is idle again, or shut.
  virtual void on_answer(const std::shared_ptr<CallConnection> & connection, bool good, Frame answer) = 0;
  virtual void on_lost(const std::shared_ptr<CallConnection> & connection, Loss loss, const std::string & reason) = 0;
};

// Bytes before the payload of an answer: whether it is one, and the payload's length.
constexpr size_t kAnswerHeadBytes = 5;

// The loop's thread only.
class CallConnection : public Handler, public std::enable_shared_from_this<CallConnection> {
 public:
  CallConnection(Loop & loop, CallListener & listener, const ServiceIdentity & identity, const std::string & caller_id);
  ~CallConnection() override;

  void begin(const std::string & address, uint16_t port);
  // Send a request, which is behind the four bytes of its length. Returns false, and shuts, if the server has closed the idle connection.
  bool call(Frame request);
  // Close without telling the listener.
  void drop();

  void on_ready(uint32_t epoll_events) override;
  bool on_tick(int64_t now_ns) override;

  bool open() const { return state_ != State::kClosed; }
  bool calling() const { return state_ == State::kCalling; }

  uint64_t call_number = 0;  // the listener's
  int64_t used_ns = 0;       // when the last answer came

 private:
  enum class State { kConnecting, kHeader, kIdle, kCalling, kClosed };

  void on_connected();
  void receive();
  void take_header();
  void take_answer();
  void make_room();
  void flush();
  void lose(Loss loss, const std::string & reason);
  void watch(uint32_t epoll_events);

  Loop & loop_;
  CallListener & listener_;
  const std::string greeting_;
  State state_ = State::kConnecting;
  int fd_ = -1;
  Key key_ = 0;
  uint32_t watched_ = 0;
  std::string place_;
  const int64_t born_ns_;
  Liveness life_;
  Frame received_ = std::make_shared<Buffer>();
  Frame request_;  // on its way
  size_t sent_ = 0;
};

}  // namespace plane
