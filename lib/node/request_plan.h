// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "focus/exposure_compensation.h"
#include "render/ownership.h"
#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// Everything that a node must compute for one request, before it has any image: which of its cameras contribute, which
// image regions they need, and the weights of their pixels. Usually, the answer is the weighted sum of the node's
// cameras. If the cameras can only deliver pixels (access=pixels), the answer consists of unprocessed image regions
// instead. Immutable.
class RequestPlan {
 public:
  // Plans the sum of a view, and the depth hypotheses and brightness measurements in the request. `own`
  // lists the node's cameras in ascending order. `rig` must outlive the plan. `parallel` distributes the planning. All
  // constructors throw Error if the request does not fit the rig.
  RequestPlan(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // Plans the sum for a command with explicit homographies (WarpCommand). Uses only the lenses and sizes of `own` from
  // the rig.
  RequestPlan(const Rig& rig, const wire::WarpCommand& command, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // Plans an answer of original pixels (PixelCommand). Uses only the sizes of `own` from the rig.
  RequestPlan(const Rig& rig, const wire::PixelCommand& command, std::span<const CameraIndex> own);

  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  bool has(CameraIndex camera) const { return std::ranges::binary_search(cameras_, camera); }
  // Returns true if the answer shows pixels of this camera. Returns false if only the camera's brightness is measured.
  bool draws(CameraIndex camera) const;

  // Return the region of a camera's image that the request needs, in pixels, so that nothing else is decoded.
  // answer_region() is the region for the answer alone. drawn_region() also includes the depth hypotheses, and is empty
  // if the answer does not use the camera. region() also includes the brightness measurement.
  Rect answer_region(CameraIndex camera) const;
  Rect drawn_region(CameraIndex camera) const;
  Rect region(CameraIndex camera) const;
  // True if the answer shows detail that bilinear sampling would lose; see shows_detail() in render/.
  bool shows_detail(CameraIndex camera) const;

  // Returns the work of rendering the sum. Returns null if the answer consists of original pixels, which
  // answer_region() describes.
  const RenderJob* sum() const { return sum_ ? &*sum_ : nullptr; }
  int quality() const { return quality_; }
  // The depth levels of each hypothesis (a guess of the depths) except kMeasured, and the job that evaluates the
  // hypotheses. The job is null without hypotheses. The resulting photo-consistency sums are sent before the answer.
  const std::vector<std::vector<uint8_t>>& hypotheses() const { return hypotheses_; }
  const RenderJob* hypothesis_job() const { return hypothesis_job_ ? &*hypothesis_job_ : nullptr; }
  // Returns the view with the map whose surface the cameras' depth maps show, for the hypothesis kMeasured. Returns
  // null without this hypothesis.
  const View* measured_view() const { return measured_view_ ? &*measured_view_ : nullptr; }
  // Returns the cameras that contribute to the picture, in descending order of their parts of it.
  std::vector<CameraIndex> by_part() const;
  const GainRequest* gains() const { return gains_.use || gains_.ask ? &gains_ : nullptr; }
  const WideLuma* wide() const { return wide_ ? &*wide_ : nullptr; }

 private:
  const Rig& rig_;
  const Access access_;
  const int quality_;
  std::vector<CameraIndex> cameras_;
  std::optional<RenderJob> sum_;
  std::vector<Rect> pixels_;  // regions of cameras_; used if there is no sum_
  std::optional<RenderJob> hypothesis_job_;
  std::vector<std::vector<uint8_t>> hypotheses_;
  std::optional<View> measured_view_;
  GainRequest gains_;
  std::optional<WideLuma> wide_;
};

// Plans a request of any kind. Arguments and errors are as in the constructors.
std::unique_ptr<const RequestPlan> plan_request(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                                std::span<const CameraIndex> own,
                                                const ParallelFor& parallel = serial_for);

}  // namespace lf
