// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include "image/image.h"
#include "support/photographs.h"
#include "support/process.h"
#include "support/test.h"

namespace lf::test {

inline bool becomes(const std::function<bool()>& condition, int seconds = kFallsBehind ? 240 : 60) {
  for (int i = 0; i < 20 * seconds; i++) {
    if (condition()) return true;
    g_usleep(50000);
  }
  return false;
}

class Served {
 public:
  // `edit` may change the cameras' sources.
  explicit Served(const std::vector<std::string>& options = {}, const std::function<void(Rig&)>& edit = {}) {
    Rig rig = scene_rig(2, 2, 64, 48);
    save_photographs(rig, dir_, 0, 1);
    if (edit) edit(rig);
    save_rig(rig, dir_ / "rig.json");
    std::vector<std::string> words = {LF_TOOLS_DIR "/lf-serve", "--rig", dir_ / "rig.json", "--port", "0"};
    words.insert(words.end(), options.begin(), options.end());
    begin(words, "serving", nullptr);
  }
  struct SceneNotFilmed {
    std::string cache;
  };
  explicit Served(const SceneNotFilmed& unfilmed) {
    begin({LF_TOOLS_DIR "/lf-serve", "--port", "0"}, "filming", unfilmed.cache.c_str());
  }
  struct ExistingRig {
    std::string path;
  };
  explicit Served(const ExistingRig& rig) {
    begin({LF_TOOLS_DIR "/lf-serve", "--rig", rig.path, "--port", "0"}, "serving", nullptr);
  }
  // Ends the program like a service manager; expects no CRITICAL in its output.
  ~Served() {
    stop();
    EXPECT_EQ(said_.find("CRITICAL"), said_.npos) << said_;
    g_object_unref(out_);
    g_object_unref(process_);
  }
  Served(const Served&) = delete;

  std::string rig() const { return dir_ / "rig.json"; }
  std::string pid() const { return g_subprocess_get_identifier(process_); }
  // "http://127.0.0.1:PORT/", or "" if the server failed, see said().
  const std::string& url() const { return url_; }
  std::string said() const {
    const std::lock_guard lock(mutex_);
    return said_;
  }
  std::string metric(const std::string& name) const {
    SoupSession* session = soup_session_new();
    SoupMessage* message = soup_message_new("GET", (url_ + "metrics").c_str());
    GBytes* bytes = soup_session_send_and_read(session, message, nullptr, nullptr);
    gsize size = 0;
    const char* data = bytes ? static_cast<const char*>(g_bytes_get_data(bytes, &size)) : nullptr;
    const std::string text = "\n" + std::string(data ? data : "", size), line = "\nlightfield_" + name + " ";
    if (bytes) g_bytes_unref(bytes);
    g_object_unref(message);
    g_object_unref(session);
    const size_t at = text.find(line);
    if (at == text.npos) return "none";
    return text.substr(at + line.size(), text.find('\n', at + 1) - at - line.size());
  }
  // Returns the exit status, or -1 if killed by a signal. Then said() has the complete output.
  int stop() {
    if (!stopped_) {
      g_subprocess_send_signal(process_, SIGTERM);
      listener_.join();
      g_subprocess_wait(process_, nullptr, nullptr);
      stopped_ = true;
    }
    return g_subprocess_get_if_exited(process_) ? g_subprocess_get_exit_status(process_) : -1;
  }

 private:
  void begin(const std::vector<std::string>& words, const std::string& beginning, const char* cache) {
    std::vector<const char*> argv;
    for (const std::string& word : words) argv.push_back(word.c_str());
    argv.push_back(nullptr);
    GSubprocessLauncher* launcher =
        g_subprocess_launcher_new(GSubprocessFlags(G_SUBPROCESS_FLAGS_STDOUT_PIPE | G_SUBPROCESS_FLAGS_STDERR_MERGE));
    if (cache) g_subprocess_launcher_setenv(launcher, "XDG_CACHE_HOME", cache, TRUE);
    process_ = g_subprocess_launcher_spawnv(launcher, argv.data(), nullptr);
    g_object_unref(launcher);
    out_ = g_data_input_stream_new(g_subprocess_get_stdout_pipe(process_));
    while (const std::optional<std::string> line = read_line()) {
      said_ += *line + "\n";
      if (const size_t at = line->find(" at http"); line->starts_with(beginning) && at != line->npos) {
        url_ = line->substr(at + 4);
        url_.resize(std::min(url_.size(), url_.find(' ')));
        break;
      }
    }
    listener_ = std::thread([this] {
      while (const std::optional<std::string> line = read_line()) {
        const std::lock_guard lock(mutex_);
        said_ += *line + "\n";
      }
    });
  }
  // Returns the next line, or nullopt at the end. Lines may be empty, like the first line of a GLib warning.
  std::optional<std::string> read_line() {
    g_autofree gchar* line = g_data_input_stream_read_line(out_, nullptr, nullptr, nullptr);
    return line ? std::optional<std::string>(line) : std::nullopt;
  }

  TempDir dir_;
  GSubprocess* process_;
  GDataInputStream* out_;
  std::string url_;
  mutable std::mutex mutex_;
  std::string said_;
  std::thread listener_;
  bool stopped_ = false;
};

}  // namespace lf::test
