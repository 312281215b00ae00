// SPDX-License-Identifier: LGPL-2.1-or-later
#include "network/hosts.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <stdexcept>

namespace lf::test {
namespace {

bool shell(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }

void must(const std::string& command) {
  if (!shell(command)) throw std::runtime_error("failed: " + command);
}

}  // namespace

double now_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Process::Process(const std::vector<std::string>& command) {
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  std::vector<char*> argv;
  for (const std::string& argument : command) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    setpgid(0, 0);
    dup2(pipe_ends[1], STDOUT_FILENO);
    dup2(pipe_ends[1], STDERR_FILENO);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  close(pipe_ends[1]);
  if (pid_ < 0) throw std::runtime_error("no process");
  setpgid(pid_, pid_);
  reader_ = std::thread([this, fd = pipe_ends[0]] { read(fd); });
}

Process::~Process() {
  if (!ended_) {
    signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  reader_.join();
}

void Process::read(int fd) {
  std::string rest;
  char buffer[4096];
  while (const ssize_t n = ::read(fd, buffer, sizeof buffer)) {
    if (n < 0) break;
    rest.append(buffer, static_cast<size_t>(n));
    std::lock_guard lock(mutex_);
    for (size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1))
      lines_.push_back({now_seconds(), rest.substr(0, end)});
    written_.notify_all();
  }
  close(fd);
  std::lock_guard lock(mutex_);
  silent_ = true;
  written_.notify_all();
}

void Process::signal(int number) {
  if (!ended_) kill(-pid_, number);
}

bool Process::is_running() {
  if (!ended_ && waitpid(pid_, nullptr, WNOHANG) == pid_) ended_ = true;
  return !ended_;
}

std::vector<Process::Line> Process::lines(size_t without) const {
  std::lock_guard lock(mutex_);
  return {lines_.begin() + static_cast<ptrdiff_t>(std::min(without, lines_.size())), lines_.end()};
}

std::string Process::text() const {
  std::string all;
  for (const Line& line : lines()) all += line.text + "\n";
  return all;
}

bool Process::wait_for(const std::string& text, int count, double seconds) const {
  std::unique_lock lock(mutex_);
  int found = 0;
  size_t next = 0;
  const auto there = [&] {
    for (; next < lines_.size(); next++) found += lines_[next].text.find(text) != std::string::npos;
    return found >= count;
  };
  written_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return silent_ || there(); });
  return there();
}

std::string Network::unavailable() {
  if (geteuid() != 0) return "network namespaces need root";
  if (!shell("command -v ip")) return "the program ip (package iproute2) is not installed";
  const std::string name = "lf-probe-" + std::to_string(getpid());
  const bool works = shell("ip netns add " + name + " && ip -n " + name +
                           " link add v0 type veth peer name v1 && ip -n " + name + " link add b0 type bridge");
  shell("ip netns del " + name);
  return works ? "" : "this kernel lets no network namespace, veth or bridge be made";
}

Network::Network(const std::vector<std::string>& hosts, int first) : prefix_("lf" + std::to_string(getpid()) + "-") {
  const std::string bridge = name_space("switch");
  must("ip netns add " + bridge);
  must("ip -n " + bridge + " link add b0 type bridge && ip -n " + bridge + " link set b0 up");
  int number = first - 1;
  for (const std::string& host : hosts) {
    const std::string ns = name_space(host), port = "p" + std::to_string(++number);
    addresses_[host] = "10.77.0." + std::to_string(number);
    must("ip netns add " + ns);
    must("ip -n " + ns + " link add eth0 type veth peer name " + port + " netns " + bridge);
    must("ip -n " + bridge + " link set " + port + " master b0 up");
    must("ip -n " + ns + " addr add " + addresses_[host] + "/24 dev eth0");
    must("ip -n " + ns + " link set lo up && ip -n " + ns + " link set eth0 up");
    must("ip -n " + ns + " route add 224.0.0.0/4 dev eth0");
  }
}

Network::~Network() {
  for (const auto& [host, address] : addresses_) shell("ip netns del " + name_space(host));
  shell("ip netns del " + name_space("switch"));
}

std::unique_ptr<Process> Network::start(const std::string& host, const std::vector<std::string>& command) const {
  std::vector<std::string> inside = {"ip", "netns", "exec", name_space(host)};
  inside.insert(inside.end(), command.begin(), command.end());
  return std::make_unique<Process>(inside);
}

}  // namespace lf::test
