// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace lf::test {

// A program on one of the hosts, in a process group of its own. Killed with it if it still runs.
class Process {
 public:
  struct Line {
    double time;  // when it was written, seconds of the realtime clock
    std::string text;
  };

  explicit Process(const std::vector<std::string>& command);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number);  // to the whole group
  bool is_running();
  // What it has written so far, both streams, without so many lines at the beginning.
  std::vector<Line> lines(size_t without = 0) const;
  std::string text() const;
  // Waits for a line that has `text` in it, as many times as `count`. False after so many seconds, or at its end.
  bool wait_for(const std::string& text, int count = 1, double seconds = 30) const;

 private:
  void read(int fd);

  pid_t pid_ = -1;
  bool ended_ = false;  // reaped
  mutable std::mutex mutex_;
  mutable std::condition_variable written_;
  std::vector<Line> lines_;
  bool silent_ = false;  // nothing more will be written
  std::thread reader_;
};

// Hosts on one Ethernet switch, each a network namespace; made and removed with the object.
class Network {
 public:
  // Empty if there can be one here, else the reason why not.
  static std::string unavailable();

  // The first one has address 10.77.0.`first`, the others follow.
  explicit Network(const std::vector<std::string>& hosts, int first = 1);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  // IPv4. Throws std::out_of_range for a host that is not there.
  const std::string& address(const std::string& host) const { return addresses_.at(host); }
  // Starts a program with its arguments on a host.
  std::unique_ptr<Process> start(const std::string& host, const std::vector<std::string>& command) const;

 private:
  std::string name_space(const std::string& host) const { return prefix_ + host; }

  std::string prefix_;
  std::map<std::string, std::string> addresses_;
};

double now_seconds();  // realtime clock

}  // namespace lf::test
