// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

// The main() of a tool: parses the command line into `app`'s options, then calls `job`. What goes wrong is one line on
// standard error and exit status 1.
template <class Job>
int run_tool(CLI::App& app, int argc, char** argv, const Job& job) {
  try {
    app.parse(argc, argv);
    job();
    return 0;
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help
    std::fprintf(stderr, "%s: %s (see --help)\n", app.get_name().c_str(), e.what());
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), e.what());
  }
  return 1;
}
