// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

namespace lf::test {

// A port of the loopback interface that nobody listens at just now. `type`: SOCK_DGRAM (UDP) or SOCK_STREAM (TCP).
inline int free_port(int type) {
  const int file = socket(AF_INET, type, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  const bool ok = file >= 0 && bind(file, generic, size) == 0 && getsockname(file, generic, &size) == 0;
  if (file >= 0) close(file);
  if (!ok) throw std::runtime_error("no free port");
  return ntohs(address.sin_port);
}

}  // namespace lf::test
