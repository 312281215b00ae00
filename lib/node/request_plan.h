// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "focus/camera_gains.h"
#include "render/ownership.h"
#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// What a node has to do for one request, and what that needs of each of its cameras. The answer is the sum of what the
// cameras give for a view, or, to cameras that only have pixels to give, pixels as they are. Immutable.
class RequestPlan {
 public:
  // The sum of a view, with the trials and the brightness that the request asks for. `own`: indices of the node's
  // cameras, ascending. `rig` must outlive the plan. `parallel`: plans the view. Throws Error for what does not fit the
  // rig, as do the others.
  RequestPlan(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // The sum that a command asks for. Of the rig only the lenses and sizes of `own` are looked at.
  RequestPlan(const Rig& rig, const wire::WarpCommand& command, std::span<const CameraIndex> own,
              const ParallelFor& parallel = serial_for);
  // The pixels that a command asks for. Of the rig only the sizes of `own` are looked at.
  RequestPlan(const Rig& rig, const wire::PixelCommand& command, std::span<const CameraIndex> own);

  // The node's cameras whose images are needed, ascending.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  bool has(CameraIndex camera) const { return std::ranges::binary_search(cameras_, camera); }
  // Whether the answer shows anything of one of cameras(); the others are only asked how bright they are.
  bool draws(CameraIndex camera) const;

  // The part of an image that is needed, by one of cameras(): for the answer itself; for the answer and its trials,
  // empty where the camera is not drawn; and for all, with its brightness.
  Rect answer_region(CameraIndex camera) const;
  Rect drawn_region(CameraIndex camera) const;
  Rect region(CameraIndex camera) const;
  // Whether the answer shows what bilinear samples of a camera's image lose: see shows_detail() of render/.
  bool shows_detail(CameraIndex camera) const;

  // The sum that is the answer; null: it is pixels as they are, answer_region() of each camera.
  const RenderJob* sum() const { return sum_ ? &*sum_ : nullptr; }
  // The quality of JPEG that is asked for, 0 to 100.
  int quality() const { return quality_; }
  // The levels of each trial of a focal surface, and the view that they are tried in: their moments go before the
  // answer. Null without trials.
  const std::vector<std::vector<uint8_t>>& trials() const { return trials_; }
  const RenderJob* trial_job() const { return trial_job_ ? &*trial_job_ : nullptr; }
  // How the cameras' brightness is to be matched; null: not at all.
  const GainRequest* gains() const { return gains_.use || gains_.ask ? &gains_ : nullptr; }
  // What sees how bright cameras are, which goes before the answer; null: that is not asked for.
  const WideLuma* wide() const { return wide_ ? &*wide_ : nullptr; }

 private:
  const Rig& rig_;
  const Access access_;  // that the request is for
  const int quality_;
  std::vector<CameraIndex> cameras_;
  std::optional<RenderJob> sum_;
  std::vector<Rect> pixels_;  // regions of cameras_; without sum_
  std::optional<RenderJob> trial_job_;
  std::vector<std::vector<uint8_t>> trials_;
  GainRequest gains_;
  std::optional<WideLuma> wide_;
};

// The plan of a request of any kind; arguments and errors are those of its kind.
std::unique_ptr<const RequestPlan> plan_request(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                                std::span<const CameraIndex> own,
                                                const ParallelFor& parallel = serial_for);

}  // namespace lf
