// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig identify: which camera is where, on a page.
#include <glib-unix.h>
#include <gst/gst.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "cameras/commands.h"
#include "cameras/doctor.h"
#include "cameras/identify_server.h"
#include "cameras/mosaic.h"
#include "cameras/rig_cameras.h"
#include "cameras/temporary_rig.h"
#include "progress.h"
#include "rig/rig_json.h"
#include "rig/swap_devices.h"

namespace {

using namespace lf::cameras;

struct IdentifyArguments {
  std::string rig;
  int port = 8090;
  bool trusted = false;
};

// The cameras stay open as they are, by a copy of the rig, while the rig file says where they belong.
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
                               gst_sample_get_caps(frame.sample), frame.came);
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
    std::printf("%zu cameras at %s\nHold a hand before one, drag it to where it stands; ctrl-C ends it.\n",
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
    size_t settled = 0;
    for (const lf::CameraIndex i : cameras_.cameras())
      settled += cameras_.frames(i) > 0 || !cameras_.problem(i).empty();
    opening_->reach(static_cast<double>(settled) / static_cast<double>(rig_.cameras.size()));
    if (settled < rig_.cameras.size()) return;
    opening_.reset();
    for (const lf::CameraIndex i : cameras_.cameras())
      if (const std::string problem = cameras_.problem(i); !problem.empty())
        std::fprintf(stderr, "warning: %s: %s\n", problem.c_str(), remedy_of(rig_.cameras[i], problem).c_str());
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
    if (!first || !second) return "there is no such camera";
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
    std::printf("%s: the cameras of %s and %s have changed places\n", path_.c_str(),
                name_of(rig_.cameras[*first]).c_str(), name_of(rig_.cameras[*second]).c_str());
    std::fflush(stdout);
    return "";
  }

  std::string path_;
  nlohmann::json text_;
  const lf::Rig rig_;
  TemporaryRig copy_;
  Mosaic mosaic_;
  std::vector<std::atomic<lf::CameraIndex>> place_of_;  // in the rig file, of each camera that is open
  RigCameras cameras_;
  IdentifyServer server_;
  std::optional<Progress> opening_;  // until all cameras have given a frame, or have failed
};

}  // namespace

void add_identify_command(cli::App& app) {
  const auto o = std::make_shared<IdentifyArguments>();
  cli::App* command = app.add_subcommand(
      "identify", "A page with all cameras live: hold a hand before one and it lights up, drag it to where it stands");
  command->add_option("RIG", o->rig, "Rig file; what is dragged is written into it")->required();
  command->add_option("--port", o->port, "Of the page, on this machine alone; 0: any")
      ->capture_default_str()
      ->check(cli::Range(0, 65535));
  cli::add_trust_option(*command, o->trusted);
  command->callback([o] {
    gst_init(nullptr, nullptr);
    Identify(*o).run();
  });
}
