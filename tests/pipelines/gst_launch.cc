// SPDX-License-Identifier: LGPL-2.1-or-later
#include "pipelines/gst_launch.h"

#include <sys/wait.h>

#include <cstdio>
#include <stdexcept>

namespace lf::test {

Launched gst_launch(const std::string& line, const std::string& options, const std::string& environment, int seconds) {
  const std::string command = "GST_PLUGIN_PATH=" LF_PLUGIN_DIR " GST_REGISTRY=" LF_PLUGIN_DIR "/test-registry.bin " +
                              environment + " timeout -k 5 " + std::to_string(seconds) + " gst-launch-1.0 " + options +
                              " " + line + " 2>&1 </dev/null";
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) throw std::runtime_error("can't run gst-launch-1.0");
  Launched result;
  char buffer[4096];
  while (const size_t n = fread(buffer, 1, sizeof buffer, pipe)) result.output.append(buffer, n);
  const int status = pclose(pipe);
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

}  // namespace lf::test
