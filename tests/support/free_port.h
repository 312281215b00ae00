// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>
#include <stdexcept>

namespace lf::test {

// A port that nobody has at any address of this machine just now, and none of the ports that sockets get by themselves
// (32768 and more), which another program could have by the time it is used. `type`: SOCK_DGRAM (UDP) or SOCK_STREAM
// (TCP).
inline int free_port(int type) {
  static std::mt19937 random(std::random_device{}());
  for (int attempt = 0; attempt < 100; attempt++) {
    const int port = std::uniform_int_distribution(10000, 32000)(random);
    const int file = socket(AF_INET, type, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_ANY);
    address.sin_port = htons(static_cast<uint16_t>(port));
    const bool ok = file >= 0 && bind(file, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    if (file >= 0) close(file);
    if (ok) return port;
  }
  throw std::runtime_error("no free port");
}

}  // namespace lf::test
