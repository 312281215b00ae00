// SPDX-License-Identifier: LGPL-2.1-or-later
// View requests and commands: what is taken can be written again, and is the same; and of it a view can be planned.
#include "base/error.h"
#include "focus/trial_levels.h"
#include "fuzz/fuzz.h"
#include "render/owner_runs.h"
#include "scene/scene.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"

LF_FUZZ_TARGET(request)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  const std::optional<wire::AnyRequest> request = wire::decode_any_request({data, size}, &reason);
  fuzz::require(request || !reason.empty());
  if (!request) return 0;
  std::vector<uint8_t> again;
  if (const auto* view = std::get_if<ViewRequest>(&*request)) {
    again = wire::encode_request(*view);
    for (const Trial& trial : view->trials)
      if (view->view.width <= 256 && view->view.height <= 256) trial_levels(view->view, trial);
    if (view->view.width <= 64 && view->view.height <= 64) {
      static const Rig rig = scene_rig(2, 2, 64, 48);
      static const Mesh mesh = build_mesh(rig);
      OwnerRuns(ViewPlan(rig, mesh, view->view), {0, 0, view->view.width, view->view.height});
    }
  }
  if (const auto* pixels = std::get_if<wire::PixelCommand>(&*request)) again = wire::encode_command(*pixels);
  if (const auto* warp = std::get_if<wire::WarpCommand>(&*request)) {
    again = wire::encode_command(*warp);
    try {
      if (warp->warp.width <= 64 && warp->warp.height <= 64)
        OwnerRuns(ViewPlan(warp->warp, 1000), {0, 0, warp->warp.width, warp->warp.height});
    } catch (const Error&) {
    }
  }
  fuzz::require(wire::decode_any_request(again) == request);
  return 0;
}
