// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace lf::serve {

// How much of this machine's processors is in use, by everybody, from /proc/stat.
class ProcessorLoad {
 public:
  // The load since the call before, 0 to 1; 0 where nothing is known.
  double update() {
    std::ifstream stat("/proc/stat");
    std::string name;
    uint64_t ticks[8] = {};  // user, nice, system, idle, waiting for disks, interrupts, soft interrupts, stolen
    stat >> name;
    for (uint64_t& t : ticks) stat >> t;
    if (!stat || name != "cpu") return 0;
    const uint64_t idle = ticks[3] + ticks[4];
    uint64_t all = 0;
    for (const uint64_t t : ticks) all += t;
    const uint64_t passed = all - all_, unused = idle - idle_;
    const bool first = all_ == 0;
    all_ = all;
    idle_ = idle;
    return first || passed == 0 ? 0 : 1 - static_cast<double>(unused) / static_cast<double>(passed);
  }

 private:
  uint64_t all_ = 0, idle_ = 0;
};

}  // namespace lf::serve
