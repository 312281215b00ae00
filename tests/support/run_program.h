// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <source_location>

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include "support/test.h"

namespace lf {

struct Outcome {
  int status = -1;  // exit status; 128 and above: ended by a signal
  std::string output;
};

inline Outcome run_shell(const std::string& command) {
  Outcome outcome;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (!pipe) return outcome;
  std::array<char, 4096> buffer;
  while (const size_t n = fread(buffer.data(), 1, buffer.size(), pipe)) outcome.output.append(buffer.data(), n);
  const int status = pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

// Runs a tool of this build through a shell, in `directory`.
inline Outcome run_program(const std::string& name, const std::string& arguments, const std::string& directory = ".") {
  return run_shell("cd '" + directory + "' && '" LF_TOOLS_DIR "/" + name + "' " + arguments);
}

}  // namespace lf

namespace lf::test {

// Expects an exit status and output; both may be values or matchers.
template <typename Status, typename Output = decltype(testing::_)>
void expect_outcome(const Outcome& outcome, const Status& status, const Output& output = testing::_,
                    const std::source_location& where = std::source_location::current()) {
  const testing::ScopedTrace trace(where.file_name(), static_cast<int>(where.line()), "");
  EXPECT_THAT(outcome.status, status) << outcome.output;
  EXPECT_THAT(outcome.output, output);
}

// Returns a port that is free at every address of this machine. The port is below 32768, because the kernel assigns
// higher ports to other programs. `type`: SOCK_DGRAM (UDP) or SOCK_STREAM (TCP).
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
