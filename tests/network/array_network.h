// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "image/image.h"
#include "support/temp_dir.h"

namespace lf::test {

// A program on a host, in its own process group. The destructor kills the group.
class Process {
 public:
  struct Line {
    double time;  // time of output, seconds of the realtime clock
    std::string text;
  };

  explicit Process(const std::vector<std::string>& command);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number);
  bool is_running();
  // Returns the output so far, stdout and stderr, without the first `without` lines.
  std::vector<Line> lines(size_t without = 0) const;
  std::string text() const;
  // Waits until `count` lines contain `text`. Returns false after `seconds`, or when the program ends.
  bool wait_for(const std::string& text, int count = 1, double seconds = 30) const;

 private:
  void read(int fd);

  pid_t pid_ = -1;
  bool ended_ = false;
  mutable std::mutex mutex_;
  mutable std::condition_variable written_;
  std::vector<Line> lines_;
  bool silent_ = false;  // end of output reached
  std::thread reader_;
};

// Hosts on an Ethernet switch, each a network namespace. The destructor removes the hosts.
class Network {
 public:
  static std::string unavailable();

  // The first host has the address 10.77.0.`first`; the rest follow.
  explicit Network(const std::vector<std::string>& hosts, int first = 1);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  const std::string& address(const std::string& host) const { return addresses_.at(host); }
  std::unique_ptr<Process> start(const std::string& host, const std::vector<std::string>& command) const;

 private:
  std::string name_space(const std::string& host) const { return prefix_ + host; }

  std::string prefix_;
  std::map<std::string, std::string> addresses_;
};

double now_seconds();

// The array of the paper's Figure 2 on separate hosts: 64 cameras on six camera hosts, a compositor host and two viewer
// hosts, each a gst-launch-1.0 line. The cameras are stills of the built-in scene, so that frames do not depend on
// time.
class ArrayNetwork {
 public:
  static constexpr int kNodes = 6, kViewers = 2;
  static constexpr int kWidth = 320, kHeight = 240;
  static const char* const kCameras[kNodes];  // 4 x 8 + 2 x 16

  struct Options {
    // Requests per second of each viewer, and the answer deadline in milliseconds: eight programs on two processors
    // must keep up.
#ifdef __SANITIZE_ADDRESS__
    int framerate = 3, latency = 600;
#else
    int framerate = 15, latency = 60;
#endif
    bool surface = false;                  // true: estimated focal surface, with a fixed viewpoint; false: focal plane
    std::string link;                      // element between hosts for requests and answers
    std::string camera, viewer[kViewers];  // additional properties of each lfnodesink, and of a viewer's lfviewrequest
  };
  explicit ArrayNetwork(const Options& options);

  static constexpr int kViewerPort = 6200, kVideoPort = 6300;  // requests to the compositor host, frames to viewers

  std::unique_ptr<Process> start(const std::string& host, const std::vector<std::string>& command) const {
    return network_.start(host, with_environment(command));
  }
  const std::string& address(const std::string& host) const { return network_.address(host); }
  std::string path_file(int view) const { return file("views" + std::to_string(view) + ".json"); }

  void start_node(int node);
  void start_compositor();
  void start_viewer(int viewer);
  void start_all();

  Process& node(int i) { return *nodes_[i]; }
  Process& viewer(int i) { return *viewers_[i]; }
  Process& compositor() { return *compositor_; }

  struct Picture {
    double time;
    uint32_t sequence;
    bool complete;
    unsigned missing;
    double latency_ms;  // time between the request at the compositor host and the frame
    uint64_t bytes;
  };
  std::vector<Picture> pictures(int view) const;
  // Waits for `count` more frames. Returns false after 30 seconds, or when there are no more frames.
  bool wait_for_pictures(int view, int count) const;
  // Waits for the next complete frame of the view at the compositor's output. Sets the sequence number of its request.
  Image next_picture(int view, uint32_t* sequence);
  // Returns the stored recent frames, complete or not, with the sequence numbers of their requests.
  std::vector<std::pair<Image, uint32_t>> latest_pictures(int view) const;
  std::vector<Image> single_host(int view, const std::string& out_of_service = "") const;
  std::vector<Image> truth(int view) const;

  static constexpr int kViewsOfPath = 5;

 private:
  static std::string rig_file();
  std::string file(const std::string& name) const { return folder_.path() + "/" + name; }
  std::vector<std::string> with_environment(std::vector<std::string> command) const;
  void start_link(const std::string& host, int port, const std::string& to, int to_port);

  Options options_;
  TempDir folder_;
  Network network_;
  std::unique_ptr<Process> nodes_[kNodes], viewers_[kViewers], compositor_;
  std::map<std::string, std::unique_ptr<Process>> links_;
  mutable size_t lines_read_ = 0;
  mutable std::map<int, std::vector<Picture>> pictures_;
};

}  // namespace lf::test
