// Options that all TCPROS sockets have.
#pragma once

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cstdint>

namespace plane {

// A peer that has not said its header after this time is shut out.
constexpr int64_t kHandshakeNs = 5'000'000'000;

inline void set_options(int fd) {
  const int yes = 1, idle_s = 5, interval_s = 2, probes = 3;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  // A peer whose machine or network has gone says nothing; after about ten seconds of that it counts as gone.
  setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
  setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
  setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
  setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof probes);
}

}  // namespace plane
