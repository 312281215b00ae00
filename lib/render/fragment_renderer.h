// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>

#include "image/image.h"
#include "image/resampling.h"
#include "render/fragment.h"
#include "render/ownership.h"
#include "rig/rig.h"

namespace lf {

// Renders one camera's fragment of a view: weight x colour where the camera sees the point on the focal surface, lost
// weight where it does not. Implementations are interchangeable and stateless between calls; call from any thread.
class FragmentRenderer {
 public:
  virtual ~FragmentRenderer() = default;

  // `camera` is `rig_camera`'s index in the rig of the plan; `owners.region()` contains plan.camera_rect(camera).
  // In I420 the fragment's rectangle is grown to whole chroma samples (chroma_aligned), so owners must cover that too.
  // `image` has the size of `rig_camera` (else Error). Nothing if the camera has no weight anywhere in the view.
  virtual std::optional<Fragment> render(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                         const Camera& rig_camera, const ImageView& image) const = 0;
};

// Plain C++, one pixel at a time, geometry in double precision: the yardstick for every faster one.
std::unique_ptr<FragmentRenderer> make_scalar_renderer(Resampling resampling = Resampling::kBilinear);

}  // namespace lf
