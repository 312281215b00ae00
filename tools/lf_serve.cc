// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve: anybody with a browser flies through the light field.
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
#include "command_line.h"
#include "serve/access.h"
#include "serve/http_server.h"
#include "serve/pipelines.h"
#include "serve/process.h"
#include "serve/rig_reload.h"
#include "view/view_path.h"

namespace {

namespace fs = std::filesystem;
using namespace lf::serve;

constexpr double kSceneFocus = 2.2;  // metres: the figure of the built-in scene

struct Options {
  std::string rig, nodes, key_file, record, token_file, ice_credentials, media, resampling = "sharpened",
                                                                                renderer = "cpu";
  std::vector<std::string> origins, paths, hosts, proxies, ice_servers;
  std::vector<lf::NodeAddress> node_addresses;
  ServerOptions server;
  Limits limits;
  bool watch = false;         // the rig file
  bool trusted = false;       // the rig file may run any element
  int capture_delay_ms = -1;  // less than 0: by the kind of cameras
};

// "NAME=FILE".
std::pair<std::string, std::string> parse_path(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == text.npos || equals == 0) throw lf::Error("--path " + text + ": must be NAME=FILE");
  const std::string file = text.substr(equals + 1);
  const lf::View view = lf::load_views(file).front().view;
  if (view.width % 2 || view.height % 2) throw lf::Error(file + ": video needs views of even width and height");
  return {text.substr(0, equals), file};
}

std::vector<lf::NodeAddress> nodes_of(const std::string& text) {
  try {
    return lf::parse_nodes(text);
  } catch (const lf::Error& error) {
    throw lf::Error(std::string("--nodes ") + error.what());
  }
}

gboolean quit(gpointer loop) {
  g_main_loop_quit(static_cast<GMainLoop*>(loop));
  return G_SOURCE_CONTINUE;
}

// The address of this machine that video comes from; "" for all of them.
std::string media_address(const std::string& text) {
  if (text == "any" || text == "0.0.0.0" || text == "::") return "";
  if (text == "localhost") return "127.0.0.1";
  const std::string address = plain_address(text);
  if (address.empty() || !is_local_address(address))
    throw lf::Error("--media " + text + ": must be an IP address of this machine, or any");
  return address;
}

std::string token_in(const std::string& path) {
  std::string token = lf::read_secret_file(path);
  while (!token.empty() && g_ascii_isspace(token.back())) token.pop_back();
  if (token.empty()) throw lf::Error(path + ": has no token");
  // Clients send it in a header.
  if (!std::ranges::all_of(token, [](char c) { return c >= ' ' && c <= '~'; }))
    throw lf::Error(path + ": a token is one line of printable ASCII: openssl rand -hex 16 >FILE");
  constexpr size_t kShort = 16;
  if (token.size() < kShort)
    std::fprintf(stderr, "warning: %s: a token of %zu characters can be guessed: openssl rand -hex 16 >FILE\n",
                 path.c_str(), token.size());
  return token;
}

void check_options(Options& options) {
  if (!options.nodes.empty() && options.rig.empty())
    throw lf::Error("--nodes: needs --rig, which says where cameras are");
  if (!options.record.empty() && !options.nodes.empty())
    throw lf::Error("--record: the hosts of --nodes record their own cameras (lfnodesink record=FOLDER)");
  if (!options.record.empty() && options.watch)
    throw lf::Error("--record: not with --watch, which may bring other cameras; a recording is of the same ones");
  if (options.watch && options.rig.empty()) throw lf::Error("--watch: needs --rig, the file to watch");
  if (!options.key_file.empty() && options.nodes.empty())
    throw lf::Error("--key-file: needs --nodes, the hosts that have the same");
  const FocusOn& focus = options.limits.focus_on;
  if (focus.far > 0 && focus.near >= focus.far) throw lf::Error("--focus-near: must be nearer than --focus-far");
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

// A film of the built-in scene that loops, made by lf-scene where it is not there yet, beside the main loop. On the
// main thread alone.
class Film {
 public:
  // The rig file, and whether it is there already.
  static std::string rig();
  static bool exists();

  // Begins. `on_end` is called once, with what went wrong or "". Throws Error.
  explicit Film(std::function<void(const std::string& problem)> on_end);
  ~Film();
  Film(const Film&) = delete;

  // How much is done, 0 to 1.
  double progress() const;

 private:
  void read_line();
  void take_line(const std::string& line);

  std::function<void(const std::string&)> on_end_;
  GSubprocess* process_ = nullptr;
  GDataInputStream* says_ = nullptr;
  GCancellable* cancellable_;
  int64_t began_;
  double told_ = 0;  // share of the film, 0 to 1, when it was last told
  int64_t told_at_ = 0;
  std::string last_line_;
};

fs::path folder() { return fs::path(g_get_user_cache_dir()) / "gst-lightfield" / "scene-" LF_VERSION; }

std::string Film::rig() { return folder() / "rig.json"; }

bool Film::exists() { return fs::exists(rig()); }  // written last

Film::Film(std::function<void(const std::string&)> on_end)
    : on_end_(std::move(on_end)), cancellable_(g_cancellable_new()), began_(g_get_monotonic_time()) {
  std::error_code none;
  const fs::path beside = fs::read_symlink("/proc/self/exe", none).parent_path() / "lf-scene";
  const std::string program = fs::exists(beside, none) ? beside.string() : "lf-scene", out = folder();
  const char* const arguments[] = {program.c_str(), "--out",    out.c_str(), "--grid",   "8x8", "--width",
                                   "320",           "--height", "240",       "--frames", "60",  nullptr};
  GError* error = nullptr;
  process_ = g_subprocess_newv(arguments, G_SUBPROCESS_FLAGS_STDERR_PIPE, &error);
  if (!process_) {
    const std::string text = std::string("lf-scene: ") + error->message;
    g_error_free(error);
    g_object_unref(cancellable_);
    throw lf::Error(text);
  }
  says_ = g_data_input_stream_new(g_subprocess_get_stderr_pipe(process_));
  read_line();
}

Film::~Film() {
  g_cancellable_cancel(cancellable_);
  g_subprocess_force_exit(process_);
  g_object_unref(says_);
  g_object_unref(process_);
  g_object_unref(cancellable_);
}

void Film::read_line() {
  g_data_input_stream_read_line_async(
      says_, G_PRIORITY_DEFAULT, cancellable_,
      [](GObject* stream, GAsyncResult* result, gpointer data) {
        GError* error = nullptr;
        g_autofree gchar* line =
            g_data_input_stream_read_line_finish(G_DATA_INPUT_STREAM(stream), result, nullptr, &error);
        const bool cancelled = g_error_matches(error, G_IO_ERROR, G_IO_ERROR_CANCELLED);
        g_clear_error(&error);
        if (cancelled) return;  // `data` is gone
        Film* self = static_cast<Film*>(data);
        if (line) return self->take_line(line);
        g_subprocess_wait(self->process_, nullptr, nullptr);  // it has closed its standard error: it ends
        const bool made =
            g_subprocess_get_if_exited(self->process_) && g_subprocess_get_exit_status(self->process_) == 0;
        self->on_end_(made ? "" : "lf-scene: " + (self->last_line_.empty() ? "was ended" : self->last_line_));
      },
      this);
}

// "filming: 40 %".
void Film::take_line(const std::string& line) {
  int percent = 0;
  if (std::sscanf(line.c_str(), "filming: %d %%", &percent) == 1) {
    told_ = std::clamp(percent, 0, 100) * 0.01;
    told_at_ = g_get_monotonic_time();
  } else {
    last_line_ = line;
  }
  read_line();
}

// It is told every ten seconds, and goes on as fast between.
double Film::progress() const {
  if (told_at_ <= began_) return 0;
  const double speed = told_ / static_cast<double>(told_at_ - began_);
  constexpr double kNearlyDone = 0.99;
  return std::clamp(speed * static_cast<double>(g_get_monotonic_time() - began_), told_, kNearlyDone);
}

// The page from the beginning; the light field when it has been filmed, where it must be, and its cameras run.
class Program {
 public:
  explicit Program(const Options& options)
      : options_(options), loop_(g_main_loop_new(nullptr, FALSE)), server_(options.server, options.limits) {}
  ~Program() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
      if (field_) field_->cancel();
    }
    watch_.reset();
    if (opens_.joinable()) opens_.join();
    if (sessions_) sessions_->close_all("the server ends");  // while there is a server to tell it
    server_.stop();
    sessions_.reset();
    if (timer_) g_source_remove(timer_);
    g_main_loop_unref(loop_);
  }

  // Until a signal comes. Throws Error.
  void run() {
    const guint signals[] = {g_unix_signal_add(SIGINT, quit, loop_), g_unix_signal_add(SIGTERM, quit, loop_)};
    if (options_.rig.empty())
      film();
    else
      open();
    g_main_loop_run(loop_);
    for (const guint source : signals) g_source_remove(source);
    if (!failure_.empty()) throw lf::Error(failure_);
  }

 private:
  void fail(const std::string& why) {
    failure_ = why;
    g_main_loop_quit(loop_);
  }

  void film() {
    options_.rig = Film::rig();
    if (options_.limits.focus == 0) options_.limits.focus = kSceneFocus;
    if (Film::exists()) return open();
    std::printf("filming the built-in scene (once, kept as %s); the page waits at %s\n", options_.rig.c_str(),
                server_.url().c_str());
    server_.films(0);
    film_ = std::make_unique<Film>([this](const std::string& problem) {
      if (!problem.empty()) return fail(problem);
      server_.starts();
      open();
    });
    constexpr guint kEvery = 500;  // milliseconds
    timer_ = g_timeout_add(
        kEvery,
        [](gpointer data) -> gboolean {
          Program* self = static_cast<Program*>(data);
          if (!self->sessions_ && !self->opens_.joinable()) self->server_.films(self->film_->progress());
          return G_SOURCE_CONTINUE;
        },
        this);
  }

  // In a thread, because cameras may take a minute.
  void open() {
    opens_ = std::thread([this] {
      std::string problem;
      try {
        auto field =
            std::make_unique<LightField>(options_.rig, options_.node_addresses, options_.key_file, options_.resampling,
                                         options_.renderer, options_.record, options_.limits.viewers, options_.trusted);
        {
          const std::lock_guard lock(mutex_);
          field_ = std::move(field);
          if (ends_) field_->cancel();
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

  // Packets of network cameras are waited for and put in order, see `latency` of lfcamsrc.
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
    if (options_.watch) watch_ = std::make_unique<RigReload>(*field_, *sessions_);
    std::printf("serving %s at %s\n", options_.rig.c_str(), server_.url().c_str());
  }

  Options options_;
  GMainLoop* loop_;
  HttpServer server_;
  std::unique_ptr<Film> film_;
  std::thread opens_;
  std::mutex mutex_;
  bool ends_ = false;                  // under the mutex
  std::unique_ptr<LightField> field_;  // set by `opens_` under the mutex, and not changed after that
  std::unique_ptr<Sessions> sessions_;
  std::unique_ptr<RigReload> watch_;
  guint timer_ = 0;
  std::string failure_;
};

void serve(Options& options) {
  check_options(options);
  options.node_addresses = nodes_of(options.nodes);
  prepare_elements();
  Program(options).run();
}

void add_camera_options(cli::App& app, Options& o) {
  app.add_option("--rig", o.rig, "the cameras; without it the built-in scene, filmed once")->type_name("RIG.json");
  app.add_flag("--watch", o.watch,
               "read the rig file again whenever it changes, after a calibration say: viewers go on with the new one");
  cli::add_trust_option(app, o.trusted);
  app.add_option("--nodes", o.nodes,
                 "hosts that the cameras are on: HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE,... (lfnodesink)");
  app.add_option("--key-file", o.key_file, "of --nodes: the secret that they share, 32 or more random characters");
  app.add_option("--record", o.record,
                 "the cameras are recorded into this folder, with a rig.json to serve them by later")
      ->type_name("FOLDER");
}

void add_server_options(cli::App& app, Options& o) {
  app.add_option("--listen", o.server.address, "IP address; other than loopback with TLS or --insecure alone")
      ->capture_default_str();
  app.add_option("--port", o.server.port, "0: any")->capture_default_str()->check(cli::Range(0, 65535));
  app.add_option("--tls-certificate", o.server.certificate)->type_name("FILE.pem");
  app.add_option("--tls-key", o.server.key)->type_name("FILE.pem");
  app.add_flag("--insecure", o.server.insecure, "others may listen in");
  app.add_option("--token-file", o.token_file, "viewers need the bearer token in this file")->type_name("FILE");
  app.add_option("--origin", o.origins,
                 "of other sites' pages that may watch: https://example.org, null (files), or *; repeat");
  app.add_option("--host", o.hosts, "name that browsers reach this server by, beside its own and its addresses; repeat")
      ->type_name("NAME");
  app.add_option("--proxy", o.proxies,
                 "address of a reverse proxy, whose X-Forwarded-For and X-Forwarded-Prefix are believed; repeat")
      ->type_name("ADDRESS");
  app.add_option("--media", o.media, "address of this machine that video comes from, or any (default: as --listen)")
      ->type_name("ADDRESS");
  app.add_option(
         "--ice-server", o.ice_servers,
         "STUN or TURN server, for viewers and for this one: stun:HOST:PORT, turn:HOST:PORT?transport=udp; repeat")
      ->type_name("URI");
  app.add_option("--ice-credentials", o.ice_credentials,
                 "for TURN: has USER PASSWORD, or the secret that is shared with the TURN server (use-auth-secret)")
      ->type_name("FILE");
  app.add_option("--path", o.paths, "a views.json that links may have flown (#path=NAME), NAME=FILE; repeat")
      ->type_name("NAME=FILE");
}

void add_view_options(cli::App& app, Options& o) {
  app.add_option("--viewers", o.limits.viewers, "at a time; one with two eyes counts twice")
      ->capture_default_str()
      ->check(cli::Range(1, 1000));
  app.add_option("--address-views", o.limits.address_views, "of one address at a time")
      ->capture_default_str()
      ->check(cli::Range(1, 1000));
  app.add_option("--framerate", o.limits.framerate, "pictures per second")
      ->capture_default_str()
      ->check(cli::Range(1, 120));
  app.add_option(
         "--capture-delay", o.capture_delay_ms,
         "how old a capture must be before it is asked for: what the cameras take, milliseconds (default: 100, or "
         "300 where some are behind RTSP)")
      ->check(cli::Range(0, 10000));
  app.add_option("--focus", o.limits.focus,
                 "distance of the viewer's plane to begin with, metres (default: 4 times the array)")
      ->check(cli::PositiveNumber);
  app.add_option(
         "--focus-on", o.limits.focus_on.mode,
         "the viewer's plane; or a surface, so that all of the picture is in focus; auto: as the scene needs it")
      ->capture_default_str()
      ->check(cli::IsMember({"plane", "surface", "auto"}));
  app.add_option("--focus-near", o.limits.focus_on.near,
                 "nearest that the surface can be, metres from the array (default: as the scene asks)")
      ->check(cli::PositiveNumber);
  app.add_option("--focus-far", o.limits.focus_on.far, "farthest")->check(cli::PositiveNumber);
  app.add_option("--gains", o.limits.focus_on.gains,
                 "whether cameras match their brightness (default: until the rig has their colours)")
      ->check(cli::IsMember({"on", "off", "auto"}));
  app.add_option("--resampling", o.resampling, "how cameras' images are sampled (of --nodes: see lfcameranode)")
      ->capture_default_str()
      ->check(cli::IsMember({"bilinear", "sharpened"}));
  app.add_option("--renderer", o.renderer, "what draws views: gl: OpenGL ES; auto: the faster one (of --nodes: theirs)")
      ->capture_default_str()
      ->check(cli::IsMember({"cpu", "gl", "auto"}));
  app.add_option(
         "--monitor", o.limits.monitor,
         "beside one of so many requests of a viewer a camera is left out and predicted from the others, each in "
         "turn: the page and /metrics tell which ones have something wrong (0: never)")
      ->capture_default_str()
      ->check(cli::Range(0, 10000));
  app.add_option("--max-aperture", o.limits.max_aperture, "of a view, metres (default: the array's size)")
      ->check(cli::PositiveNumber);
  app.add_option("--max-width", o.limits.max_width, "of a view")->capture_default_str()->check(cli::Range(64, 4096));
  app.add_option("--max-height", o.limits.max_height, "of a view")->capture_default_str()->check(cli::Range(64, 4096));
  app.add_option("--bitrate", o.limits.bit_rate, "of a viewer's video at best, bits per second")
      ->capture_default_str()
      ->check(cli::Range(100000, 100000000));
  app.add_option("--messages", o.limits.messages_per_second, "of a viewer, per second")
      ->capture_default_str()
      ->check(cli::Range(1, 10000));
  app.add_option("--connects", o.limits.connects_per_second, "of an address, per second, in the long run")
      ->capture_default_str()
      ->check(cli::Range(0.01, 1000.0));
}

}  // namespace

int main(int argc, char** argv) {
  prepare_process();
  setlinebuf(stdout);
  Options o;
  cli::App app("Serves a page in which everybody flies their own virtual camera, and the same streams over WHEP.",
               "lf-serve");
  add_camera_options(app, o);
  add_server_options(app, o);
  add_view_options(app, o);
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] { serve(o); });
}
