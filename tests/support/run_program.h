// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace lf {

struct Outcome {
  int status = -1;     // exit status
  std::string output;  // both streams
};

// Runs one of this build's tools through a shell, in `directory`.
inline Outcome run_program(const std::string& name, const std::string& arguments, const std::string& directory = ".") {
  const std::string command = "cd '" + directory + "' && '" LF_TOOLS_DIR "/" + name + "' " + arguments + " 2>&1";
  Outcome outcome;
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return outcome;
  std::array<char, 4096> buffer;
  while (const size_t n = fread(buffer.data(), 1, buffer.size(), pipe)) outcome.output.append(buffer.data(), n);
  const int status = pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

}  // namespace lf
