// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Whole pipelines in one process with 64 cameras: maximum pictures per second, a live view of JPEG cameras, the latency
// of single requests, and the cost of recording.
//
//   bench-pipeline [--seconds N] [--json FILE] [throughput] [live] [latency] [overhead] [recording]
#include <gst/gst.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bench/array.h"
#include "image/image.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf {
namespace {

constexpr int kCameras = 64;
// Maximum number of pixels to render, because 1080p for all cameras takes minutes. Larger arrays share images between
// neighbours.
constexpr int kMaxFilmed = 12'000'000;

struct Row {
  std::string name;
  int width, height;
  double seconds;
  std::map<std::string, double> figures;
};

// A rig of `kCameras` in a temporary folder with its files and a few views. `jpeg`: looping sequences of JPEG files;
// otherwise stills, which lfcamsrc decodes once and repeats, as I420.
class Film {
 public:
  Film(int width, int height, bool jpeg) {
    Rig rig = bench::make_array({kCameras, width, height});
    const int filmed = std::clamp(kMaxFilmed / (width * height), 1, kCameras);
    for (int i = 0; i < kCameras; i++) {
      const int shared = i * filmed / kCameras;
      const bool first = i == 0 || (i - 1) * filmed / kCameras != shared;
      const std::string name = "cam_" + std::to_string(shared) + "_";
      Camera& camera = rig.cameras[i];
      if (first) {
        const Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1);
        for (const int k : {0, 1}) save_image(image, dir_ / (name + std::to_string(k) + ".jpg"));
      }
      (jpeg ? camera.source : camera.image) = name + (jpeg ? "%d.jpg" : "0.jpg");
    }
    save_rig(rig, dir_ / "rig.json");
    std::vector<NamedView> views;
    for (int n = 0; n < 3; n++) views.push_back({"view_" + std::to_string(n), 0, bench::make_view(width, height, n)});
    save_views(views, dir_ / "views.json");
  }
  std::string folder(const std::string& name) const { return dir_ / name; }
  std::string requests(const std::string& more) const {
    return "lfviewrequest rig=" + dir_ / "rig.json" + " location=" + dir_ / "views.json" + " loop=true " + more;
  }
  std::string node(const std::string& more) const {
    // The requested times are far from the times of live cameras, so any frame is accepted.
    return "lfcameranode name=n resampling=bilinear rig=" + dir_ / "rig.json" +
           " is-live=true loop=true framerate=30/1 max-skew=0 " + more;
  }

 private:
  TempDir dir_;
};

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

double number(const GstStructure* stats, const char* field) {
  guint64 value = 0;
  gst_structure_get_uint64(stats, field, &value);
  return static_cast<double>(value);
}

using Stats = std::unique_ptr<GstStructure, decltype(&gst_structure_free)>;
Stats stats_of(GstElement* pipeline, const char* name) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  GstStructure* stats = nullptr;
  g_object_get(element, "stats", &stats, nullptr);
  gst_object_unref(element);
  return {stats, gst_structure_free};
}

double sum(const GstStructure* stats, const char* field) {
  const GValue* cameras = gst_structure_get_value(stats, "cameras");
  double all = 0;
  for (int i = 0; cameras && i < gst_structure_n_fields(gst_value_get_structure(cameras)); i++) {
    const GstStructure* every = gst_value_get_structure(cameras);
    all +=
        number(gst_value_get_structure(gst_structure_get_value(every, gst_structure_nth_field_name(every, i))), field);
  }
  return all;
}

void wait(GstElement* pipeline, double seconds) {
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message = gst_bus_timed_pop_filtered(bus, static_cast<GstClockTime>(seconds * GST_SECOND),
                                                   GstMessageType(GST_MESSAGE_ERROR | GST_MESSAGE_EOS));
  gst_object_unref(bus);
  if (!message) return;
  std::string text = "the pipeline ended";
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) {
    g_autoptr(GError) error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    text = error->message;
  }
  gst_message_unref(message);
  throw std::runtime_error(text);
}

std::map<std::string, double> play(const std::string& line, double seconds) {
  g_autoptr(GError) error = nullptr;
  GstElement* pipeline = gst_parse_launch(line.c_str(), &error);
  if (error) throw std::runtime_error(line + ": " + error->message);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  wait(pipeline, 2);  // until every camera has started
  const Stats before = stats_of(pipeline, "c");
  const double processor = processor_seconds();
  const gint64 begin = g_get_monotonic_time();
  wait(pipeline, seconds);
  const double took = static_cast<double>(g_get_monotonic_time() - begin) * 1e-6;
  const double used = processor_seconds() - processor;
  const Stats after = stats_of(pipeline, "c"), node = stats_of(pipeline, "n");
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);

  const auto grown = [&](const char* field) { return number(after.get(), field) - number(before.get(), field); };
  std::map<std::string, double> figures;
  figures["fps"] = grown("pictures") / took;
  figures["pictures"] = grown("pictures");
  figures["incomplete"] = grown("incomplete");
  figures["bytes_per_view"] = grown("bytes") / std::max(grown("pictures"), 1.0);
  figures["processors"] = used / took;
  figures["damaged_frames"] = number(node.get(), "damaged-frames");
  figures["missing_frames"] = number(node.get(), "missing-frames");
  for (const char* field : {"recorded", "unrecorded"}) figures[field] = sum(node.get(), field);
  for (const char* stage : {"answer", "add", "picture", "latency"})
    for (const char* p : {"p50", "p95", "p99"})
      figures[std::string(stage) + "_ms_" + p] = number(after.get(), (std::string(stage) + "-ns-" + p).c_str()) * 1e-6;
  for (const char* stage : {"wait", "decode", "render", "encode"})
    for (const char* p : {"p50", "p95", "p99"})
      figures["node_" + std::string(stage) + "_ms_" + p] =
          number(node.get(), (std::string(stage) + "-ns-" + p).c_str()) * 1e-6;
  return figures;
}

std::string pipeline(const std::string& requests, const std::string& node, const std::string& sink) {
  return requests + " ! tee name=r  r. ! queue ! n.request  " + node +
         " ! queue ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! queue max-size-buffers=4 ! " + sink;
}

class Bench {
 public:
  explicit Bench(double seconds) : seconds_(seconds) {}

  void throughput() {
    const int sizes[][2] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};
    for (const auto& [width, height] : sizes) {
      const Film film(width, height, false);
      for (const std::string codec : {"jpeg", "auto"})
        add("throughput codec=" + codec, width, height,
            pipeline(film.requests("framerate=15/1"), film.node("codec=" + codec), "fakesink"), seconds_);
    }
  }
  // Goal: 30 frames/s for a minute without drops.
  void live() {
    const Film film(640, 480, true);
    add("live JPEG cameras", 640, 480,
        pipeline(film.requests("is-live=true framerate=30/1"), film.node(""), "fakesink sync=true"), 6 * seconds_);
  }
  // One request in flight while an answer takes less than 50 ms. Goal: 6 / 12 ms.
  void latency() {
    const Film film(320, 240, false);
    for (const std::string codec : {"auto", "jpeg"})
      add("latency codec=" + codec, 320, 240,
          pipeline(film.requests("is-live=true framerate=20/1"), film.node("codec=" + codec), "fakesink"), seconds_);
  }
  // GStreamer's overhead: CPU time of a picture relative to the sum of its stages. Goal: 1.3.
  void overhead() {
    const int sizes[][2] = {{320, 240}, {640, 480}, {1280, 720}};
    for (const auto& [width, height] : sizes) {
      const Film film(width, height, false);
      for (const std::string codec : {"jpeg", "auto"}) {
        add("1 thread codec=" + codec, width, height,
            pipeline(film.requests("framerate=15/1"), film.node("threads=1 codec=" + codec), "fakesink"), seconds_);
        auto& f = rows_.back().figures;
        double stages = 0;
        for (const char* stage :
             {"node_decode_ms_p50", "node_render_ms_p50", "node_encode_ms_p50", "add_ms_p50", "picture_ms_p50"})
          stages += f[stage];
        const double picture = 1000 * f["processors"] / f["fps"];
        f["ratio_to_stages"] = picture / stages;
        std::printf("  %.2f ms of processor a picture, %.2f ms in its stages: %.2f\n", picture, stages,
                    picture / stages);
      }
    }
  }
  // Interleaved runs, because of other load on the machine. Goal: no missing frame, 1.3 times the latency.
  void recording() {
    const Film film(320, 240, true);
    double without = 0, with = 0;
    constexpr int kTurns = 3;
    for (int turn = 0; turn < kTurns; turn++) {
      for (const bool record : {false, true}) {
        const std::string folder = film.folder("recording" + std::to_string(turn));
        add(record ? "recorded" : "not recorded", 320, 240,
            pipeline(film.requests("is-live=true framerate=30/1"), film.node(record ? "record=" + folder : ""),
                     "fakesink sync=true"),
            seconds_);
        auto& f = rows_.back().figures;
        (record ? with : without) += f["latency_ms_p95"] / kTurns;
        if (record) std::printf("  %.0f frames recorded, %.0f left out\n", f["recorded"], f["unrecorded"]);
      }
    }
    std::printf("  latency p95 %.2f ms, %.2f ms while it records: %.2f\n", without, with, with / without);
  }
  void save(const std::string& path) const {
    std::ofstream out(path);
    out << "{\"rows\": [";
    for (size_t i = 0; i < rows_.size(); i++) {
      out << (i ? ",\n" : "\n") << "{\"name\": \"" << rows_[i].name << "\", \"width\": " << rows_[i].width
          << ", \"height\": " << rows_[i].height << ", \"cameras\": " << kCameras
          << ", \"seconds\": " << rows_[i].seconds;
      for (const auto& [key, value] : rows_[i].figures) out << ", \"" << key << "\": " << value;
      out << "}";
    }
    out << "\n]}\n";
  }

 private:
  void add(const std::string& name, int width, int height, const std::string& line, double seconds) {
    if (rows_.empty())
      std::printf("%-22s %9s %7s %6s %9s  %-16s %-27s %-17s %5s %s\n", "pipeline", "view", "fps", "incom.", "kB/view",
                  "latency 50/95", "node wait/dec/render/enc", "add/picture", "CPUs", "load");
    rows_.push_back({name, width, height, seconds, play(line, seconds)});
    auto& f = rows_.back().figures;
    double load = 0;
    getloadavg(&load, 1);
    f["load"] = load;
    std::printf(
        "%-22s %4dx%-4d %7.1f %6.0f %9.1f  %6.2f / %-6.2f  %5.2f/%5.2f/%6.2f/%6.2f  %6.2f/%6.2f     %5.2f %.1f\n",
        name.c_str(), width, height, f["fps"], f["incomplete"], f["bytes_per_view"] / 1000, f["latency_ms_p50"],
        f["latency_ms_p95"], f["node_wait_ms_p50"], f["node_decode_ms_p50"], f["node_render_ms_p50"],
        f["node_encode_ms_p50"], f["add_ms_p50"], f["picture_ms_p50"], f["processors"], load);
    std::fflush(stdout);
  }

  double seconds_;
  std::vector<Row> rows_;
};

}  // namespace
}  // namespace lf

int main(int argc, char** argv) try {
  g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, TRUE);
  gst_init(nullptr, nullptr);
  double seconds = 10;
  std::string json;
  std::vector<std::string> parts;
  for (int i = 1; i < argc; i++) {
    if (!std::strcmp(argv[i], "--seconds") && i + 1 < argc)
      seconds = std::stod(argv[++i]);
    else if (!std::strcmp(argv[i], "--json") && i + 1 < argc)
      json = argv[++i];
    else
      parts.push_back(argv[i]);
  }
  if (parts.empty()) parts = {"throughput", "live", "latency", "overhead", "recording"};
  lf::Bench bench(seconds);
  for (const std::string& part : parts) {
    if (part == "throughput")
      bench.throughput();
    else if (part == "live")
      bench.live();
    else if (part == "latency")
      bench.latency();
    else if (part == "overhead")
      bench.overhead();
    else if (part == "recording")
      bench.recording();
    else
      throw std::runtime_error("there is no part \"" + part + "\": throughput, live, latency, overhead, recording");
  }
  if (!json.empty()) bench.save(json);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "bench-pipeline: %s\n", error.what());
  return 1;
}
