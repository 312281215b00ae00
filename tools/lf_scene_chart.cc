// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-scene chart: what cameras record while a chart of 24 colours is held before them, here and there.
#include "lf_scene_chart.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/worker_pool.h"
#include "mjpeg_writer.h"
#include "progress.h"
#include "rig/rig_json.h"
#include "scene/colour_chart.h"
#include "scene_faults.h"

namespace {

namespace fs = std::filesystem;

struct ChartOptions {
  std::string rig, out;
  int places = 12, quality = 97;
  FaultOptions faults;
};

void record(const ChartOptions& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  const std::vector<lf::ColourFault> faults = options.faults.faults(rig);
  const std::vector<lf::ChartPose> charts = lf::chart_poses(rig, options.places);
  lf::FolderUpdate update(options.out);
  Progress progress("filming", rig.cameras.size());
  for (size_t i = 0; i < rig.cameras.size(); i++, progress.step()) {
    lf::Camera& camera = rig.cameras[i];
    const bool fits = !camera.name.empty() && camera.name.find('/') == std::string::npos;
    const std::string name = (fits ? camera.name : "camera-" + std::to_string(camera.id)) + ".mkv";
    std::vector<lf::Image> frames(charts.size());
    lf::WorkerPool::shared()->run(8, charts.size(), [&](size_t n) {
      const lf::Image image = lf::render_chart({camera.width, camera.height, camera.lens, camera.pose}, charts[n]);
      frames[n] = filmed(image, faults, rig, i, static_cast<int>(n));
    });
    MjpegWriter writer((fs::path(update.staging()) / name).string(), camera.width, camera.height, {1, 1},
                       options.quality);
    for (const lf::Image& frame : frames) writer.add(frame);
    writer.finish();
    camera.source = name;
    camera.image.clear();
  }
  progress.finish();
  update.commit();
  write_faults(rig, faults, options.out);
  lf::save_rig(rig, options.out + "/rig.json");
  std::printf("%zu cameras, a chart at %zu places: %s/rig.json\n", rig.cameras.size(), charts.size(),
              options.out.c_str());
}

}  // namespace

cli::App* add_chart_command(cli::App& app) {
  const auto o = std::make_shared<ChartOptions>();
  cli::App* command =
      app.add_subcommand("chart", "Films a chart of 24 colours that is held before the array here and there");
  command->add_option("--rig", o->rig, "Cameras")->required()->type_name("RIG.json");
  command->add_option("--out", o->out, "Folder to write to: rig.json, and a recording of each camera")
      ->required()
      ->type_name("DIR");
  command->add_option("--places", o->places, "Where the chart is held: a frame each")
      ->capture_default_str()
      ->check(cli::Range(1, 1000));
  command->add_option("--quality", o->quality, "Of JPEG")->capture_default_str()->check(cli::Range(1, 100));
  o->faults.add_to(*command);
  command->callback([o] { record(*o); });
  return command;
}
