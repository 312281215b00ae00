// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

// What the pipeline tests share: gst-launch-1.0 with this build's plugin.
namespace lf::test {

struct Launched {
  int status = 0;      // exit status; 124 after the time limit
  std::string output;  // standard output and error
};

// Runs `environment gst-launch-1.0 options line`. `line` is a launch line as one would paste it into a shell.
Launched gst_launch(const std::string& line, const std::string& options = "-q", const std::string& environment = "",
                    int seconds = 60);

}  // namespace lf::test
