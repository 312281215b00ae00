// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_probe.h"

#include <algorithm>
#include <array>

#include "focus/carry_over.h"

namespace lf {
namespace {

constexpr double kAnyDistance = 1;  // metres: a camera sees itself through any plane in front of it

// Pixel x of the lens is pixel step x + first of `lens`.
Lens every_nth(const Lens& lens, int step, int first) {
  std::array<double, Lens::kMaxParams> params = lens.params();
  const auto focal = static_cast<size_t>(lens_model_num_focal(lens.model()));
  for (size_t i = 0; i < focal; i++) params[i] /= step;
  for (size_t i = focal; i < focal + 2; i++) params[i] = (params[i] - first) / step;
  return {lens.model(), params};
}

}  // namespace

CameraProbe make_probe(const Rig& rig, CameraIndex camera, const View& focused, const CameraSet& without) {
  const Camera& at = rig.cameras[camera];
  const int step = (at.width + kProbeColumns - 1) / kProbeColumns, first = (step - 1) / 2;
  View view{.width = (at.width - first + step - 1) / step,
            .height = (at.height - first + step - 1) / step,
            .lens = every_nth(at.lens, step, first),
            .pose = at.pose,
            .focus = {}};
  CameraProbe probe{.camera = camera, .seen = {}, .predicted = {}};
  view.focus.plane = focal_plane_at(view.pose, kAnyDistance);
  probe.seen.view = view;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (i != camera) probe.seen.out_of_service.push_back(i);
  view.focus = focused.focus;
  if (view.focus.map) view.focus.map = carry_over(focused, view);
  probe.predicted.view = view;
  probe.predicted.out_of_service = without;
  const auto place = std::ranges::lower_bound(probe.predicted.out_of_service, camera);
  if (place == probe.predicted.out_of_service.end() || *place != camera)
    probe.predicted.out_of_service.insert(place, camera);
  for (ViewRequest* request : {&probe.seen, &probe.predicted}) {
    request->probe = true;
    request->rig_hash = rig.hash();
  }
  return probe;
}

}  // namespace lf
