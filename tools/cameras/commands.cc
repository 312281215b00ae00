// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lf_rig.h"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <glib-unix.h>
#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "cameras/doctor.h"
#include "cameras/guided_recording.h"
#include "cameras/identify_server.h"
#include "cameras/lock.h"
#include "cameras/mosaic.h"
#include "cameras/recorder.h"
#include "cameras/rig_cameras.h"
#include "progress.h"
#include "rig/camera_source.h"
#include "rig/rig_json.h"
#include "terminal.h"

namespace fs = std::filesystem;
using namespace lf::cameras;

namespace {

struct DoctorArguments {
  std::string rig;
  DoctorOptions exam;
  bool json = false;
};

int run_doctor(DoctorArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  if (!options.json) {
    options.exam.on_planned = [](const std::vector<LinkLoad>& planned) {
      terminal::write(stdout, link_table(planned, "as planned"));
      std::fflush(stdout);
    };
    options.exam.on_progress = [bar = std::make_shared<Progress>("watching", 100), shown = 0](double part) mutable {
      for (; shown < 100 * part && shown < 100; shown++) bar->step();
    };
    terminal::print_error("opening %zu cameras\n", rig->cameras.size());
    if (lf::has_no_pictures(*rig))
      terminal::write(stderr,
                      "no camera in the rig has an image or a source, so all cameras show the built-in scene\n");
  }
  const DoctorReport exam = run_doctor(rig, options.rig, options.exam);
  options.exam.on_progress = {};
  terminal::write(stdout, (options.json ? json_report(*rig, exam) + "\n" : text_report(*rig, exam)));
  return exam.errors() > 0 ? 1 : 0;
}

}  // namespace

void add_doctor_command(cli::App& app) {
  const auto o = std::make_shared<DoctorArguments>();
  cli::App* command = app.add_subcommand("doctor",
                                         "Opens all cameras at the same time, and reports frame rates, problems and "
                                         "their remedies. The exit status is 1 if there is an error");
  command->add_option("RIG", o->rig, "Rig file with the sources of the cameras")->required();
  command
      ->add_option("--seconds", o->exam.seconds,
                   "Observation time, in seconds, starting when all cameras deliver frames. A longer observation finds "
                   "rarer problems")
      ->check(cli::Range(1.0, 600.0));
  command
      ->add_option("--patience", o->exam.timeout,
                   "Maximum time until the first frame of each camera, in seconds. A camera that needs more time "
                   "counts as broken. Increase it for slow network cameras")
      ->check(cli::Range(1.0, 120.0));
  command
      ->add_option("--fps", o->exam.fps,
                   "Frame rate to request from V4L2 and other devices, in frames per second. Set this to test a rate "
                   "before you write it into the rig (default: the device decides)")
      ->check(cli::Range(1, 1000));
  command->add_flag("--json", o->json, "Print the report as JSON, for scripts");
  cli::add_trust_option(*command, o->exam.trusted);
  command->callback([o] { return run_doctor(*o); });
}

namespace {

struct IdentifyArguments {
  std::string rig;
  int port = 8090;
  bool trusted = false;
};

class Identify {
 public:
  explicit Identify(const IdentifyArguments& options)
      : path_(options.rig),
        text_(lf::parse_json(lf::read_text_file(path_), path_)),
        rig_(lf::load_rig(path_)),
        copy_(rig_, text_, path_, options.trusted),
        mosaic_(rig_),
        place_of_(rig_.cameras.size()),
        cameras_(copy_.rig(), copy_.path(), {.decode = false, .trusted = options.trusted},
                 [this](const CameraFrame& frame) {
                   mosaic_.see(rig_.cameras[place_of_[frame.camera]].id, gst_sample_get_buffer(frame.sample),
                               gst_sample_get_caps(frame.sample), frame.arrival_time);
                 }),
        server_(options.port, {[this] { return mosaic_.jpeg(cameras_.now()); }, [this] { return state(); },
                               [this](uint32_t a, uint32_t b) { return swap(a, b); }}) {
    for (lf::CameraIndex i = 0; i < place_of_.size(); i++) place_of_[i] = i;
  }

  void run() {
    GMainLoop* loop = g_main_loop_new(nullptr, FALSE);
    const auto quit = [](gpointer data) -> gboolean {
      g_main_loop_quit(static_cast<GMainLoop*>(data));
      return G_SOURCE_CONTINUE;
    };
    const guint sources[] = {g_unix_signal_add(SIGINT, quit, loop), g_unix_signal_add(SIGTERM, quit, loop),
                             g_timeout_add(
                                 200,
                                 [](gpointer identify) -> gboolean {
                                   static_cast<Identify*>(identify)->look();
                                   return G_SOURCE_CONTINUE;
                                 },
                                 this)};
    cameras_.start();
    terminal::print(
        "%zu cameras are shown at %s\nHold a hand in front of a camera to highlight its tile, and drag the tile to its "
        "place. Ctrl-C quits.\n",
        rig_.cameras.size(), server_.url().c_str());
    std::fflush(stdout);
    opening_.emplace("opening cameras", rig_.cameras.size());
    g_main_loop_run(loop);
    opening_.reset();
    for (const guint source : sources) g_source_remove(source);
    g_main_loop_unref(loop);
    cameras_.stop();
  }

 private:
  void look() {
    cameras_.wait(0);
    if (!opening_) return;
    const auto settled =
        std::ranges::count_if(cameras_.cameras(), [this](lf::CameraIndex i) { return cameras_.is_settled(i); });
    opening_->reach(static_cast<double>(settled) / static_cast<double>(rig_.cameras.size()));
    if (static_cast<size_t>(settled) < rig_.cameras.size()) return;
    opening_.reset();
    for (const lf::CameraIndex i : cameras_.cameras())
      if (const std::string problem = cameras_.problem(i); !problem.empty())
        terminal::print_error("warning: %s: %s\n", problem.c_str(), remedy_for(rig_.cameras[i], problem).c_str());
  }

  std::string state() {
    nlohmann::json state = mosaic_.state(cameras_.now(), [this](uint32_t id) {
      const lf::CameraIndex place = *rig_.index_of_id(id);
      const auto camera = std::find(place_of_.begin(), place_of_.end(), place) - place_of_.begin();
      return cameras_.problem(static_cast<lf::CameraIndex>(camera));
    });
    state["swaps"] = true;
    return state.dump();
  }

  std::string swap(uint32_t a, uint32_t b) {
    const auto first = rig_.index_of_id(a), second = rig_.index_of_id(b);
    if (!first || !second) return "there is no camera with this id";
    try {
      nlohmann::json text = text_;
      lf::swap_devices(text, a, b);
      lf::save_rig(lf::parse_rig(text.dump(), path_), path_, &text);
      text_ = std::move(text);
    } catch (const lf::Error& error) {
      return error.what();
    }
    for (std::atomic<lf::CameraIndex>& place : place_of_)
      place = place == *first ? *second : place == *second ? *first : place.load();
    mosaic_.swap(a, b);
    terminal::print("%s: the cameras of %s and %s have changed places\n", path_.c_str(),
                    name_of(rig_.cameras[*first]).c_str(), name_of(rig_.cameras[*second]).c_str());
    std::fflush(stdout);
    return "";
  }

  std::string path_;
  nlohmann::json text_;
  const lf::Rig rig_;
  TemporaryRig copy_;
  Mosaic mosaic_;
  std::vector<std::atomic<lf::CameraIndex>> place_of_;
  RigCameras cameras_;
  IdentifyServer server_;
  std::optional<Progress> opening_;
};

}  // namespace

void add_identify_command(cli::App& app) {
  const auto o = std::make_shared<IdentifyArguments>();
  cli::App* command = app.add_subcommand(
      "identify",
      "Serves a web page with live images of all cameras, to find out which camera is where. A hand in front of a "
      "camera highlights its tile, and the tile can be dragged to its place in the array");
  command
      ->add_option("RIG", o->rig,
                   "Rig file with the sources of the cameras. Swapping two tiles swaps their sources in this file")
      ->required();
  command
      ->add_option("--port", o->port,
                   "TCP port of the page, which only programs on this machine can open (0: the system selects a free "
                   "port)")
      ->check(cli::Range(0, 65535));
  cli::add_trust_option(*command, o->trusted);
  command->callback([o] {
    gst_init(nullptr, nullptr);
    Identify(*o).run();
  });
}

namespace {

struct LockArguments {
  std::string rig, out;
  uint32_t camera = 0;
  int mains = 0;
  bool no_check = false;
  LockOptions lock;
};

int lock_cameras(LockArguments options) {
  gst_init(nullptr, nullptr);
  lf::Rig rig = lf::load_rig(options.rig);
  nlohmann::json original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  const auto reference = rig.index_of_id(options.camera);
  if (!reference) throw lf::Error(options.rig + ": has no camera " + std::to_string(options.camera));
  options.lock.reference = *reference;
  options.lock.path = options.rig;
  if (options.mains > 0) options.lock.mains = options.mains;
  const double look = options.lock.settle + 1;
  std::optional<TimedProgress> progress;
  progress.emplace(rig.cameras[*reference].label() + " adjusts", look);
  ControlValues values;
  try {
    values = choose_controls(rig, options.lock);
  } catch (const CameraFailure& failure) {
    throw lf::Error(std::string(failure.what()) + ": " + remedy_for(rig.cameras[*reference], failure.what()));
  }
  progress.reset();
  std::map<uint32_t, lf::Controls> controls = lf::parse_controls(original, options.rig);
  for (const lf::Camera& camera : rig.cameras) {
    for (const auto& [name, value] : values) controls[camera.id][name] = value;
    if (options.mains > 0) controls[camera.id]["mains_frequency"] = options.mains;
  }
  lf::put_controls(controls, original);
  for (const auto& [name, value] : values) terminal::print("%s: %.6g\n", name.c_str(), value);
  std::vector<StuckControl> stuck;
  if (!options.no_check)
    stuck = find_stuck_controls(rig, values, options.lock, [&](const std::string& step) {
      progress.reset();
      progress.emplace(step, look);
    });
  progress.reset();
  for (const StuckControl& one : stuck)
    terminal::print("warning: %s: %s%s\n", rig.cameras[one.camera].label().c_str(),
                    one.control.empty() ? "" : (one.control + " does not respond: ").c_str(), one.why.c_str());
  const std::string out = options.out.empty() ? options.rig : options.out;
  lf::rebase_paths(rig, fs::path(out).parent_path().string());
  lf::save_rig(rig, out, &original);
  terminal::print("%s: %zu cameras have equal controls\n", out.c_str(), rig.cameras.size());
  return stuck.empty() ? 0 : 1;
}

}  // namespace

void add_lock_command(cli::App& app) {
  const auto o = std::make_shared<LockArguments>();
  cli::App* command = app.add_subcommand(
      "lock",
      "Gives all cameras the same fixed exposure, gain, white balance and focus: the values that one camera has chosen "
      "automatically. Then checks that these controls have an effect. The exit status is 1 if a control has none");
  command->add_option("RIG", o->rig, "Rig file with the sources of the cameras")->required();
  command
      ->add_option("--camera", o->camera,
                   "Id of the reference camera. All cameras receive its automatic values, so it should see a typical "
                   "part of the scene")
      ->capture_default_str();
  command
      ->add_option("--mains-frequency", o->mains,
                   "Mains frequency of the lamps, in hertz. Exposures are rounded to whole periods of the light, which "
                   "avoids flicker")
      ->check(cli::IsMember({50, 60}));
  command
      ->add_option("--settle", o->lock.settle,
                   "Time for the automatic controls to adjust to the light, in seconds. Increase it if the exposure "
                   "still changes after this time")
      ->check(cli::Range(0.1, 120.0));
  command->add_flag("--no-check", o->no_check,
                    "Skip the check that the controls have an effect. The check reopens all "
                    "cameras several times, so this option saves time");
  command->add_option("--out", o->out,
                      "Rig file that receives the fixed values, as controls of each camera (default: "
                      "RIG)");
  cli::add_trust_option(*command, o->lock.trusted);
  command->callback([o] { return lock_cameras(*o); });
}

namespace {

struct RecordArguments {
  std::string rig, out, cameras;
  RecordingOptions recording;
  RecordingGuide guide;
  int page = -1;
};

// Set by Ctrl-C, which ends the recording and completes its files.
volatile std::sig_atomic_t interrupted = 0;

int record_films(RecordArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  options.recording.cameras = lf::parse_camera_list(*rig, options.cameras);
  if (options.page >= 0) options.guide.page = options.page;
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  const std::vector<RecordedCamera> recorded =
      record_guided(rig, options.rig, options.out, options.recording, options.guide, [] { return interrupted == 0; });
  size_t whole = 0;
  for (const auto& [index, frames, problem, note] : recorded) {
    const lf::Camera& camera = rig->cameras[index];
    terminal::print("%s: %llu frames%s%s\n", camera.label().c_str(), static_cast<unsigned long long>(frames),
                    problem.empty() ? "" : ": ",
                    problem.empty() ? "" : (problem + ": " + remedy_for(camera, problem)).c_str());
    if (!note.empty()) terminal::print("  %s\n", note.c_str());
    whole += problem.empty();
  }
  terminal::print("%s: %zu of %zu cameras\n", options.out.c_str(), whole, recorded.size());
  return whole < recorded.size() ? 1 : 0;
}

}  // namespace

void add_record_command(cli::App& app) {
  const auto o = std::make_shared<RecordArguments>();
  cli::App* command = app.add_subcommand("record",
                                         "Records all cameras with a common clock, for lf-calibrate. The exit status "
                                         "is 1 if the recording of a camera is missing");
  command->add_option("RIG", o->rig, "Rig file with the sources of the cameras")->required();
  command
      ->add_option("--out", o->out,
                   "Folder that receives the film NAME.mkv of each camera. Existing films of these "
                   "cameras are replaced")
      ->required();
  command->add_option("--cameras", o->cameras,
                      "Ids of the cameras to open, as numbers and ranges, for example 0-3,7 (default: all cameras)");
  command
      ->add_option("--seconds", o->recording.seconds,
                   "Length of the recording, in seconds. Ctrl-C ends the recording early and keeps the films")
      ->check(cli::Range(0.1, 86400.0));
  command
      ->add_option("--lights", o->guide.lights,
                   "Number of lights that move in front of the cameras. During the recording, the command reports "
                   "image regions that the lights have not reached yet")
      ->check(cli::Range(1, 2));
  command
      ->add_option("--page", o->page,
                   "TCP port of a local web page that shows live images and instructions (0: the system selects a free "
                   "port; default: no page)")
      ->check(cli::Range(0, 65535));
  cli::add_trust_option(*command, o->recording.trusted);
  command->callback([o] { return record_films(*o); });
}

namespace {

struct SnapshotArguments {
  std::string rig, out, cameras;
  SnapshotOptions snapshot;
};

// Images are named after the cameras if the names are unique and valid file names, otherwise after the ids.
std::string file_name(const lf::Rig& rig, const lf::Camera& camera) {
  const auto fits = [](const std::string& name) {
    return !name.empty() && name[0] != '.' && name.find_first_of("/\\%") == std::string::npos;
  };
  std::set<std::string> names;
  bool all = true;
  for (const lf::Camera& one : rig.cameras) all = all && fits(one.name) && names.insert(one.name).second;
  return (all ? camera.name : "camera_" + std::to_string(camera.id)) + ".png";
}

int take_snapshot(SnapshotArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  options.snapshot.cameras = lf::parse_camera_list(*rig, options.cameras);
  std::vector<SnapshotImage> stills;
  {
    // Opening the cameras takes about one second more.
    const TimedProgress progress("opening " + std::to_string(options.snapshot.cameras.size()) + " cameras",
                                 options.snapshot.warm_up + 1);
    stills = take_snapshot(rig, options.rig, options.snapshot);
  }
  lf::AtomicFolderUpdate update(options.out);
  lf::Rig result = *rig;
  const nlohmann::json original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  lf::rebase_paths(result, options.out);
  int missing = 0;
  for (const SnapshotImage& still : stills) {
    lf::Camera& camera = result.cameras[still.camera];
    if (still.rgb.data().empty()) {
      missing++;
      terminal::print("%s: %s: %s\n", camera.label().c_str(), still.problem.c_str(),
                      remedy_for(camera, still.problem).c_str());
      continue;
    }
    camera.image = file_name(*rig, camera);
    lf::save_image(still.rgb, (fs::path(update.staging()) / camera.image).string());
    terminal::print("%s: %s, %+.1f ms\n", camera.label().c_str(), camera.image.c_str(), 1e3 * still.off);
  }
  if (static_cast<size_t>(missing) == stills.size())
    throw lf::Error("no camera delivered an image, so " + options.out + " is unchanged");
  update.commit();
  lf::save_rig(result, (fs::path(options.out) / "rig.json").string(), &original);
  terminal::print("%s/rig.json: %zu stills of one instant, %d cameras are missing\n", options.out.c_str(),
                  stills.size() - static_cast<size_t>(missing), missing);
  return missing > 0 ? 1 : 0;
}

}  // namespace

void add_snapshot_command(cli::App& app) {
  const auto o = std::make_shared<SnapshotArguments>();
  cli::App* command = app.add_subcommand("snapshot",
                                         "Saves one image of each camera, all taken at the same time, and a rig file "
                                         "for these images. The exit status is 1 if an image is missing");
  command->add_option("RIG", o->rig, "Rig file with the sources of the cameras")->required();
  command
      ->add_option("--out", o->out,
                   "Folder that receives a PNG file for each camera, and a rig.json that names "
                   "these files")
      ->required();
  command->add_option("--cameras", o->cameras,
                      "Ids of the cameras to open, as numbers and ranges, for example 0-3,7 (default: all cameras)");
  command
      ->add_option("--warm-up", o->snapshot.warm_up,
                   "Time that the cameras run before the snapshot, in seconds, so that automatic exposure and white "
                   "balance can adjust")
      ->check(cli::Range(0.0, 600.0));
  cli::add_trust_option(*command, o->snapshot.trusted);
  command->callback([o] { return take_snapshot(*o); });
}
