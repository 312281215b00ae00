// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "image/image.h"
#include "support/temp_dir.h"

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

// The array of the paper's Figure 2 on hosts of its own: 64 cameras (stills of the built-in scene, so that a picture
// does not depend on when it is taken) on six camera hosts, a compositor host and two viewer hosts, each a line of
// gst-launch-1.0.
class ArrayNetwork {
 public:
  static constexpr int kNodes = 6, kViewers = 2;
  static constexpr int kWidth = 320, kHeight = 240;
  static const char* const kCameras[kNodes];  // 4 x 8 + 2 x 16

  struct Options {
    // Requests a second of each viewer, and milliseconds that answers may take: no more than eight programs on two
    // processors keep up with.
#ifdef __SANITIZE_ADDRESS__
    int framerate = 3, latency = 600;
#else
    int framerate = 15, latency = 60;
#endif
    bool surface = false;  // pictures are of what the compositors find, of eyes that stand still; else of planes
    std::string link;      // an element that requests and answers pass on their way from host to host
    std::string camera, viewer[kViewers];  // further properties of each lfnodesink, and of a viewer's lfviewrequest
  };
  explicit ArrayNetwork(const Options& options);

  static constexpr int kViewerPort = 6200, kVideoPort = 6300;  // requests to the compositor host, pictures to viewers

  // Any other program on one of the hosts c0 to c5, compositor, v0, v1.
  std::unique_ptr<Process> start(const std::string& host, const std::vector<std::string>& command) const {
    return network_.start(host, with_environment(command));
  }
  const std::string& address(const std::string& host) const { return network_.address(host); }
  std::string path_file(int view) const { return file("views" + std::to_string(view) + ".json"); }

  // Starts the links, too.
  void start_node(int node);
  void start_compositor();
  void start_viewer(int viewer);
  void start_all();

  Process& node(int i) { return *nodes_[i]; }
  Process& viewer(int i) { return *viewers_[i]; }
  Process& compositor() { return *compositor_; }

  // Pictures of a view so far.
  struct Picture {
    double time;  // when its message was written, seconds
    uint32_t sequence;
    bool complete;
    unsigned missing;
    double latency_ms;  // request at the compositor host to picture
    uint64_t bytes;     // of the answers
  };
  std::vector<Picture> pictures(int view) const;
  // Waits for so many more of them. False after half a minute, or if there are no more.
  bool wait_for_pictures(int view, int count) const;
  // The newest complete picture of the view as it comes out of the compositor and which request it answers. Waits for
  // one made after this call.
  Image next_picture(int view, uint32_t* sequence);
  // Those that were kept of the latest, complete or not, each with the request it answers.
  std::vector<std::pair<Image, uint32_t>> latest_pictures(int view) const;
  // The same pictures on one machine, one for each view of the path, without the cameras of these ids.
  std::vector<Image> one_machine(int view, const std::string& out_of_service = "") const;
  // The ground truth of the same views.
  std::vector<Image> truth(int view) const;

  static constexpr int kViewsOfPath = 5;

 private:
  std::string file(const std::string& name) const { return folder_.path() + "/" + name; }
  std::vector<std::string> with_environment(std::vector<std::string> command) const;
  // What comes to this port of the host goes on to another port by way of Options::link.
  void start_link(const std::string& host, int port, const std::string& to, int to_port);

  Options options_;
  TempDir folder_;
  Network network_;
  std::unique_ptr<Process> nodes_[kNodes], viewers_[kViewers], compositor_;
  std::map<std::string, std::unique_ptr<Process>> links_;  // by host and port
  // What pictures() has read of the compositor's log; by view.
  mutable size_t lines_read_ = 0;
  mutable std::map<int, std::vector<Picture>> pictures_;
};

}  // namespace lf::test
