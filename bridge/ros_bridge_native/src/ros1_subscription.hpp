// TCPROS, the receiving side: a connection to one publisher of a topic.
#pragma once

#include <memory>
#include <string>

#include "buffer.hpp"
#include "connection_header.hpp"
#include "events.hpp"
#include "liveness.hpp"
#include "loop.hpp"

namespace plane {

// Messages up to this size are dealt with where they arrive; larger ones are handed to a worker.
constexpr size_t kLargeBytes = 65'536;

class InConnection;

// What receives. All calls come from the loop's thread.
class Inbox {
 public:
  virtual ~Inbox() = default;
  // The headers fit. Return whether messages may come at once; if not, resume() has to be called.
  virtual bool on_open(InConnection & connection) = 0;
  // Return whether another small message may come now; if not, the connection rests for a millisecond.
  virtual bool ready() = 0;
  // How many small messages may wait while the connection rests.
  virtual size_t room() const = 0;
  // That many messages had to go while the connection rested.
  virtual void on_skipped(size_t number) = 0;
  virtual void on_small(InConnection & connection, const uint8_t * message, size_t size) = 0;
  virtual Frame buffer() = 0;
  virtual void on_large(InConnection & connection, Frame message) = 0;
  virtual void on_closed(InConnection & connection) = 0;
  // A connection has become silent, or is heard again.
  virtual void on_heard() = 0;
};

class InConnection : public Handler, public std::enable_shared_from_this<InConnection> {
 public:
  // `token` names the connection in events.
  InConnection(Loop & loop, Events & events, Inbox & inbox, const TopicIdentity & identity, const std::string & caller_id, uint64_t token);
  ~InConnection() override;

  // The loop's thread:
  void begin(const std::string & address, uint16_t port);
  void resume();
  void shut(const std::string & reason, EventKind kind = EventKind::kClosed);

  void on_ready(uint32_t epoll_events) override;
  bool on_tick(int64_t now_ns) override;
  void on_rested() override;

  bool open() const { return state_ == State::kOpen; }
  bool heard() const { return open() && !life_.silent(); }

  const uint64_t token;
  std::string peer;
  size_t writer = 0;      // the inbox's
  bool replaces = false;  // the inbox's: an older connection of the same publisher is still open
  uint64_t last = 0;      // the inbox's: digest of the last message

 private:
  enum class State { kConnecting, kHeader, kOpen, kClosed };

  void on_connected();
  bool receive();
  void take_messages();
  void take_header();
  void make_room();
  size_t waiting() const;
  size_t behind_message(size_t at) const;
  void skip_oldest(size_t kept);
  bool begin_large();
  void end_large();

  Loop & loop_;
  Events & events_;
  Inbox & inbox_;
  const std::string greeting_;
  const TopicIdentity & identity_;
  State state_ = State::kConnecting;
  std::string end_;     // why there is nothing more to receive
  bool rests_ = false;  // what comes waits in received_, of which the oldest goes when it is full
  int fd_ = -1;
  Key key_ = 0;
  int64_t born_ns_;
  Liveness life_;
  Buffer received_;  // whole or part of a header or of small messages
  Frame large_;      // a large message on its way
  size_t large_bytes_ = 0;
};

}  // namespace plane
