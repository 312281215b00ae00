// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Bytes into the compositor, as RTP packets, over the number of cameras (the paper's Figure 6) and through a tree of
// compositors.
//
//   bench-wire [--views N] [--plots DIR] [--json FILE]
#include <gst/gst.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench/array.h"
#include "bench/chart.h"
#include "image/image.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf {
namespace {

constexpr int kWidth = 320, kHeight = 240;

// Stills of an array, and views that it fills.
class Film {
 public:
  Film(int cameras, int views) : cameras_(cameras) {
    Rig rig = bench::make_array({cameras, kWidth, kHeight});
    for (Camera& camera : rig.cameras) {
      camera.image = std::to_string(camera.id) + ".jpg";
      save_image(render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1), dir_ / camera.image);
    }
    save_rig(rig, dir_ / "rig.json");
    std::vector<NamedView> path;
    for (int n = 0; n < views; n++)
      path.push_back({"view_" + std::to_string(n), 0, bench::make_view(kWidth, kHeight, n)});
    save_views(path, dir_ / "views.json");
  }
  std::string rig() const { return "rig=" + dir_ / "rig.json"; }
  std::string requests() const {
    return "lfviewrequest " + rig() + " location=" + dir_ / "views.json" + " ! tee name=r ";
  }
  // Returns the camera ids of the i-th of `nodes` hosts: whole rows, as in the paper (64 on 6: 4 x 8 and 2 x 16), if
  // there are enough rows.
  std::string cameras_of(int i, int nodes) const {
    const auto side = static_cast<int>(std::lround(std::sqrt(cameras_)));
    const int unit = side >= nodes ? side : 1, units = cameras_ / unit;
    return std::to_string(i * units / nodes * unit) + "-" + std::to_string((i + 1) * units / nodes * unit - 1);
  }

 private:
  int cameras_;
  TempDir dir_;
};

// Runs a pipeline to EOS. Returns the bytes of all packets of the payloaders p0, p1, ...
double packet_bytes(const std::string& line, int payloaders) {
  g_autoptr(GError) error = nullptr;
  GstElement* pipeline = gst_parse_launch(line.c_str(), &error);
  if (error) throw std::runtime_error(line + ": " + error->message);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message =
      gst_bus_timed_pop_filtered(bus, 300 * GST_SECOND, GstMessageType(GST_MESSAGE_ERROR | GST_MESSAGE_EOS));
  gst_object_unref(bus);
  const bool ended = message && GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS;
  if (message) gst_message_unref(message);
  if (!ended) throw std::runtime_error(line + ": failed");
  double bytes = 0;
  for (int i = 0; i < payloaders; i++) {
    GstElement* payloader = gst_bin_get_by_name(GST_BIN(pipeline), ("p" + std::to_string(i)).c_str());
    GstStructure* stats = nullptr;
    g_object_get(payloader, "stats", &stats, nullptr);
    guint64 value = 0;
    gst_structure_get_uint64(stats, "bytes", &value);
    bytes += static_cast<double>(value);
    gst_structure_free(stats);
    gst_object_unref(payloader);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
  return bytes;
}

// Unlimited queues: nothing is timed, and racks and root wait for one another.
const char kQueue[] = " ! queue max-size-buffers=0 max-size-bytes=0 max-size-time=0 ! ";

std::string node(const Film& film, int i, int nodes, const std::string& options) {
  const std::string n = "n" + std::to_string(i);
  return "r." + std::string(kQueue) + n + ".request lfcameranode name=" + n + " " + film.rig() +
         " cameras=" + film.cameras_of(i, nodes) + " node=" + std::to_string(i) + " " + options;
}

// Returns the bytes per view into the compositor of `nodes` hosts.
double flat(const Film& film, int views, int nodes, const std::string& options) {
  std::string line = film.requests() + "r." + kQueue + "c.request lfcompositor name=c ! fakesink ";
  for (int i = 0; i < nodes; i++)
    line += node(film, i, nodes, options) + " ! rtplfpay name=p" + std::to_string(i) + " ! rtplfdepay" + kQueue +
            "c.sink_" + std::to_string(i) + " ";
  return packet_bytes(line, nodes) / views;
}

// Returns the bytes per view into the root of a tree with `racks` compositors.
double tree(const Film& film, int views, int nodes, int racks, const std::string& codec) {
  std::string line = film.requests() + "r." + kQueue + "c.request lfcompositor name=c ! fakesink ";
  for (int rack = 0; rack < racks; rack++) {
    const std::string k = std::to_string(rack);
    line += "r." + std::string(kQueue) + "k" + k + ".request lfcompositor name=k" + k + " partial=true " + film.rig() +
            " node=" + k + " codec=" + codec + " ! rtplfpay name=p" + k + " ! rtplfdepay" + kQueue + "c.sink_" + k +
            " ";
    for (int i = rack * nodes / racks; i < (rack + 1) * nodes / racks; i++)
      line += node(film, i, nodes, "codec=" + codec) + kQueue + "k" + k + ".sink_" + std::to_string(i) + " ";
  }
  return packet_bytes(line, racks) / views;
}

int run(int views, const std::string& plots, const std::string& json_file) {
  const struct {
    const char* name;
    bool apart;  // a node for each camera
    const char* codec;
  } kManners[] = {{"a node each camera, raw", true, "codec=raw"},
                  {"six nodes, raw", false, "codec=raw"},
                  {"a node each camera, JPEG", true, "codec=jpeg"},
                  {"six nodes, JPEG", false, "codec=jpeg"}};  // two per panel
  std::vector<bench::Panel> panels;
  for (const char* title : {"uncompressed", "JPEG, quality 90"})
    panels.push_back({.title = title,
                      .x_label = "cameras",
                      .y_label = "kilobytes a view",
                      .x_tics = {4, 16, 36, 64, 144, 256},
                      .series = {{"a node each camera", true, {}}, {"six nodes", false, {}}},
                      .front = {},
                      .front_name = ""});
  nlohmann::json rows = nlohmann::json::array();
  std::printf("RTP bytes per view of %dx%d into the compositor (%d views), MTU 1400\n%8s", kWidth, kHeight, views,
              "cameras");
  for (const auto& options : kManners) std::printf(" %24s", options.name);
  std::printf("\n");
  for (const int cameras : {4, 16, 36, 64, 144, 256}) {
    const Film film(cameras, views);
    const int nodes = std::min(cameras, 6);
    std::printf("%8d", cameras);
    for (size_t m = 0; m < std::size(kManners); m++) {
      const double bytes = flat(film, views, kManners[m].apart ? cameras : nodes, kManners[m].codec);
      std::printf(" %24.0f", bytes);
      std::fflush(stdout);
      panels[m / 2].series[m % 2].points.push_back({static_cast<double>(cameras), bytes / 1000, ""});
      rows.push_back({{"cameras", cameras}, {"options", kManners[m].name}, {"bytes_per_view", bytes}});
    }
    std::printf("\n");
  }
  std::printf("\nRTP bytes per view into the root\n%8s %6s %6s %22s %22s %22s\n", "cameras", "hosts", "racks",
              "a node each camera", "a sum each host", "a sum each rack");
  const struct { int cameras, nodes, racks; } kTrees[] = {{64, 6, 2}, {256, 16, 4}};
  for (const auto& t : kTrees) {
    const Film film(t.cameras, views);
    for (const std::string codec : {"raw", "jpeg"}) {
      const double camera = flat(film, views, t.cameras, "codec=" + codec);
      const double sum = flat(film, views, t.nodes, "codec=" + codec);
      const double rack = tree(film, views, t.nodes, t.racks, codec);
      std::printf("%8d %6d %6d %22.0f %22.0f %22.0f  %s\n", t.cameras, t.nodes, t.racks, camera, sum, rack,
                  codec.c_str());
      rows.push_back({{"cameras", t.cameras},
                      {"hosts", t.nodes},
                      {"racks", t.racks},
                      {"codec", codec},
                      {"camera_bytes", camera},
                      {"sum_bytes", sum},
                      {"tree_bytes", rack}});
    }
  }
  if (!plots.empty())
    bench::draw({"Bytes into the compositor", "320x240, RTP packets of 1400 bytes", panels}, plots, "bytes-cameras");
  if (!json_file.empty()) std::ofstream(json_file) << nlohmann::json{{"rows", rows}}.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace lf

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  int views = 5;
  std::string plots, json;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (!std::strcmp(argv[i], "--views")) views = std::atoi(argv[i + 1]);
    if (!std::strcmp(argv[i], "--plots")) plots = argv[i + 1];
    if (!std::strcmp(argv[i], "--json")) json = argv[i + 1];
  }
  try {
    return lf::run(views, plots, json);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench-wire: %s\n", error.what());
    return 1;
  }
}
