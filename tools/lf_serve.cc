// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve: anybody with a browser flies through the light field.
#include <glib-unix.h>
#include <gst/gst.h>
#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/host_list.h"
#include "base/json_value.h"
#include "command_line.h"
#include "serve/encoder.h"
#include "serve/film.h"
#include "serve/http_server.h"
#include "view/views_json.h"

namespace {

using namespace lf::serve;

constexpr double kSceneFocus = 2.2;  // metres: the figure of the built-in scene

struct Options {
  std::string rig, nodes, key_file, token_file, resampling = "sharpened";
  std::vector<std::string> origins, paths;
  ServerOptions server;
  Limits limits;
};

// Making a key takes up to a second; the first viewer should not wait for it.
void make_dtls_key() {
  GstElement* decoder = gst_element_factory_make("dtlsdec", nullptr);
  if (!decoder) throw lf::Error("element dtlsdec is not installed (gstreamer1.0-plugins-bad)");
  g_autofree gchar* pem = nullptr;
  g_object_get(decoder, "pem", &pem, nullptr);
  gst_object_unref(decoder);
}

void check_elements() {
  const std::pair<const char*, const char*> needed[] = {{"lfviewrequest", "gst-lightfield: see GST_PLUGIN_PATH"},
                                                        {"webrtcbin", "gstreamer1.0-plugins-bad"},
                                                        {"nicesrc", "gstreamer1.0-nice"},
                                                        {"rtph264pay", "gstreamer1.0-plugins-good"},
                                                        {"srtpenc", "gstreamer1.0-plugins-bad"}};
  for (const auto& [element, package] : needed) {
    GstElementFactory* factory = gst_element_factory_find(element);
    if (!factory) throw lf::Error(std::string("element ") + element + " is not installed (" + package + ")");
    gst_object_unref(factory);
  }
  if (!can_encode(VideoCodec::kH264) && !can_encode(VideoCodec::kVp8))
    throw lf::Error("no encoder is installed for H.264 (gstreamer1.0-plugins-ugly) or VP8 (gstreamer1.0-plugins-good)");
}

// "NAME=FILE".
std::pair<std::string, std::string> parse_path(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == text.npos || equals == 0) throw lf::Error("--path " + text + ": must be NAME=FILE");
  const std::string file = text.substr(equals + 1);
  const lf::View& view = lf::load_views(file).front().view;
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

// A viewer takes about ten files, a camera two: the usual 1024 are soon used up.
void raise_file_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 65536);
  setrlimit(RLIMIT_NOFILE, &limit);
}

gboolean quit(gpointer loop) {
  g_main_loop_quit(static_cast<GMainLoop*>(loop));
  return G_SOURCE_CONTINUE;
}

void serve(Options& options) {
  if (!options.nodes.empty() && options.rig.empty())
    throw lf::Error("--nodes: needs --rig, which says where cameras are");
  check_elements();
  make_dtls_key();
  const std::vector<lf::NodeAddress> nodes = nodes_of(options.nodes);
  if (options.rig.empty()) {
    options.rig = film_of_scene();
    if (options.limits.focus == 0) options.limits.focus = kSceneFocus;
  }
  if (!options.token_file.empty()) {
    std::string text = lf::read_text_file(options.token_file);
    while (!text.empty() && g_ascii_isspace(text.back())) text.pop_back();
    if (text.empty()) throw lf::Error(options.token_file + ": has no token");
    options.server.token = text;
  }
  for (const std::string& path : options.paths) options.server.paths.insert(parse_path(path));
  options.server.origins.insert(options.origins.begin(), options.origins.end());

  GMainLoop* loop = g_main_loop_new(nullptr, FALSE);
  const guint signals[] = {g_unix_signal_add(SIGINT, quit, loop), g_unix_signal_add(SIGTERM, quit, loop)};
  std::string failure;
  {
    LightField field(options.rig, nodes, options.key_file, options.resampling, options.limits.viewers);
    field.start([&](const std::string& what) {
      failure = what;
      g_main_loop_quit(loop);
    });
    // Reached at the address that it listens at alone, or at all of the machine's.
    const std::string& address = options.server.address;
    const bool any = address == "0.0.0.0" || address == "::";
    Sessions sessions(field, options.limits, any ? "" : address == "localhost" ? "127.0.0.1" : address);
    HttpServer server(options.server, options.limits, field, sessions);
    std::printf("serving %s at %s\n", options.rig.c_str(), server.url().c_str());
    g_main_loop_run(loop);
    sessions.close_all("the server ends");  // while there is a server to tell it
  }
  for (const guint source : signals) g_source_remove(source);
  g_main_loop_unref(loop);
  if (!failure.empty()) throw lf::Error(failure);
}

}  // namespace

int main(int argc, char** argv) {
  // Viewers come and go with all their threads: with an arena each, memory would be torn to pieces.
  mallopt(M_ARENA_MAX, 2);
  setlinebuf(stdout);
  raise_file_limit();
  Options o;
  cli::App app("Serves a page in which everybody flies their own virtual camera, and the same streams over WHEP.",
               "lf-serve");
  app.add_option("--rig", o.rig, "the cameras; without it the built-in scene, filmed once")->type_name("RIG.json");
  app.add_option("--nodes", o.nodes,
                 "hosts that the cameras are on: HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE,... (camera-node.sh)");
  app.add_option("--key-file", o.key_file, "of --nodes: the secret that they share, 32 or more random characters");
  app.add_option("--listen", o.server.address, "IP address; other than loopback with TLS or --insecure alone")
      ->capture_default_str();
  app.add_option("--port", o.server.port, "0: any")->capture_default_str()->check(cli::Range(0, 65535));
  app.add_option("--tls-certificate", o.server.certificate)->type_name("FILE.pem");
  app.add_option("--tls-key", o.server.key)->type_name("FILE.pem");
  app.add_flag("--insecure", o.server.insecure, "others may listen in");
  app.add_option("--token-file", o.token_file, "viewers need the bearer token in this file")->type_name("FILE");
  app.add_option("--origin", o.origins,
                 "of other sites' pages that may watch: https://example.org, null (files), or *; repeat");
  app.add_option("--path", o.paths, "a views.json that links may have flown (#path=NAME), NAME=FILE; repeat")
      ->type_name("NAME=FILE");
  app.add_option("--viewers", o.limits.viewers, "at a time; one with two eyes counts twice")->capture_default_str()->check(cli::Range(1, 1000));
  app.add_option("--framerate", o.limits.framerate, "pictures per second")
      ->capture_default_str()
      ->check(cli::Range(1, 120));
  app.add_option("--capture-delay", o.limits.capture_delay_ms,
                 "how old a capture must be before it is asked for: what the cameras take, milliseconds")
      ->capture_default_str()
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
  app.add_option("--gains", o.limits.focus_on.gains, "true: cameras match their brightness to the others'")
      ->check(cli::IsMember({"true", "false"}));
  app.add_option("--resampling", o.resampling, "how cameras' images are sampled (of --nodes: see lfcameranode)")
      ->capture_default_str()
      ->check(cli::IsMember({"bilinear", "sharpened", "catmull-rom"}));
  app.add_option("--monitor", o.limits.monitor,
                 "beside one of so many requests of a viewer a camera is left out and predicted from the others, each in "
                 "turn: the page and /metrics tell which ones have something wrong (0: never)")
      ->capture_default_str()
      ->check(cli::Range(0, 10000));
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
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] { serve(o); });
}
