// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>

namespace lf::serve {

// Sends a state such as "READY=1" or "STATUS=serving" to systemd, if this process is a service of Type=notify
// (sd_notify(3)). Does nothing otherwise.
void notify_service(const std::string& state);

// Reports to the watchdog of systemd (WatchdogSec=) four times per interval, from the main loop, so that systemd
// restarts a service if its main loop hangs. Each report follows a call of `check`, which may hang, too. If `check`
// returns a problem, there is no report, and a message when the problem begins and ends. Does nothing without a
// watchdog. Main thread only.
class ServiceWatchdog {
 public:
  explicit ServiceWatchdog(std::function<std::string()> check = {});
  ~ServiceWatchdog();
  ServiceWatchdog(const ServiceWatchdog&) = delete;

 private:
  void report();

  const std::function<std::string()> check_;
  std::string problem_;
  unsigned timer_ = 0;
};

}  // namespace lf::serve
