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

// The work of a node for one request, and the image regions needed from each camera. The answer is a sum over the
// cameras or, for cameras that can only deliver pixels, unwarped pixels. Immutable.
class RequestPlan {
 public:
  // Plans the sum of a view, with the depth hypotheses and brightness that the request asks for. `own`: indices of the
  // node's cameras, ascending. `rig` must outlive the plan. `parallel`: used for planning. All constructors throw Error
  // if the request does not fit the rig.
  RequestPlan(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // Plans the sum of a command. Uses only the lenses and sizes of `own` from the rig.
  RequestPlan(const Rig& rig, const wire::WarpCommand& command, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // Plans unwarped pixels. Uses only the sizes of `own` from the rig.
  RequestPlan(const Rig& rig, const wire::PixelCommand& command, std::span<const CameraIndex> own);

  // Indices of the node's cameras that must deliver images, ascending.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  bool has(CameraIndex camera) const { return std::ranges::binary_search(cameras_, camera); }
  // True if the answer shows pixels of this camera; false if only its brightness is measured.
  bool draws(CameraIndex camera) const;

  // Returns the needed image region of one of cameras(): for the answer; for the answer and its depth hypotheses (empty
  // if the camera is not drawn); for everything, including brightness.
  Rect answer_region(CameraIndex camera) const;
  Rect drawn_region(CameraIndex camera) const;
  Rect region(CameraIndex camera) const;
  // True if the answer shows detail that bilinear sampling loses: see shows_detail() in render/.
  bool shows_detail(CameraIndex camera) const;

  // Null if the answer has unwarped pixels: answer_region() of each camera.
  const RenderJob* sum() const { return sum_ ? &*sum_ : nullptr; }
  // JPEG quality, 0 to 100.
  int quality() const { return quality_; }
  // The levels of each depth hypothesis, and the job of their view; null without hypotheses. The photo-consistency sums
  // precede the answer.
  const std::vector<std::vector<uint8_t>>& trials() const { return hypotheses_; }
  const RenderJob* hypothesis_job() const { return hypothesis_job_ ? &*hypothesis_job_ : nullptr; }
  // Exposure compensation of the cameras; null: none.
  const GainRequest* gains() const { return gains_.use || gains_.ask ? &gains_ : nullptr; }
  // Measures the cameras' brightness before the answer; null: not requested.
  const WideLuma* wide() const { return wide_ ? &*wide_ : nullptr; }

 private:
  const Rig& rig_;
  const Access access_;
  const int quality_;
  std::vector<CameraIndex> cameras_;
  std::optional<RenderJob> sum_;
  std::vector<Rect> pixels_;  // regions of cameras_, if there is no sum_
  std::optional<RenderJob> hypothesis_job_;
  std::vector<std::vector<uint8_t>> hypotheses_;
  GainRequest gains_;
  std::optional<WideLuma> wide_;
};

// Plans a request of any kind; arguments and errors as in the constructors.
std::unique_ptr<const RequestPlan> plan_request(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                                std::span<const CameraIndex> own,
                                                const ParallelFor& parallel = serial_for);

}  // namespace lf
