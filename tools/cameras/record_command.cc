// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig record: what all cameras see for a while, as recordings for lf-calibrate.
#include <gst/gst.h>

#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "cameras/commands.h"
#include "cameras/doctor.h"
#include "cameras/guided_recording.h"
#include "cameras/rig_cameras.h"
#include "rig/rig_json.h"

namespace {

struct RecordArguments {
  std::string rig, out, cameras;
  lf::cameras::RecordingOptions recording;
  lf::cameras::RecordingGuide guide;
  int page = -1;
};

// Ctrl-C ends a recording, and what there is becomes whole files.
volatile std::sig_atomic_t interrupted = 0;

int record_films(RecordArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  options.recording.cameras = lf::parse_camera_list(*rig, options.cameras);
  if (options.page >= 0) options.guide.page = options.page;
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  const std::vector<lf::cameras::Recorded> recorded = lf::cameras::record_guided(
      rig, options.rig, options.out, options.recording, options.guide, [] { return interrupted == 0; });
  size_t whole = 0;
  for (const auto& [index, frames, problem, note] : recorded) {
    const lf::Camera& camera = rig->cameras[index];
    std::printf("camera %s: %llu frames%s%s\n", lf::cameras::name_of(camera).c_str(),
                static_cast<unsigned long long>(frames), problem.empty() ? "" : ": ",
                problem.empty() ? "" : (problem + ": " + lf::cameras::remedy_of(camera, problem)).c_str());
    if (!note.empty()) std::printf("  %s\n", note.c_str());
    whole += problem.empty();
  }
  std::printf("%s: %zu of %zu cameras\n", options.out.c_str(), whole, recorded.size());
  return whole < recorded.size() ? 1 : 0;
}

}  // namespace

void add_record_command(cli::App& app, int& status) {
  const auto o = std::make_shared<RecordArguments>();
  cli::App* command = app.add_subcommand(
      "record", "A film of each camera, all by one clock, for lf-calibrate; exit status 1 if one is missing");
  command->add_option("RIG", o->rig, "Rig file")->required();
  command->add_option("--out", o->out, "Folder to write: NAME.mkv of each camera")->required();
  command->add_option("--cameras", o->cameras, "Ids: 0-3,7 (default: all)");
  command->add_option("--seconds", o->recording.seconds, "Length; ctrl-C ends it before")
      ->capture_default_str()
      ->check(cli::Range(0.1, 86400.0));
  command
      ->add_option("--lights", o->guide.lights,
                   "So many are moved through the dark: says meanwhile where they were not yet")
      ->check(cli::Range(1, 2));
  command
      ->add_option("--page", o->page,
                   "Port of a page on this machine that shows the cameras, and what is said; 0: any (default: none)")
      ->check(cli::Range(0, 65535));
  cli::add_trust_option(*command, o->recording.trusted);
  command->callback([o, &status] { status = record_films(*o); });
}
