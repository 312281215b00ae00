// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate colour: colour models of all cameras, from a colour chart or from overlapping views.
#include <gst/gst.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "calibration/colour_samples.h"
#include "calibration/colour_solve.h"
#include "commands.h"
#include "image/colour_correction.h"
#include "image/image.h"
#include "recordings.h"
#include "rig/rig_json.h"
#include "terminal.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct ColourArguments {
  std::string rig, recording, from = "auto", out, json;
  int frames = 24;
};

// Number of frames for comparing views. More frames of the same scene add little.
constexpr size_t kViewFrames = 3;

// Returns the name of image `n` of a sequence such as left_%04d.png, or an empty text if the pattern is invalid.
std::string name_of_frame(const std::string& pattern, size_t n) {
  const size_t begin = pattern.find('%'), end = pattern.find('d', begin);
  if (begin == std::string::npos || end == std::string::npos || end - begin > 4) return "";
  const std::string digits = pattern.substr(begin + 1, end - begin - 1);
  if (digits.find_first_not_of("0123456789") != std::string::npos) return "";
  std::string number = std::to_string(n);
  const size_t width = digits.empty() ? 0 : std::stoul(digits);
  if (number.size() < width) number.insert(0, width - number.size(), digits[0] == '0' ? '0' : ' ');
  return pattern.substr(0, begin) + number + pattern.substr(end + 1);
}

// A frame of a camera, with the number of its place. Each place is one position of the chart, and frames of all cameras
// at the same place show the same position.
struct Frame {
  size_t place;
  lf::Image image;
};

// True for an image sequence such as left_%04d.png. If a file of this name exists, it is not a sequence.
bool is_sequence(const std::string& source) {
  return source.find('%') != std::string::npos && !lf::is_uri(source) && !fs::exists(source);
}

// Returns the time between two places in seconds, so that all places are distributed over the longest recording.
// Returns 0 if durations are unknown; every frame is then a place.
double time_between_places(const lf::Rig& recorded, size_t places) {
  double longest = 0;
  for (const lf::Camera& camera : recorded.cameras)
    if (const std::string source = recorded.resolve(camera.source);
        !source.empty() && !is_sequence(source) && (!lf::is_uri(source) || source.starts_with("file:")))
      longest = std::max(longest, video_duration(source));
  return longest / static_cast<double>(places);
}

// Returns frames from a camera's source, or its still image: one frame per place, and at most `most`. If there are
// none, `trouble` receives the reason.
std::vector<Frame> frames_of(const lf::Rig& rig, const lf::Camera& camera, size_t most, double between,
                             std::string& trouble) {
  std::vector<Frame> frames;
  const std::string source = rig.resolve(camera.source);
  if (is_sequence(source)) {
    for (size_t n = 0; frames.size() < most; n++) {
      const std::string path = name_of_frame(source, n);
      if (!fs::exists(path)) break;
      frames.push_back({n, lf::load_image(path)});
    }
  } else if (!source.empty())
    try {
      for_each_video_frame(source, VideoFormat::kRgb, [&](const VideoFrame& picture) {
        const size_t place = between > 0 ? static_cast<size_t>(picture.time / between + 1e-6) : frames.size();
        if (place >= most) return false;
        if (!frames.empty() && place <= frames.back().place) return true;
        frames.push_back({place, picture.rgb()});
        return true;
      });
    } catch (const lf::Error& error) {
      trouble = error.what();
    }
  if (frames.empty() && !camera.image.empty()) frames.push_back({0, lf::load_image(rig.resolve(camera.image))});
  for (const auto& [place, frame] : frames)
    if (frame.width() != camera.width || frame.height() != camera.height)
      throw lf::Error("camera " + std::to_string(camera.id) + ": its recording has " +
                      lf::size_text(frame.width(), frame.height()) + " pixels, but the rig file states " +
                      lf::size_text(camera.width, camera.height) +
                      "; record with the image size for which the rig is calibrated");
  return frames;
}

struct Recording {
  lf::ColourSamples chart;
  std::vector<std::vector<lf::Image>> views;
  size_t charts = 0;
  std::vector<std::string> without;
};

// Reads the recordings of all cameras in parallel and searches each frame for the chart. Also keeps some frames for
// comparing views, the method without a chart.
Recording read(const lf::Rig& rig, const lf::Rig& recorded, const ColourArguments& options) {
  Recording out;
  const size_t n = rig.cameras.size();
  out.chart.cameras = n;
  out.chart.chart_columns = lf::checker::kColumns;
  out.chart.chart_rows = lf::checker::kRows;
  out.views.assign(kViewFrames, std::vector<lf::Image>(n));
  std::vector<std::vector<lf::ColourSample>> found(n);
  std::vector<size_t> charts(n), lengths(n);
  std::vector<std::string> troubles(n);
  const double between = time_between_places(recorded, static_cast<size_t>(options.frames));
  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  for_each_recording("reading", n, threads, [&](size_t i, const auto&) {
    const auto index = recorded.index_of_id(rig.cameras[i].id);
    std::vector<Frame> frames;
    if (index) {
      lf::Camera camera = rig.cameras[i];
      camera.source = recorded.cameras[*index].source;
      camera.image = recorded.cameras[*index].image;
      frames = frames_of(recorded, camera, static_cast<size_t>(options.frames), between, troubles[i]);
    }
    lengths[i] = frames.empty() ? 0 : frames.back().place + 1;
    for (auto& [place, image] : frames) {
      if (options.from != "views") {
        const auto samples = lf::find_colour_checker(image, static_cast<lf::CameraIndex>(i),
                                                     static_cast<uint32_t>(place * lf::checker::kPatches));
        charts[i] += !samples.empty();
        found[i].insert(found[i].end(), samples.begin(), samples.end());
      }
      if (place < kViewFrames) out.views[place][i] = std::move(image);
    }
    lf::remove_misread_charts(found[i]);
  });
  for (size_t i = 0; i < n; i++) {
    out.chart.all.insert(out.chart.all.end(), found[i].begin(), found[i].end());
    out.charts += charts[i];
    out.chart.patches = std::max(out.chart.patches, static_cast<uint32_t>(lengths[i] * lf::checker::kPatches));
    if (lengths[i] == 0)
      out.without.push_back("camera " + std::to_string(rig.cameras[i].id) +
                            ": the recording contains no frame of this camera" +
                            (troubles[i].empty() ? "" : ": " + troubles[i]));
  }
  if (out.without.size() == n)
    throw lf::Error((options.recording.empty() ? options.rig : options.recording) +
                    ": no camera has a frame; give --recording a folder with NAME.* for each camera, or a rig file "
                    "with sources or images");
  return out;
}

lf::ColourSamples compare_views(const lf::Rig& rig, const Recording& recording) {
  lf::ColourSamples all;
  all.cameras = rig.cameras.size();
  for (const std::vector<lf::Image>& frame : recording.views) {
    if (std::ranges::all_of(frame, [](const lf::Image& image) { return image.width() == 0; })) continue;
    lf::ColourSamples samples = lf::sample_views(rig, frame);
    for (lf::ColourSample& sample : samples.all) {
      sample.patch += all.patches;
      all.all.push_back(sample);
    }
    all.patches += samples.patches;
  }
  return all;
}

ordered_json to_json(const lf::ColourDifferences& d) {
  return {{"median", d.median}, {"p95", d.p95}, {"rms", d.rms}, {"pairs", d.pairs}};
}

ordered_json report(const lf::Rig& rig, const lf::ColourSolution& solution, const std::string& from) {
  ordered_json trials = ordered_json::array(), cameras = ordered_json::array();
  for (const auto& trial : solution.trials)
    trials.push_back({{"terms", trial.terms.name()}, {"held_out", to_json(trial.held_out)}});
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const lf::ColourSolution::Camera& camera = solution.cameras[i];
    cameras.push_back({{"id", rig.cameras[i].id},
                       {"corrected", solution.models[i].has_value()},
                       {"samples", camera.samples},
                       {"clipped", camera.clipped},
                       {"gain", camera.gain},
                       {"rms", camera.rms},
                       {"stuck", camera.is_stuck}});
  }
  return {{"format", "lightfield-colour-report"},
          {"version", 1},
          {"from", from},
          {"terms", solution.terms.name()},
          {"before", to_json(solution.before)},
          {"after", to_json(solution.after)},
          {"trials", trials},
          {"findings", lf::to_json(solution.findings)},
          {"cameras", cameras}};
}

void print(const lf::Rig& rig, const lf::ColourSolution& solution, const std::string& from) {
  terminal::print("%-62s %8s %8s\n", ("differences on held-out patches, of 255 (" + from + ")").c_str(), "median",
                  "95 %");
  terminal::print("%-62s %8.2f %8.2f\n", "uncorrected", solution.before.median, solution.before.p95);
  for (const auto& trial : solution.trials)
    terminal::print("%-62s %8.2f %8.2f%s\n", trial.terms.name().c_str(), trial.held_out.median, trial.held_out.p95,
                    trial.terms == solution.terms ? "  <- chosen" : "");
  for (const lf::Finding& finding : solution.findings)
    terminal::print("%s: %s\n", lf::name_of(finding.severity), finding.text.c_str());
  terminal::print(
      "%zu of %zu cameras corrected\n",
      static_cast<size_t>(std::ranges::count_if(solution.models, [](const auto& m) { return m.has_value(); })),
      rig.cameras.size());
}

void measure(const ColourArguments& options) {
  gst_init(nullptr, nullptr);
  nlohmann::json original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  lf::Rig rig = lf::load_rig(options.rig);
  const lf::Rig recorded = options.recording.empty()             ? rig
                           : fs::is_directory(options.recording) ? with_recordings(options.recording, rig)
                                                                 : lf::load_rig(options.recording);
  const Recording recording = read(rig, recorded, options);
  for (const std::string& camera : recording.without) terminal::print("warning: %s\n", camera.c_str());
  if (options.from == "chart" && recording.charts == 0)
    throw lf::Error(
        "no frame shows a colour chart. Show all cameras a chart with 24 patches (ColorChecker) at a dozen places, in "
        "even light without reflections. The chart must be at least a third of the image wide. Without a chart, use "
        "--from views");
  // A few detections may be false, so a chart recording needs many.
  const bool from_chart = options.from == "chart" || (options.from == "auto" && recording.charts >= rig.cameras.size());
  const auto progress = [](const std::string& step) { terminal::print_error("%s\n", step.c_str()); };
  if (!from_chart) progress("comparing views");
  const std::string from = from_chart ? std::to_string(recording.charts) + " charts" : "overlapping views";
  const lf::ColourSolution solution =
      lf::solve_colours(rig, from_chart ? recording.chart : compare_views(rig, recording), progress);
  print(rig, solution, from);
  for (size_t i = 0; i < rig.cameras.size(); i++) rig.cameras[i].colour = solution.models[i];
  lf::rebase_paths(rig, fs::path(options.out).parent_path().string());
  lf::save_rig(rig, options.out, &original);
  if (!options.json.empty()) lf::write_text_file(report(rig, solution, from).dump(1) + "\n", options.json);
}

}  // namespace

void add_colour_command(cli::App& app) {
  const auto o = std::make_shared<ColourArguments>();
  cli::App* command = app.add_subcommand("colour",
                                         "Estimates colour corrections that make all cameras show the same colours: "
                                         "black level, gain, colour matrix, gamma and vignetting of each camera");
  command->add_option("RIG", o->rig, "Calibrated rig file of the array")->required()->type_name("RIG");
  command
      ->add_option(
          "--recording", o->recording,
          "Images for the colour estimation: a folder with one video or image per camera, named after the camera, or "
          "another rig file with sources or images. By default, the sources and images of RIG are used")
      ->type_name("DIR|RIG");
  command
      ->add_option("--from", o->from,
                   "Estimation method. chart uses images of a colour chart with 24 patches. views needs no chart: it "
                   "compares the colours of scene points that several cameras see, so the geometry of the rig must be "
                   "calibrated. auto uses chart if the images show a chart, and views otherwise")
      ->check(cli::IsMember({"auto", "chart", "views"}));
  command
      ->add_option("--frames", o->frames,
                   "Maximum number of frames to use per recording. They are evenly spaced over the recording. More "
                   "frames take more time. All recordings must start at the same time, because frames at equal times "
                   "must show the same scene")
      ->check(cli::Range(1, 10000));
  command->add_option("--out", o->out, "Rig file to write, with the colour corrections. This may be RIG")
      ->required()
      ->type_name("RIG");
  command->add_option("--json", o->json, "JSON file that receives the report, for lf-calibrate report")
      ->type_name("FILE");
  command->callback([o] { measure(*o); });
}
