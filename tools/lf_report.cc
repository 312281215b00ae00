// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-report: summarizes a run of a light field pipeline as report.json and a contact sheet.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/maths.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "command_line.h"
#include "contact_sheet.h"
#include "image/image.h"
#include "progress.h"
#include "quality/image_quality.h"
#include "render/contribution_map.h"
#include "rig/rig_json.h"
#include "rig/still_image_cache.h"
#include "scene/scene.h"
#include "terminal.h"
#include "view/view_path.h"

namespace {

struct Options {
  std::string rig, views, frames, plane, log, live_log, out;
  bool scene = false;
};

// The message "lightfield-view" that lfcompositor posts for each picture.
struct ViewLogEntry {
  double clock = 0;  // seconds; when the message was printed
  uint32_t sequence = 0;
  bool complete = false;
  uint64_t bytes = 0, consistency_bytes = 0, latency_ns = 0;
};

std::optional<std::string> field(const std::string& line, const std::string& name) {
  const size_t at = line.find(" " + name + "=(");
  if (at == std::string::npos) return std::nullopt;
  const size_t begin = line.find(')', at) + 1;
  return line.substr(begin, line.find_first_of(",;", begin) - begin);
}

// Reads the "lightfield-view" messages from the output of `gst-launch-1.0 -m`, where each line begins with a time in
// seconds (bash's $EPOCHREALTIME). Throws lf::Error if the file is unreadable or contains no such message.
std::vector<ViewLogEntry> read_view_log(const std::string& path) {
  std::vector<ViewLogEntry> entries;
  std::istringstream text(lf::read_text_file(path));
  for (std::string line; std::getline(text, line);) {
    if (line.find(" lightfield-view,") == std::string::npos) continue;
    const auto number = [&](const char* name) -> uint64_t {
      const std::optional<std::string> value = field(line, name);
      if (!value) throw lf::Error(path + ": a lightfield-view message has no field " + name + ": " + line);
      return std::strtoull(value->c_str(), nullptr, 10);
    };
    ViewLogEntry entry;
    entry.clock = std::strtod(line.c_str(), nullptr);
    entry.sequence = static_cast<uint32_t>(number("sequence"));
    entry.complete = field(line, "complete") == "true";
    entry.bytes = number("bytes");
    entry.consistency_bytes = number("consistency-bytes");
    entry.latency_ns = number("latency-ns");
    entries.push_back(entry);
  }
  if (entries.empty())
    throw lf::Error(path +
                    ": contains no lightfield-view messages, so the pipeline has rendered no pictures; set "
                    "post-messages=true at lfcompositor");
  return entries;
}

// Reads raw video written by `video/x-raw,format=RGB ! filesink`: consecutive frames, with rows padded to four bytes.
class RawFrames {
 public:
  RawFrames(const std::string& path, int width, int height)
      : path_(path), width_(width), height_(height), stride_((width * 3 + 3) / 4 * 4) {
    std::error_code error;
    if (const auto status = std::filesystem::status(path, error);
        std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
      throw lf::Error(path + ": can't be read: it is not a regular file");  // opening a FIFO may wait for ever
    file_.open(path, std::ios::binary);
    if (!file_) throw lf::Error(path + ": can't be read");
    const uint64_t bytes = std::filesystem::file_size(path), frame = static_cast<uint64_t>(stride_) * height;
    if (bytes == 0 || bytes % frame != 0)
      throw lf::Error(path + ": must contain raw RGB frames, but its size is not a multiple of a frame of " +
                      std::to_string(width) + "x" + std::to_string(height));
    count_ = bytes / frame;
  }
  size_t count() const { return count_; }
  lf::Image read(size_t i) {
    lf::Image image(lf::PixelFamily::kRgb, width_, height_);
    std::vector<char> row(stride_);
    file_.seekg(static_cast<std::streamoff>(i) * stride_ * height_);
    for (int y = 0; y < height_; y++) {
      file_.read(row.data(), stride_);
      std::copy_n(row.begin(), width_ * 3, image.pixel(0, y));
    }
    if (!file_) throw lf::Error(path_ + ": cannot be read to its end");
    return image;
  }

 private:
  std::string path_;
  std::ifstream file_;
  int width_, height_, stride_;
  size_t count_ = 0;
};

lf::Image truth_of(const lf::NamedView& view) {
  return lf::render_scene({view.view.width, view.view.height, view.view.lens, view.view.pose}, view.time);
}

double focus_distance(const lf::View& view) {
  const double along = glm::dot(view.focus.plane.normal, view.pose.forward());
  return -view.focus.plane.signed_distance(view.pose.position) / along;
}

struct Psnr {
  double surface = std::nan(""), plane = std::nan("");
};

struct Run {
  lf::Rig rig;
  lf::Mesh mesh;
  std::vector<lf::NamedView> views;
  std::vector<ViewLogEntry> log;
  std::vector<Psnr> psnr;
};

Psnr psnr_of(const Run& run, const lf::NamedView& view, const lf::Image& surface, const lf::Image& plane) {
  const lf::ViewPlan plan(run.rig, run.mesh, view.view);
  const lf::FaceIdMap owners(plan, {0, 0, view.view.width, view.view.height});
  const std::vector<float> coverage = lf::view_coverage(run.rig, plan, owners);
  const lf::Image truth = truth_of(view);
  return {lf::compare(surface, truth, coverage).psnr_db, lf::compare(plane, truth, coverage).psnr_db};
}

std::optional<double> mean_psnr(const std::vector<Psnr>& all, double Psnr::*of) {
  double sum = 0, judged = 0;
  for (const Psnr& psnr : all) {
    if (!std::isfinite(psnr.*of)) continue;
    sum += psnr.*of;
    judged++;
  }
  return judged > 0 ? std::optional(sum / judged) : std::nullopt;
}

template <class Value>
size_t index_of_largest(size_t count, const Value& value) {
  size_t best = 0;
  for (size_t i = 1; i < count; i++)
    if (value(i) > value(best)) best = i;
  return best;
}

std::string metres(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g m", v);
  return text;
}

lf::CameraIndex nearest_camera(const lf::Rig& rig, const lf::View& view) {
  return static_cast<lf::CameraIndex>(index_of_largest(
      rig.cameras.size(), [&](size_t i) { return -glm::length(rig.cameras[i].pose.position - view.pose.position); }));
}

std::string with_psnr(const std::string& title, double psnr_db) {
  if (!std::isfinite(psnr_db)) return title;
  char text[32];
  std::snprintf(text, sizeof text, ": %.1f dB", psnr_db);
  return title + text;
}

lf::Image sheet_of(const Run& run, RawFrames& surface, RawFrames& plane, bool scene, const std::string& foot) {
  lf::StillImageCache files(run.rig);
  const auto image_of = [&](lf::CameraIndex i) -> const lf::Image& { return files.get(i); };
  const bool images = lf::has_images(run.rig);
  const size_t n = run.views.size();
  const auto nearest_camera_panel = [&](const lf::View& view) {
    const lf::CameraIndex camera = nearest_camera(run.rig, view);
    return Panel{"nearest camera, " + run.rig.cameras[camera].name, image_of(camera)};
  };

  std::vector<Panel> panels;
  const size_t near = index_of_largest(n, [&](size_t i) { return -focus_distance(run.views[i].view); });
  const size_t far = index_of_largest(n, [&](size_t i) { return focus_distance(run.views[i].view); });
  for (const size_t i : {near, far}) {
    const lf::NamedView& view = run.views[i];
    if (scene)
      panels.push_back({"view " + std::to_string(i) + ", ground truth", truth_of(view)});
    else if (images)
      panels.push_back(nearest_camera_panel(view.view));
    panels.push_back(
        {with_psnr("one plane at " + metres(focus_distance(view.view)), run.psnr[i].plane), plane.read(i)});
    panels.push_back({with_psnr("focal surface", run.psnr[i].surface), surface.read(i)});
  }
  const size_t rich = index_of_largest(
      n, [&](size_t i) { return lf::ViewPlan(run.rig, run.mesh, run.views[i].view).contributors().size(); });
  const lf::NamedView& view = run.views[rich];
  const lf::Image picture = surface.read(rich);
  if (images)
    panels.push_back(
        {std::to_string(run.rig.cameras.size()) + " camera images", camera_mosaic(run.rig, image_of, 960)});
  panels.push_back({with_psnr("view " + std::to_string(rich), run.psnr[rich].surface), picture});
  panels.push_back({"contributing cameras, view " + std::to_string(rich),
                    lf::contribution_map(run.rig, run.mesh, view.view, &picture)});
  return make_contact_sheet("gst-lightfield", panels, scene || images ? 3 : 2, foot);
}

void run_report(const Options& options) {
  Run run;
  run.rig = lf::load_rig(options.rig);
  run.mesh = lf::build_mesh(run.rig);
  run.views = lf::load_views(options.views);
  run.log = read_view_log(options.log);
  const lf::View& first = run.views[0].view;
  RawFrames frames(options.frames, first.width, first.height), plane(options.plane, first.width, first.height);
  if (frames.count() > run.views.size() || frames.count() != run.log.size())
    throw lf::Error(options.frames + ": has " + std::to_string(frames.count()) + " pictures, but there are " +
                    std::to_string(run.views.size()) + " views and " + std::to_string(run.log.size()) + " messages");
  if (plane.count() != frames.count())
    throw lf::Error(options.plane + ": has " + std::to_string(plane.count()) + " pictures, but " + options.frames +
                    " has " + std::to_string(frames.count()));
  run.views.resize(frames.count());
  run.psnr.resize(frames.count());
  const double n = static_cast<double>(frames.count());

  if (options.scene) {
    Progress progress("comparing with the ground truth", frames.count());
    std::mutex mutex;  // guards the files and the progress
    lf::parallel_for_all_processors()(frames.count(), [&](size_t i) {
      std::unique_lock lock(mutex);
      const lf::Image on_surface = frames.read(i), on_plane = plane.read(i);
      lock.unlock();
      run.psnr[i] = psnr_of(run, run.views[i], on_surface, on_plane);
      lock.lock();
      progress.step();
    });
  }
  const auto surface_db = mean_psnr(run.psnr, &Psnr::surface), plane_db = mean_psnr(run.psnr, &Psnr::plane);

  nlohmann::ordered_json report;
  const auto number = [](const std::optional<double>& v) { return v ? nlohmann::ordered_json(*v) : nullptr; };
  report["frames"] = frames.count();
  const double seconds = run.log.back().clock - run.log.front().clock;
  report["fps"] = seconds > 0 ? nlohmann::ordered_json((n - 1) / seconds) : nullptr;
  // Prefers the live run for latencies. A live run has only one request in flight, so its times contain no waiting in
  // queues.
  lf::Percentiles latency(1 << 20);
  for (const ViewLogEntry& entry : read_view_log(options.live_log.empty() ? options.log : options.live_log))
    latency.add(entry.latency_ns);
  report["latency_ms"] = {{"p50", latency.at(50) * 1e-6}, {"p95", latency.at(95) * 1e-6}};
  double bytes = 0, consistency_bytes = 0;
  for (const ViewLogEntry& entry : run.log) {
    bytes += static_cast<double>(entry.bytes) / n;
    consistency_bytes += static_cast<double>(entry.consistency_bytes) / n;
  }
  report["bytes_per_frame"] = bytes;
  report["consistency_bytes_per_frame"] = consistency_bytes;
  report["psnr_db"] = number(surface_db);
  report["plane_psnr_db"] = number(plane_db);

  char psnr[96] = "no ground truth";
  if (surface_db && plane_db)
    std::snprintf(psnr, sizeof psnr, "%.1f dB against ground truth (plane: %.1f dB)", *surface_db, *plane_db);
  char foot[256];
  std::snprintf(
      foot, sizeof foot,
      "%zu frames of %dx%d, %.0f frames/s, latency %.1f ms, %.0f kB of colour and %.0f kB of depth data per frame, %s",
      frames.count(), first.width, first.height, seconds > 0 ? (n - 1) / seconds : 0, latency.at(50) * 1e-6,
      bytes / 1e3, consistency_bytes / 1e3, psnr);
  const size_t incomplete = static_cast<size_t>(
      std::count_if(run.log.begin(), run.log.end(), [](const ViewLogEntry& entry) { return !entry.complete; }));
  if (incomplete > 0)
    terminal::print_error("lf-report: %zu of %zu pictures are incomplete\n", incomplete, run.log.size());

  lf::make_folder(options.out);
  lf::save_image(sheet_of(run, frames, plane, options.scene, foot), options.out + "/sheet.png");
  lf::write_text_file(report.dump(1) + "\n", options.out + "/report.json");
  terminal::print("%s\n", report.dump(1).c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Summarizes a run of a light field pipeline: picture quality, latency and bytes. Writes report.json and the "
      "contact sheet sheet.png, and prints report.json.",
      "lf-report");
  app.add_option("--rig", o.rig, "Rig file that the pipeline used for rendering")->required()->type_name("RIG.json");
  app.add_option("--views", o.views, "Views file with the views that the pipeline rendered")
      ->required()
      ->type_name("VIEWS.json");
  app.add_option("--frames", o.frames,
                 "Rendered pictures as raw RGB video, written by a filesink after video/x-raw,format=RGB")
      ->required();
  app.add_option("--plane", o.plane,
                 "Pictures of the same views, rendered with lfcompositor focus=plane, as raw RGB video. The report "
                 "compares these pictures with --frames")
      ->required();
  app.add_option("--log", o.log,
                 "Output of gst-launch-1.0 -m, which contains the messages of the pipeline. Each line must begin with "
                 "the time of day in seconds, for example from bash's $EPOCHREALTIME")
      ->required();
  app.add_option("--live-log", o.live_log,
                 "Output of a run with live cameras, in the format of --log. The latency is then taken from this run "
                 "instead of --log. A live run is more realistic, because its pipeline has only one request in flight");
  app.add_flag("--scene", o.scene,
               "Compare the pictures with the ground truth of the built-in scene. The cameras of the rig must have "
               "filmed this scene");
  app.add_option("--out", o.out, "Folder that receives report.json and sheet.png")->required()->type_name("DIR");
  return cli::run_tool(app, argc, argv, [&] { run_report(o); });
}
