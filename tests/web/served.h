// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <list>

#include <libsoup/soup.h>

#include "image/image.h"
#include "support/photographs.h"
#include "support/process.h"
#include "support/test.h"

namespace lf::test {

inline bool becomes(const std::function<bool()>& condition, int seconds = kFallsBehind ? 240 : 60) {
  return eventually(condition, seconds);
}

using Headers = std::map<std::string, std::string>;
struct Response {
  guint status = 0;
  std::string body;
  Headers headers;
};

// Sends one HTTP request. `body` and its `type` are sent with POST only.
inline Response fetch(SoupSession* session, const std::string& method, const std::string& url,
                      const Headers& headers = {}, const std::string& body = "",
                      const std::string& type = "application/sdp") {
  g_autoptr(SoupMessage) message = soup_message_new(method.c_str(), url.c_str());
  if (!message) {
    ADD_FAILURE() << "lf-serve does not run";
    return {};
  }
  for (const auto& [name, value] : headers)
    soup_message_headers_replace(soup_message_get_request_headers(message), name.c_str(), value.c_str());
  if (method == "POST") {
    g_autoptr(GBytes) bytes = g_bytes_new(body.data(), body.size());
    soup_message_set_request_body_from_bytes(message, type.c_str(), bytes);
  }
  Response response;
  g_autoptr(GError) error = nullptr;
  g_autoptr(GBytes) bytes = soup_session_send_and_read(session, message, nullptr, &error);
  EXPECT_EQ(error, nullptr) << error->message;
  gsize size = 0;
  const char* data = bytes ? static_cast<const char*>(g_bytes_get_data(bytes, &size)) : nullptr;
  response.body.assign(data ? data : "", size);
  response.status = soup_message_get_status(message);
  soup_message_headers_foreach(
      soup_message_get_response_headers(message),
      [](const char* name, const char* value, gpointer all) { (*static_cast<Headers*>(all))[name] = value; },
      &response.headers);
  return response;
}

// Returns a value from the text of /metrics, or "none".
inline std::string metric_in(const std::string& metrics, const std::string& name) {
  const std::string text = "\n" + metrics, line = "\nlightfield_" + name + " ";
  const size_t at = text.find(line);
  if (at == text.npos) return "none";
  return text.substr(at + line.size(), text.find('\n', at + 1) - at - line.size());
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
  // `home` is the folder of the user's cache, configuration and data.
  struct Demo {
    const TempDir& home;
    std::string program = LF_TOOLS_DIR "/lf-serve", beginning = "filming";
    std::vector<std::string> options = {};
  };
  explicit Served(const Demo& demo) {
    std::vector<std::string> words = {demo.program, "--port", "0"};
    words.insert(words.end(), demo.options.begin(), demo.options.end());
    begin(words, demo.beginning, demo.home.path().c_str());
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
  bool says(const std::vector<std::string>& facts) const {
    return becomes([&] { return testing::Value(said(), mentions(facts)); });
  }
  Response ask(const std::string& method, const std::string& path, const std::string& body = "") const {
    g_autoptr(SoupSession) session = soup_session_new();
    return fetch(session, method, url_ + path, {}, body);
  }
  std::string get(const std::string& path) const { return ask("GET", path).body; }
  std::string metric(const std::string& name) const { return metric_in(get("metrics"), name); }
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
  void begin(const std::vector<std::string>& words, const std::string& beginning, const char* home) {
    std::vector<const char*> argv;
    for (const std::string& word : words) argv.push_back(word.c_str());
    argv.push_back(nullptr);
    g_autoptr(GSubprocessLauncher) launcher =
        g_subprocess_launcher_new(GSubprocessFlags(G_SUBPROCESS_FLAGS_STDOUT_PIPE | G_SUBPROCESS_FLAGS_STDERR_MERGE));
    if (home)
      for (const char* folder : {"XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"})
        g_subprocess_launcher_setenv(launcher, folder, home, TRUE);
    process_ = g_subprocess_launcher_spawnv(launcher, argv.data(), nullptr);
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

// A TCP connection to lf-serve, from an address of the loopback network.
class Client {
 public:
  explicit Client(const Served& served, const std::string& address = "127.0.0.1") {
    g_autoptr(GUri) uri = g_uri_parse(served.url().c_str(), G_URI_FLAGS_NONE, nullptr);
    const int port = uri ? g_uri_get_port(uri) : 0;
    g_autoptr(GSocketClient) connector = g_socket_client_new();
    g_autoptr(GSocketAddress) from = g_inet_socket_address_new_from_string(address.c_str(), 0);
    g_socket_client_set_local_address(connector, from);
    g_socket_client_set_timeout(connector, 60);
    connection_ = g_socket_client_connect_to_host(connector, "127.0.0.1", static_cast<guint16>(port), nullptr, nullptr);
  }
  ~Client() { g_clear_object(&connection_); }
  Client(const Client&) = delete;

  void send(const std::string& bytes) {
    ASSERT_TRUE(connection_);
    g_output_stream_write_all(g_io_stream_get_output_stream(G_IO_STREAM(connection_)), bytes.data(), bytes.size(),
                              nullptr, nullptr, nullptr);
  }
  std::string read() {
    std::string text;
    char part[4096];
    GInputStream* in = connection_ ? g_io_stream_get_input_stream(G_IO_STREAM(connection_)) : nullptr;
    for (gssize size = 0; in && (size = g_input_stream_read(in, part, sizeof part, nullptr, nullptr)) > 0;)
      text.append(part, static_cast<size_t>(size));
    return text;
  }

 private:
  GSocketConnection* connection_ = nullptr;
};

}  // namespace lf::test
