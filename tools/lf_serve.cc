// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve: serves the light field to browsers.
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gio/gio.h>
#include <glib-unix.h>
#include <gst/gst.h>

#include "base/file.h"
#include "base/text.h"
#include "bins/discovery.h"
#include "command_line.h"
#include "rig/rig_json.h"
#include "rig/source_security.h"
#include "serve/access.h"
#include "serve/http_server.h"
#include "serve/pipelines.h"
#include "serve/process.h"
#include "serve/rig_reload.h"
#include "terminal.h"
#include "view/view_path.h"

namespace {

namespace fs = std::filesystem;
using namespace lf::serve;

constexpr double kSceneFocus = 2.2;  // distance of the figure in the built-in scene, metres

struct Options {
  std::string rig, nodes, key_file, record, token_file, ice_credentials, media, resampling = "sharpened",
                                                                                renderer = "cpu";
  std::vector<std::string> origins, paths, hosts, proxies, ice_servers;
  std::vector<lf::NodeAddress> node_addresses;
  ServerOptions server;
  Limits limits;
  bool demo = false;  // is the same as an empty `rig`
  bool open_page = false;
  bool watch = false;
  bool trusted = false;
  int capture_delay_ms = -1;  // negative: the default, which depends on the cameras
};

std::pair<std::string, CameraPath> parse_path(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == text.npos || equals == 0)
    throw lf::Error("--path " + text + ": must be NAME=FILE, such as tour=tour.json");
  const std::string file = text.substr(equals + 1);
  const lf::View view = lf::load_views(file).front().view;
  if (view.width % 2 || view.height % 2)
    throw lf::Error(
        file + ": the width and the height of all views must be even, because the video has chroma at half resolution");
  return {text.substr(0, equals), {file, view.width, view.height}};
}

std::vector<lf::NodeAddress> nodes_of(const std::string& text, const std::string& rig) {
  if (text.empty()) return {};
  const lf::Rig loaded = lf::load_rig(rig);
  try {
    return lf::find_nodes(text, loaded, [](const std::string& warning) { say("warning: --nodes " + warning); });
  } catch (const lf::Error& error) {
    throw lf::Error(std::string("--nodes ") + error.what());
  }
}

gboolean quit(gpointer loop) {
  g_main_loop_quit(static_cast<GMainLoop*>(loop));
  return G_SOURCE_CONTINUE;
}

// Returns the local address that sends video; empty means all addresses.
std::string media_address(const std::string& text) {
  if (text == "any" || text == "0.0.0.0" || text == "::") return "";
  if (text == "localhost") return "127.0.0.1";
  const std::string address = plain_address(text);
  if (address.empty() || !is_local_address(address))
    throw lf::Error("--media-address " + text +
                    ": is not an IP address of this machine; give one of its addresses, or any");
  return address;
}

std::string token_in(const std::string& path) {
  std::string token = lf::read_secret_file(path);
  while (!token.empty() && g_ascii_isspace(token.back())) token.pop_back();
  if (token.empty())
    throw lf::Error(path +
                    ": the file is empty, but must contain a token; create one with: openssl rand -hex 16 >FILE");
  if (!std::ranges::all_of(token, [](char c) { return c >= ' ' && c <= '~'; }))
    throw lf::Error(path +
                    ": the token contains a line break or another character that is not printable ASCII; create a "
                    "token with: openssl rand -hex 16 >FILE");
  constexpr size_t kShort = 16;
  if (token.size() < kShort)
    terminal::print_error(
        "warning: %s: the token has only %zu characters and can be guessed; create a longer token with: "
        "openssl rand -hex 16 >FILE\n",
        path.c_str(), token.size());
  return token;
}

void check_options(Options& options) {
  if (!options.nodes.empty() && options.rig.empty())
    throw lf::Error("--nodes: requires --rig, a rig file with the poses of the cameras on these hosts");
  if (!options.record.empty() && !options.nodes.empty())
    throw lf::Error(
        "--record: cannot be used with --nodes, because each host records its own cameras; set record=FOLDER at its "
        "lfnodesink");
  if (!options.record.empty() && options.watch)
    throw lf::Error("--record: cannot be used with --watch, because the cameras must not change during a recording");
  if (options.watch && options.rig.empty())
    throw lf::Error(
        "--watch: requires --rig, because lf-serve watches this "
        "file for changes");
  if (!options.key_file.empty() && options.nodes.empty())
    throw lf::Error("--key-file: requires --nodes, because the key only encrypts the packets to and from these hosts");
  const std::string& replica = options.limits.replica;
  if (replica.size() > 32 || !std::ranges::all_of(replica, [](char c) { return g_ascii_isalnum(c); }))
    throw lf::Error("--replica " + replica + ": must have at most 32 characters, only letters and digits");
  const FocusSettings& focus = options.limits.focus_settings;
  if (focus.far > 0 && focus.near >= focus.far) throw lf::Error("--focus-near: must be less than --focus-far");
  if (!options.token_file.empty()) options.server.token = token_in(options.token_file);
  for (const std::string& path : options.paths) options.server.whep.paths.insert(parse_path(path));
  options.server.origins.insert(options.origins.begin(), options.origins.end());
  options.server.hosts.insert(options.hosts.begin(), options.hosts.end());
  for (const std::string& proxy : options.proxies) options.server.proxies.merge(proxy_addresses(proxy));
  options.server.whep.ice = IceServers(
      options.ice_servers, options.ice_credentials.empty() ? "" : lf::read_secret_file(options.ice_credentials));
  options.server.whep.relays = options.server.whep.ice.relays();
  options.server.whep.media_address = media_address(options.media.empty() ? options.server.address : options.media);
}

// Films the built-in scene with lf-scene in a child process. Main thread only.
class SceneFilming {
 public:
  // The first instant of the scene as stills, which lf-scene makes in seconds, or the whole film, which loops.
  enum class Length { kFirstFrame, kFilm };
  static std::string rig(Length length) { return folder(length) / "rig.json"; }
  // lf-scene writes the rig file last.
  static bool exists() { return fs::exists(rig(Length::kFilm)); }

  // Starts filming. At the end, `on_end` is called once with an error, or with an empty text after success. Throws
  // Error.
  SceneFilming(Length length, std::function<void(const std::string& problem)> on_end)
      : on_end_(std::move(on_end)), cancellable_(g_cancellable_new()), began_(g_get_monotonic_time()) {
    std::error_code none;
    const fs::path beside = fs::read_symlink("/proc/self/exe", none).parent_path() / "lf-scene";
    const std::string program = fs::exists(beside, none) ? beside.string() : "lf-scene", out = folder(length);
    const bool one = length == Length::kFirstFrame;
    const char* const arguments[] = {program.c_str(),
                                     "--out",
                                     out.c_str(),
                                     "--grid",
                                     "8x8",
                                     "--width",
                                     "320",
                                     "--height",
                                     "240",
                                     "--frames",
                                     one ? "1" : "60",
                                     "--format",
                                     one ? "png" : "mjpeg",
                                     nullptr};
    g_autoptr(GSubprocessLauncher) launcher = g_subprocess_launcher_new(G_SUBPROCESS_FLAGS_STDERR_PIPE);
    // Viewers of the first frame have some priority, but the film must end even if they need all processors.
    constexpr auto kYield = [](gpointer) { [[maybe_unused]] const int now = nice(5); };
    if (!one) g_subprocess_launcher_set_child_setup(launcher, kYield, nullptr, nullptr);
    g_autoptr(GError) error = nullptr;
    process_ = g_subprocess_launcher_spawnv(launcher, arguments, &error);
    if (!process_) {
      g_object_unref(cancellable_);
      throw lf::Error(std::string("lf-scene: ") + error->message);
    }
    stderr_ = g_data_input_stream_new(g_subprocess_get_stderr_pipe(process_));
    read_line();
  }
  ~SceneFilming() {
    g_cancellable_cancel(cancellable_);
    g_subprocess_force_exit(process_);
    g_object_unref(stderr_);
    g_object_unref(process_);
    g_object_unref(cancellable_);
  }
  SceneFilming(const SceneFilming&) = delete;

  // lf-scene reports only every ten seconds, so the progress between reports is extrapolated.
  double progress() const {
    if (reported_at_ <= began_) return 0;
    const double speed = reported_ / static_cast<double>(reported_at_ - began_);
    constexpr double kNearlyDone = 0.99;
    return std::clamp(speed * static_cast<double>(g_get_monotonic_time() - began_), reported_, kNearlyDone);
  }

 private:
  static fs::path folder(Length length) {
    const fs::path film = fs::path(g_get_user_cache_dir()) / "gst-lightfield" / "scene-" LF_VERSION;
    return length == Length::kFilm ? film : film / "first";
  }

  void read_line() {
    g_data_input_stream_read_line_async(
        stderr_, G_PRIORITY_DEFAULT, cancellable_,
        [](GObject* stream, GAsyncResult* result, gpointer data) {
          g_autoptr(GError) error = nullptr;
          g_autofree gchar* line =
              g_data_input_stream_read_line_finish(G_DATA_INPUT_STREAM(stream), result, nullptr, &error);
          if (g_error_matches(error, G_IO_ERROR, G_IO_ERROR_CANCELLED)) return;  // `data` no longer exists
          SceneFilming* self = static_cast<SceneFilming*>(data);
          if (line) return self->parse_line(line);
          // Standard error is closed, so the process is about to exit.
          g_subprocess_wait(self->process_, nullptr, nullptr);
          const bool made =
              g_subprocess_get_if_exited(self->process_) && g_subprocess_get_exit_status(self->process_) == 0;
          self->on_end_(made ? "" : "lf-scene: " + (self->last_line_.empty() ? "terminated" : self->last_line_));
        },
        this);
  }
  void parse_line(const std::string& line) {
    int percent = 0;
    if (std::sscanf(line.c_str(), "filming: %d %%", &percent) == 1) {
      reported_ = std::clamp(percent, 0, 100) * 0.01;
      reported_at_ = g_get_monotonic_time();
    } else {
      last_line_ = line;
    }
    read_line();
  }

  std::function<void(const std::string&)> on_end_;
  GSubprocess* process_ = nullptr;
  GDataInputStream* stderr_ = nullptr;
  GCancellable* cancellable_;
  int64_t began_;
  double reported_ = 0;  // latest reported progress, 0 to 1
  int64_t reported_at_ = 0;
  std::string last_line_;
};

// The running program. It serves the page at once, and the light field as soon as the scene has been filmed and the
// cameras run.
class Program {
 public:
  explicit Program(const Options& options)
      : options_(options), loop_(g_main_loop_new(nullptr, FALSE)), server_(options.server, options.limits) {}
  ~Program() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
      if (field_) field_->cancel();
    }
    reloader_.reset();
    if (open_thread_.joinable()) open_thread_.join();
    if (sessions_) sessions_->close_all("the server ends");  // the server must still run, to notify the viewers
    server_.stop();
    sessions_.reset();
    if (timer_) g_source_remove(timer_);
    g_main_loop_unref(loop_);
  }

  // Runs until SIGINT or SIGTERM. Throws Error.
  void run() {
    const guint signals[] = {g_unix_signal_add(SIGINT, quit, loop_), g_unix_signal_add(SIGTERM, quit, loop_)};
    warn_of_missing_token();
    const ServiceWatchdog watchdog;
    notify_service("READY=1\nSTATUS=opening the cameras");
    if (options_.open_page) open_page();
    if (options_.rig.empty())
      film();
    else
      open();
    g_main_loop_run(loop_);
    for (const guint source : signals) g_source_remove(source);
    notify_service("STOPPING=1");
    if (!failure_.empty()) throw lf::Error(failure_);
  }

 private:
  void fail(const std::string& why) {
    failure_ = why;
    g_main_loop_quit(loop_);
  }

  void warn_of_missing_token() const {
    if (!options_.server.token.empty() || is_loopback(options_.server.address)) return;
    const std::string url = server_.url();
    terminal::print_error(
        "warning: no token: everybody who reaches %s can watch; to require a token: openssl rand -hex 16 >token "
        "&& chmod 600 token, then lf-serve --token-file token\n",
        url.c_str());
  }

  void open_page() const {
    g_autoptr(GError) error = nullptr;
    const std::string url = server_.url();
    if (!g_app_info_launch_default_for_uri(url.c_str(), nullptr, &error))
      terminal::print_error("warning: --open: no browser: %s; open %s\n", error->message, url.c_str());
  }

  // Viewers see the first frame until the film is complete.
  void film() {
    using Length = SceneFilming::Length;
    options_.rig = SceneFilming::rig(Length::kFilm);
    if (options_.limits.focus == 0) options_.limits.focus = kSceneFocus;
    if (SceneFilming::exists()) {
      std::error_code ignored;
      fs::remove_all(fs::path(SceneFilming::rig(Length::kFirstFrame)).parent_path(), ignored);
      return open();
    }
    terminal::print(
        "filming the built-in scene (only once, stored as %s); meanwhile, the page at %s shows its first "
        "frame\n",
        options_.rig.c_str(), server_.url().c_str());
    server_.show_filming(0);
    film_ = std::make_unique<SceneFilming>(Length::kFirstFrame, [this](const std::string& problem) {
      if (!problem.empty()) return fail(problem);
      server_.show_starting();
      options_.rig = SceneFilming::rig(Length::kFirstFrame);
      try {
        lf::Rig stills = lf::load_rig(options_.rig);
        for (lf::Camera& camera : stills.cameras) camera.source.clear();  // a sequence of one image
        lf::save_rig(stills, options_.rig);
        rest_ = std::make_unique<SceneFilming>(Length::kFilm, [this](const std::string& why) {
          if (!why.empty()) return terminal::print_error("warning: the scene does not move: %s\n", why.c_str());
          has_film_ = true;
          if (reloader_) show_film();
        });
      } catch (const lf::Error& error) {
        return fail(error.what());
      }
      open();
    });
    constexpr guint kEvery = 500;  // milliseconds
    timer_ = g_timeout_add(
        kEvery,
        [](gpointer data) -> gboolean {
          Program* self = static_cast<Program*>(data);
          if (!self->sessions_ && !self->open_thread_.joinable()) self->server_.show_filming(self->film_->progress());
          return G_SOURCE_CONTINUE;
        },
        this);
  }

  void show_film() {
    try {
      reloader_->load(SceneFilming::rig(SceneFilming::Length::kFilm));
    } catch (const lf::Error& error) {
      fail(error.what());
    }
  }

  // Opening cameras may take a minute, so it runs on a separate thread.
  void open() {
    open_thread_ = std::thread([this] {
      std::string problem;
      try {
        auto field =
            std::make_unique<LightField>(options_.rig, options_.node_addresses, options_.key_file, options_.resampling,
                                         options_.renderer, options_.record, max_views(), options_.trusted);
        {
          const std::lock_guard lock(mutex_);
          field_ = std::move(field);
          if (ending_) field_->cancel();
        }
        field_->start([this](const std::string& what) { fail(what); });
      } catch (const lf::Error& error) {
        problem = error.what();
      }
      on_main_thread([this, problem] {
        if (problem.empty())
          serve();
        else
          fail(problem);
      });
    });
  }

  // Each path has a flight per codec.
  int max_views() const { return options_.limits.viewers + static_cast<int>(2 * options_.server.whep.paths.size()); }

  // Network cameras need more time because of their jitter buffer, see `latency` of lfcamsrc.
  int capture_delay() const {
    constexpr int kOfNetworkCameras = 300;  // milliseconds
    if (options_.capture_delay_ms >= 0) return options_.capture_delay_ms;
    const bool any = std::ranges::any_of(field_->array()->rig().cameras,
                                         [](const lf::Camera& camera) { return camera.source.starts_with("rtsp"); });
    return any ? kOfNetworkCameras : options_.limits.capture_delay_ms;
  }

  void serve() {
    options_.limits.capture_delay_ms = capture_delay();
    sessions_ = std::make_unique<Sessions>(*field_, options_.limits);
    server_.serve(*field_, *sessions_);
    reloader_ = std::make_unique<RigReloader>(*field_, *sessions_, options_.watch);
    if (has_film_) show_film();
    notify_service("STATUS=serving " + options_.rig);
    terminal::print("serving %s at %s\n", options_.rig.c_str(), server_.url().c_str());
    if (const std::string warning = lf::secret_warning(field_->array()->rig(), options_.rig); !warning.empty())
      terminal::print_error("warning: %s: %s\n", options_.rig.c_str(), warning.c_str());
  }

  Options options_;
  GMainLoop* loop_;
  HttpServer server_;
  std::unique_ptr<SceneFilming> film_, rest_;
  bool has_film_ = false;  // true if `rest_` has ended
  std::thread open_thread_;
  std::mutex mutex_;
  bool ending_ = false;                // guarded by mutex_
  std::unique_ptr<LightField> field_;  // set once by `open_thread_`, under mutex_
  std::unique_ptr<Sessions> sessions_;
  std::unique_ptr<RigReloader> reloader_;
  guint timer_ = 0;
  std::string failure_;
};

void serve(Options& options) {
  check_options(options);
  options.node_addresses = nodes_of(options.nodes, options.rig);
  prepare_elements();
  Program(options).run();
}

void add_camera_options(cli::App& app, Options& o) {
  cli::Option* rig = app.add_option("--rig", o.rig,
                                    "Rig file, which lists the cameras of the array. Without this option, lf-serve "
                                    "shows the built-in scene (--demo)")
                         ->type_name("RIG.json");
  app.add_flag("--demo", o.demo,
               "Show the built-in scene, which lf-serve films once and then keeps in the user's cache folder. Viewers "
               "see the first frame of the scene until the film is complete. This is the default without --rig")
      ->excludes(rig);
  app.add_flag("--watch", o.watch,
               "Reload the rig file whenever it changes, for example after a calibration. Viewers stay connected. If "
               "cameras or sources have changed, lf-serve reopens the cameras");
  cli::add_trust_option(app, o.trusted);
  app.add_option("--nodes", o.nodes,
                 "Comma-separated list of the hosts that run the cameras, each with an lfnodesink. An item is "
                 "HOST:PORT-THERE:PORT-HERE, for example camhost0:6000:6100. Requests are sent to UDP port PORT-THERE "
                 "of HOST, and the answers of the host arrive at PORT-HERE of this machine. The value auto finds the "
                 "hosts that announce cameras of the rig by DNS-SD. Without this option, lf-serve opens the cameras "
                 "itself");
  app.add_option("--key-file", o.key_file,
                 "File with the secret that encrypts the packets between this machine and the hosts of --nodes. The "
                 "secret has 32 or more random characters and must be the same on all of these machines");
  app.add_option("--record", o.record,
                 "Folder that receives a recording of all cameras, with one file per camera. To play the recording "
                 "later, pass its rig.json to --rig")
      ->type_name("FOLDER");
}

void add_server_options(cli::App& app, Options& o) {
  app.add_flag("--open", o.open_page, "Open the page in the default browser of this machine");
  app.add_option("--listen", o.server.address,
                 "IP address that the server listens on, for example 0.0.0.0 for all addresses of this machine. Every "
                 "address other than loopback needs either --tls-certificate and --tls-key, or --insecure");
  app.add_option("--port", o.server.port,
                 "TCP port of the web page (0: the system selects a free port, and lf-serve prints the address)")
      ->check(cli::Range(0, 65535));
  app.add_option("--tls-certificate", o.server.certificate,
                 "File with the certificate chain for HTTPS, in PEM format. It also requires --tls-key")
      ->type_name("FILE.pem");
  app.add_option("--tls-key", o.server.key,
                 "File with the private key of the certificate, in PEM format. Other users must not be able to read it")
      ->type_name("FILE.pem");
  app.add_flag("--insecure", o.server.insecure,
               "Allow unencrypted HTTP on addresses other than loopback. Use this only in a trusted network, or behind "
               "a proxy that adds TLS");
  app.add_option("--token-file", o.token_file,
                 "File with the bearer token, a secret text that viewers must present. They open the page with "
                 "#token=TOKEN in its address. Without this option, everyone who can reach the server can watch")
      ->type_name("FILE");
  app.add_option("--origin", o.origins,
                 "Origin of another web site with pages that may embed the viewer, such as https://example.org. Use "
                 "null for pages opened from files, and * for any site. The option may be repeated");
  app.add_option("--host", o.hosts,
                 "Additional host name under which viewers reach this server, for example lightfield.example.org. "
                 "Requests with any other name in the Host header are refused, which protects against DNS rebinding. "
                 "The option may be repeated")
      ->type_name("NAME");
  app.add_option("--proxy", o.proxies,
                 "IP address of a reverse proxy in front of this server. The server uses the headers X-Forwarded-For "
                 "and X-Forwarded-Prefix only in requests from such a proxy, because other clients could forge these "
                 "headers. The option may be repeated")
      ->type_name("ADDRESS");
  app.add_option(
         "--replica", o.limits.replica,
         "Name of this server among several servers behind one proxy: letters and digits. The IDs of WHEP sessions "
         "and the tickets of the queue begin with it, so that the proxy can send requests for them to this server")
      ->type_name("NAME");
  app.add_option("--media-address", o.media,
                 "IP address of this machine that sends the video, or any for all of its addresses. Set this if "
                 "viewers reach the page through a proxy, but receive the video directly. By default, the address of "
                 "--listen sends the video")
      ->type_name("ADDRESS");
  app.add_option("--ice-server", o.ice_servers,
                 "STUN or TURN server for viewers that cannot reach this machine directly, for example because of a "
                 "firewall. The form is stun:HOST:PORT or turn:HOST:PORT?transport=udp. lf-serve uses the server, too. "
                 "The option may be repeated")
      ->type_name("URI");
  app.add_option("--ice-credentials", o.ice_credentials,
                 "File with the credentials for the TURN servers of --ice-server. The file contains either USER "
                 "PASSWORD, or only the secret that a TURN server with use-auth-secret shares with lf-serve")
      ->type_name("FILE");
  app.add_option("--path", o.paths,
                 "Camera path that the server plays for viewers that open the page with #path=NAME in its address, for "
                 "example tour=tour.json. FILE contains the views of the path, as written by lf-path. The option may "
                 "be repeated")
      ->type_name("NAME=FILE");
}

void add_view_options(cli::App& app, Options& o) {
  app.add_option("--viewers", o.limits.viewers,
                 "Maximum number of viewers at a time. A stereo viewer counts twice, because each eye needs a separate "
                 "view. Further viewers wait in a queue. Reduce this if the machine is too slow for so many viewers")
      ->check(cli::Range(1, 1000));
  app.add_option(
         "--watchers", o.limits.watchers,
         "Maximum number of viewers that watch a camera path of --path. All viewers of a path share one video, so "
         "they cost much less than views and do not count for --viewers")
      ->check(cli::Range(1, 10000));
  app.add_option("--address-views", o.limits.address_views,
                 "Maximum number of views at a time for one client address, so that one client cannot take all places. "
                 "A stereo viewer needs 2 views")
      ->check(cli::Range(1, 1000));
  app.add_option("--framerate", o.limits.framerate,
                 "Frame rate of the video for viewers, in pictures per second. A "
                 "lower rate leaves time for more viewers")
      ->check(cli::Range(1, 120));
  app.add_option("--capture-delay", o.capture_delay_ms,
                 "Time from the capture of a frame to the request for it, in milliseconds. It must exceed the latency "
                 "of the cameras. Otherwise the requested frames have not arrived yet, and pictures become incomplete "
                 "(default: 100, or 300 with RTSP cameras)")
      ->check(cli::Range(0, 10000));
  app.add_option(
         "--focus", o.limits.focus,
         "Initial distance of the focal plane from the viewer, in metres. Viewers can change it later (default: 4 "
         "times the size of the array)")
      ->check(cli::PositiveNumber);
  app.add_option("--focus-mode", o.limits.focus_settings.mode,
                 "Focus of the pictures. plane: one plane is in focus, at the distance that the viewer sets. surface: "
                 "the depth of each pixel is estimated, so that the whole picture is in focus. auto: as surface, but "
                 "the depths are updated only as often as the scene needs")
      ->check(cli::IsMember({"plane", "surface", "auto"}));
  app.add_option("--focus-near", o.limits.focus_settings.near,
                 "Minimum distance of objects from the array, in metres, for the depth estimation of --focus-mode. Set "
                 "this if the distance is known, because a smaller depth range gives more reliable results (default: "
                 "depends on the scene)")
      ->check(cli::PositiveNumber);
  app.add_option(
         "--focus-far", o.limits.focus_settings.far,
         "Maximum distance of objects from the array, in metres, for the depth estimation of --focus-mode (default: "
         "depends on the scene)")
      ->check(cli::PositiveNumber);
  app.add_option("--gains", o.limits.focus_settings.gains,
                 "Exposure compensation, which matches the brightness of each camera to the rest of the array. It "
                 "prevents visible seams between cameras (default: on unless the rig has colour models)")
      ->check(cli::IsMember({"on", "off", "auto"}));
  app.add_option("--resampling", o.resampling,
                 "Interpolation of the camera images between pixel positions. sharpened restores most of the detail "
                 "that bilinear interpolation loses, but takes more time. The hosts of --nodes ignore this option; set "
                 "the property at their lfcameranode instead")
      ->check(cli::IsMember({"bilinear", "sharpened"}));
  app.add_option("--renderer", o.renderer,
                 "Processor that renders the views. cpu: the CPU, with vector instructions. gl: a GPU, through OpenGL "
                 "ES. auto: the faster of the two on this machine. This option does not affect the hosts of --nodes")
      ->check(cli::IsMember({"cpu", "gl", "auto"}));
  app.add_option("--monitor", o.limits.monitor,
                 "Interval between camera checks, counted in requests of a viewer. Each check predicts the image of "
                 "one camera from its neighbours and compares the prediction with the real image. The page and "
                 "/metrics then report cameras that have moved or become dirty (0: no checks)")
      ->capture_default_str()
      ->check(cli::Range(0, 10000));
}

void add_limit_options(cli::App& app, Options& o) {
  app.add_option("--max-aperture", o.limits.max_aperture,
                 "Maximum diameter of the synthetic aperture that viewers may request, in metres. Large apertures use "
                 "many cameras per pixel and therefore cost more time (default: size of the array)")
      ->check(cli::PositiveNumber);
  app.add_option("--max-width", o.limits.max_width,
                 "Maximum width of the video for one viewer, in pixels. Larger requested sizes are scaled down to fit. "
                 "Reduce it to save rendering time")
      ->check(cli::Range(64, 4096));
  app.add_option("--max-height", o.limits.max_height,
                 "Maximum height of the video for one viewer, in pixels. Larger requested sizes are scaled down to fit")
      ->check(cli::Range(64, 4096));
  app.add_option("--bitrate", o.limits.bit_rate,
                 "Maximum bit rate of the video for each viewer, in bits per second. A higher rate gives better "
                 "pictures, but needs a faster network. The server lowers the rate while packets are lost")
      ->check(cli::Range(100000, 100000000));
  app.add_option("--message-rate", o.limits.messages_per_second,
                 "Maximum number of control messages per second from each viewer, such as mouse movements. The server "
                 "ignores further messages, so that no viewer can overload the server")
      ->check(cli::Range(1, 10000));
  app.add_option("--connects", o.limits.connects_per_second,
                 "Maximum average number of viewer connections per second from one address. Short bursts may be "
                 "faster. Increase it if many viewers share one address, for example behind a proxy")
      ->check(cli::Range(0.01, 1000.0));
}

}  // namespace

int main(int argc, char** argv) {
  prepare_process();
  setlinebuf(stdout);
  Options o;
  cli::App app("Serves a web page with a virtual camera for each viewer, and the same streams over WHEP.", "lf-serve");
  add_camera_options(app, o);
  add_server_options(app, o);
  add_view_options(app, o);
  add_limit_options(app, o);
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] { serve(o); });
}
