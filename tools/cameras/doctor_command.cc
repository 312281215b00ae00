// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig doctor: what each camera of a rig delivers, what is wrong, and what helps.
#include <gst/gst.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "cameras/commands.h"
#include "cameras/doctor.h"
#include "progress.h"
#include "rig/rig_json.h"

namespace {

struct DoctorArguments {
  std::string rig;
  lf::cameras::ExamOptions exam;
  bool json = false;
};

int examine(DoctorArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  if (!options.json) {
    options.exam.on_plan = [](const std::vector<lf::cameras::LinkLoad>& planned) {
      std::fputs(lf::cameras::links_of(planned, "as planned").c_str(), stdout);
      std::fflush(stdout);
    };
    options.exam.on_progress = [bar = std::make_shared<Progress>("watching", 100), shown = 0](double part) mutable {
      for (; shown < 100 * part && shown < 100; shown++) bar->step();
    };
    std::fprintf(stderr, "opening %zu cameras\n", rig->cameras.size());
  }
  const lf::cameras::Exam exam = lf::cameras::examine(rig, options.rig, options.exam);
  options.exam.on_progress = {};  // the bar goes before the page comes
  std::fputs((options.json ? json_of(*rig, exam) + "\n" : page_of(*rig, exam)).c_str(), stdout);
  return exam.errors() > 0 ? 1 : 0;
}

}  // namespace

void add_doctor_command(cli::App& app, int& status) {
  const auto o = std::make_shared<DoctorArguments>();
  cli::App* command = app.add_subcommand(
      "doctor",
      "Opens every camera: what each delivers, what is wrong, what helps; exit status 1 if something is wrong");
  command->add_option("RIG", o->rig, "Rig file")->required();
  command->add_option("--seconds", o->exam.seconds, "To watch the cameras for")
      ->capture_default_str()
      ->check(cli::Range(1.0, 600.0));
  command->add_option("--patience", o->exam.patience, "Seconds until a camera must have given a frame")
      ->capture_default_str()
      ->check(cli::Range(1.0, 120.0));
  command->add_option("--fps", o->exam.fps, "Frames per second to ask of devices (default: as they have them)")
      ->check(cli::Range(1, 1000));
  command->add_flag("--json", o->json, "For programs, in place of a page for people");
  cli::add_trust_option(*command, o->exam.trusted);
  command->callback([o, &status] { status = examine(*o); });
}
