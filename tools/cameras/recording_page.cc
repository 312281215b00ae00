// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/recording_page.h"

#include <nlohmann/json.hpp>

namespace lf::cameras {
namespace {

double now() { return static_cast<double>(g_get_monotonic_time()) / G_USEC_PER_SEC; }

}  // namespace

RecordingPage::RecordingPage(const Rig& rig, const LightWatch* watch, int port)
    : rig_(rig),
      watch_(watch),
      mosaic_(rig),
      server_(port, {.jpeg = [this] { return mosaic_.jpeg(now()); }, .state = [this] { return state(); }, .swap = {}}) {}

void RecordingPage::see(const CameraFrame& frame) {
  mosaic_.see(rig_.cameras[frame.camera].id, gst_sample_get_buffer(frame.sample), gst_sample_get_caps(frame.sample),
              now());
}

void RecordingPage::serve() {
  while (g_main_context_iteration(nullptr, FALSE)) {
  }
}

std::string RecordingPage::state() const {
  nlohmann::json state = mosaic_.state(now(), [](uint32_t) { return std::string(); });
  state["told"] = told_;
  if (!watch_) return state.dump();
  state["places"] = {PicturePlaces::kColumns, PicturePlaces::kRows};
  for (nlohmann::json& camera : state["cameras"]) {
    const CameraIndex index = *rig_.index_of_id(camera["id"].get<uint32_t>());
    const PicturePlaces places = watch_->places(index);
    for (int row = 0; row < PicturePlaces::kRows; row++)
      for (int column = 0; column < PicturePlaces::kColumns; column++)
        camera["came"].push_back(places.has(column, row));
    camera["wanted"] = watch_->wanted(index);
  }
  return state.dump();
}

}  // namespace lf::cameras
