// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Breaks down the round trip of a view (the paper's Figure 5): a viewer on a separate host requests a view, waits for
// its picture and requests the next. 64 cameras of 320x240 on six hosts; each host is a network namespace.
//
//   bench-roundtrip [--views N] [--plots DIR] [--json FILE]
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <regex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "network/array_network.h"
#include "view/view_path.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

constexpr double kTimeout = 1;  // seconds; later, the request or its picture counts as lost

std::atomic<double> picture_came = 0;  // before it is decoded

GstPadProbeReturn note_picture(GstPad*, GstPadProbeInfo*, gpointer) {
  picture_came = now_seconds();
  return GST_PAD_PROBE_OK;
}

// The viewer's host: prints "loop SEQUENCE TOTAL DISPLAY", in milliseconds, for each picture.
int view(const std::string& compositor, const std::string& path, int count) {
  const std::string line =
      "appsrc name=s format=time is-live=true do-timestamp=true caps=application/x-lightfield-request,framerate=0/1 ! "
      "rtplfpay ! udpsink sync=false async=false host=" +
      compositor + " port=" + std::to_string(ArrayNetwork::kViewerPort) +
      " udpsrc port=" + std::to_string(ArrayNetwork::kVideoPort) +
      " caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26 ! rtpjpegdepay ! "
      "jpegdec name=d ! appsink name=k sync=false max-buffers=4 drop=true";
  g_autoptr(GError) error = nullptr;
  GstElement* pipeline = gst_parse_launch(line.c_str(), &error);
  if (error) throw std::runtime_error(error->message);
  GstElement* source = gst_bin_get_by_name(GST_BIN(pipeline), "s");
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "k");
  GstElement* decoder = gst_bin_get_by_name(GST_BIN(pipeline), "d");
  GstPad* pad = gst_element_get_static_pad(decoder, "sink");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, note_picture, nullptr, nullptr);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  const std::vector<NamedView> views = load_views(path);
  for (int i = 0; i < count; i++) {
    ViewRequest request;
    request.sequence = static_cast<uint32_t>(i);
    request.view = views[static_cast<size_t>(i) % views.size()].view;
    request.quality = 90;
    request.absolute_time = true;
    const double begun = now_seconds();
    request.target_time = static_cast<uint64_t>((begun - 0.1) * 1e9);
    const std::vector<uint8_t> bytes = wire::encode_request(request);
    gst_app_src_push_buffer(GST_APP_SRC(source), gst_buffer_new_memdup(bytes.data(), bytes.size()));
    GstSample* sample =
        gst_app_sink_try_pull_sample(GST_APP_SINK(sink), static_cast<GstClockTime>(kTimeout * GST_SECOND));
    const double end = now_seconds();
    if (sample) {
      std::printf("loop %d %.3f %.3f\n", i, 1e3 * (end - begun), 1e3 * (end - picture_came));
      gst_sample_unref(sample);
    } else {
      std::printf("lost %d\n", i);
    }
    std::fflush(stdout);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return 0;
}

constexpr std::array kStages = {"wait for frame",  "warp",      "compress", "network, node and back",
                                "decompress, add", "composite", "display",  "viewer's link"};
using Trip = std::array<double, kStages.size()>;  // milliseconds

double field(const std::string& text, const std::string& name) {
  std::smatch match;
  return std::regex_search(text, match, std::regex(name + "=\\((?:uint|guint64)\\)(\\d+)")) ? std::stod(match[1]) : 0;
}

double at(std::vector<double> values, int percent) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, values.size() * static_cast<size_t>(percent) / 100)];
}

// Combines the hosts' outputs per request; of the nodes, the slowest counts.
std::vector<std::pair<Trip, double>> trips_of(ArrayNetwork& array, const Process& viewer) {
  std::map<int, Trip> nodes;
  std::map<int, double> slowest;
  for (int i = 0; i < ArrayNetwork::kNodes; i++)
    for (const Process::Line& line : array.node(i).lines()) {
      if (line.text.find("lightfield-answer,") == std::string::npos) continue;
      const int sequence = static_cast<int>(field(line.text, "sequence"));
      const double wait = field(line.text, "wait-ns") / 1e6, encode = field(line.text, "encode-ns") / 1e6;
      const double warp = (field(line.text, "render-ns") + field(line.text, "decode-ns")) / 1e6;
      if (wait + warp + encode <= slowest[sequence]) continue;
      slowest[sequence] = wait + warp + encode;
      nodes[sequence] = {wait, warp, encode};
    }
  std::map<int, std::array<double, 3>> compositor;  // latency, add, composite
  for (const Process::Line& line : array.compositor().lines())
    if (line.text.find("lightfield-view,") != std::string::npos)
      compositor[static_cast<int>(field(line.text, "sequence"))] = {field(line.text, "latency-ns") / 1e6,
                                                                    field(line.text, "add-ns") / 1e6,
                                                                    field(line.text, "composite-ns") / 1e6};
  std::vector<std::pair<Trip, double>> trips;
  for (const Process::Line& line : viewer.lines()) {
    int sequence = 0;
    double total = 0, display = 0;
    if (std::sscanf(line.text.c_str(), "loop %d %lf %lf", &sequence, &total, &display) != 3) continue;
    if (!nodes.contains(sequence) || !compositor.contains(sequence)) continue;
    Trip trip = nodes[sequence];
    const auto [latency, add, composite] = compositor[sequence];
    trip[3] = std::max(0.0, latency - slowest[sequence] - add - composite);
    trip[4] = add;
    trip[5] = composite;
    trip[6] = display;
    trip[7] = std::max(0.0, total - latency - display);
    trips.emplace_back(trip, total);
  }
  return trips;
}

void plot(const std::vector<std::array<double, 2>>& stages, const std::string& folder) {
  const std::string base = folder + "/roundtrip";
  std::ofstream gp(base + ".gp");
  gp << "set terminal pngcairo size 900,420\nset output '" << base << ".png'\nset style data histograms\n"
     << "set style histogram rowstacked\nset style fill solid 0.9\nset boxwidth 0.6\nset key outside right\n"
     << "set ylabel 'milliseconds'\nset title 'Round trip of a view: 64 cameras on six hosts, 320x240'\nset grid y\n"
     << "$data << EOD\nname";
  for (const char* stage : kStages) gp << " \"" << stage << "\"";
  for (int column = 0; column < 2; column++) {
    gp << "\n" << (column ? "p95" : "p50");
    for (const auto& stage : stages) gp << " " << stage[static_cast<size_t>(column)];
  }
  gp << "\nEOD\nplot for [i=2:" << kStages.size() + 1 << "] $data using i:xtic(1) title columnheader(i)\n";
  gp.close();
  if (std::system(("gnuplot '" + base + ".gp'").c_str()) != 0) throw std::runtime_error("gnuplot failed");
  std::remove((base + ".gp").c_str());
}

int run(const char* self, int count, const std::string& plots, const std::string& json_file) {
  ArrayNetwork::Options options;
  options.framerate = 30;
  options.camera = "post-messages=true";
  ArrayNetwork array(options);
  for (int i = 0; i < ArrayNetwork::kNodes; i++) array.start_node(i);
  array.start_compositor();
  std::this_thread::sleep_for(std::chrono::seconds(4));
  const auto viewer =
      array.start("v0", {self, "--viewer", array.address("compositor"), array.path_file(0), std::to_string(count)});
  viewer->wait_for("loop " + std::to_string(count - 1), 1, 60 + count * kTimeout);
  std::vector<std::pair<Trip, double>> trips = trips_of(array, *viewer);
  // drops the warm-up
  trips.erase(trips.begin(), trips.begin() + static_cast<ptrdiff_t>(std::min<size_t>(trips.size(), 20)));
  if (trips.empty()) throw std::runtime_error("no picture came:\n" + array.compositor().text() + viewer->text());
  std::printf("round trip of a view, 64 cameras of 320x240 on six hosts, %zu views, milliseconds\n%-24s %8s %8s\n",
              trips.size(), "", "p50", "p95");
  std::vector<std::array<double, 2>> stages;
  nlohmann::json rows = nlohmann::json::array();
  const auto row = [&](const char* name, const std::vector<double>& values) {
    std::printf("%-24s %8.2f %8.2f\n", name, at(values, 50), at(values, 95));
    rows.push_back({{"stage", name}, {"p50_ms", at(values, 50)}, {"p95_ms", at(values, 95)}});
  };
  for (size_t s = 0; s < kStages.size(); s++) {
    std::vector<double> values;
    for (const auto& [trip, total] : trips) values.push_back(trip[s]);
    stages.push_back({at(values, 50), at(values, 95)});
    row(kStages[s], values);
  }
  std::vector<double> totals;
  for (const auto& [trip, total] : trips) totals.push_back(total);
  row("whole loop", totals);
  if (!plots.empty()) plot(stages, plots);
  if (!json_file.empty()) std::ofstream(json_file) << nlohmann::json{{"rows", rows}}.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace lf::test

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  try {
    if (argc == 5 && !std::strcmp(argv[1], "--viewer")) return lf::test::view(argv[2], argv[3], std::atoi(argv[4]));
    int views = 500;
    std::string plots, json;
    for (int i = 1; i + 1 < argc; i += 2) {
      if (!std::strcmp(argv[i], "--views")) views = std::atoi(argv[i + 1]);
      if (!std::strcmp(argv[i], "--plots")) plots = argv[i + 1];
      if (!std::strcmp(argv[i], "--json")) json = argv[i + 1];
    }
    if (const std::string reason = lf::test::Network::unavailable(); !reason.empty()) throw std::runtime_error(reason);
    return lf::test::run(argv[0], views, plots, json);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench-roundtrip: %s\n", error.what());
    return 1;
  }
}
