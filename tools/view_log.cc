// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view_log.h"

#include <cstdlib>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/json_value.h"

namespace {

// The text of `name=(type)value` up to the next comma or semicolon.
std::optional<std::string> field(const std::string& line, const std::string& name) {
  const size_t at = line.find(" " + name + "=(");
  if (at == std::string::npos) return std::nullopt;
  const size_t begin = line.find(')', at) + 1;
  return line.substr(begin, line.find_first_of(",;", begin) - begin);
}

}  // namespace

std::vector<ViewLogEntry> read_view_log(const std::string& path) {
  std::vector<ViewLogEntry> entries;
  std::istringstream text(lf::read_text_file(path));
  for (std::string line; std::getline(text, line);) {
    if (line.find(" lightfield-view,") == std::string::npos) continue;
    const auto number = [&](const char* name) -> uint64_t {
      const std::optional<std::string> value = field(line, name);
      if (!value) throw lf::Error(path + ": a message without " + name + ": " + line);
      return std::strtoull(value->c_str(), nullptr, 10);
    };
    ViewLogEntry entry;
    entry.clock = std::strtod(line.c_str(), nullptr);
    entry.sequence = static_cast<uint32_t>(number("sequence"));
    entry.complete = field(line, "complete") == "true";
    entry.bytes = number("bytes");
    entry.trial_bytes = number("trial-bytes");
    entry.latency_ns = number("latency-ns");
    entries.push_back(entry);
  }
  if (entries.empty()) throw lf::Error(path + ": no lightfield-view messages: the pipeline made no pictures");
  return entries;
}
