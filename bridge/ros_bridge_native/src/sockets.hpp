// Addresses, and the options that all TCPROS sockets have.
#pragma once

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cstdint>
#include <cstring>
#include <string>

namespace plane {

// A connection that has not come about after this time is tried again: what was sent into a cut would be sent again late.
constexpr int64_t kConnectNs = 1'500'000'000;
// A peer that has not said its header after this time is shut out.
constexpr int64_t kHandshakeNs = 5'000'000'000;
// After this time the peer has ended an idle connection, too (rospy and roscpp: 150 s). Until then it is kept, however long the peer says
// nothing: of one that is closed while the network is away the peer never learns, and a subscriber does not connect again.
constexpr int kGiveUpMs = 600'000;

inline void set_options(int fd) {
  const int yes = 1, idle_s = 1, interval_s = 1, give_up_ms = kGiveUpMs;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  // Idle connections are asked once a second (Liveness looks at the answers). With a user timeout the number of probes has no effect.
  setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
  setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
  setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
  setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &give_up_ms, sizeof give_up_ms);
}

// An address of IPv4 or IPv6, as connect and bind take it.
class Place {
 public:
  Place(const std::string & address, uint16_t port) {
    auto * four = reinterpret_cast<sockaddr_in *>(&storage_);
    auto * six = reinterpret_cast<sockaddr_in6 *>(&storage_);
    if (inet_pton(AF_INET, address.c_str(), &four->sin_addr) == 1) {
      four->sin_family = AF_INET;
      four->sin_port = htons(port);
      size_ = sizeof *four;
    } else if (inet_pton(AF_INET6, address.c_str(), &six->sin6_addr) == 1) {
      six->sin6_family = AF_INET6;
      six->sin6_port = htons(port);
      size_ = sizeof *six;
    }
  }

  bool known() const { return size_ != 0; }
  int family() const { return storage_.ss_family; }
  const sockaddr * address() const { return reinterpret_cast<const sockaddr *>(&storage_); }
  socklen_t size() const { return size_; }

 private:
  sockaddr_storage storage_{};
  socklen_t size_ = 0;
};

// Return a connection's own address, the peer's and the peer's port, or nothing.
inline std::string ends_of(int fd) {
  sockaddr_storage own{}, peer{};
  socklen_t own_size = sizeof own, peer_size = sizeof peer;
  char own_text[NI_MAXHOST], peer_text[NI_MAXHOST], port[NI_MAXSERV];
  auto * own_address = reinterpret_cast<sockaddr *>(&own);
  auto * peer_address = reinterpret_cast<sockaddr *>(&peer);
  constexpr int numeric = NI_NUMERICHOST | NI_NUMERICSERV;
  if (getsockname(fd, own_address, &own_size) != 0 || getpeername(fd, peer_address, &peer_size) != 0 ||
      getnameinfo(own_address, own_size, own_text, sizeof own_text, nullptr, 0, numeric) != 0 ||
      getnameinfo(peer_address, peer_size, peer_text, sizeof peer_text, port, sizeof port, numeric) != 0) {
    return "";
  }
  return std::string(own_text) + ' ' + peer_text + ' ' + port;
}

}  // namespace plane
