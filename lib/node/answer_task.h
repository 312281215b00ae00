// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "focus/camera_gains.h"
#include "node/answer_form.h"
#include "node/answer_renderer.h"
#include "render/gl/context.h"
#include "rig/mesh.h"
#include "view/view_request.h"

namespace lf {

// What a node has to do for one request, in whichever way it is told. Immutable.
class AnswerTask {
 public:
  // What the node may choose.
  struct Options {
    CodecChoice codec = CodecChoice::kAuto;
    bool in_process = false;                    // the compositor is in this process: see choose_form()
    int strip_pixels = wire::kStripPixels;      // see AnswerForm
    std::shared_ptr<gl::SumDrawer> card;        // see SumRenderer
    std::shared_ptr<gl::SumDrawer> trial_card;  // see add_moments()
    // A compositor in this process makes its pictures in textures of these contexts, so that what is drawn in one of
    // them may stay on the card; 0: it does not.
    gl::ShareGroup group = 0;
  };

  virtual ~AnswerTask() = default;
  // The node's cameras whose images are needed, ascending.
  virtual const std::vector<CameraIndex>& cameras() const = 0;
  // The part of a camera's image that is needed, and the part that is needed for the answer alone, without its moments.
  virtual Rect region(CameraIndex camera) const = 0;
  virtual Rect answer_region(CameraIndex camera) const { return region(camera); }
  // Whether the answer shows what bilinear samples of a camera's image lose: see shows_detail() of render/.
  virtual bool shows_detail(CameraIndex) const { return true; }
  // Whether images may be on the card that draws: pixels that are sent as they are must be here.
  virtual bool takes_card_images() const { return false; }
  // The answer, to be finished; the task and what the images are in must outlive it. Arguments and errors as for
  // begin_answer(); `sources` are of cameras().
  virtual std::unique_ptr<PendingAnswer> begin(const wire::AnswerHeader& header, std::span<const Source> sources,
                                               const Options& options) const = 0;
  // The finished answer.
  RenderedAnswer render(const wire::AnswerHeader& header, std::span<const Source> sources, const Options& options,
                        ByteBuffer memory = {}, const ParallelFor& parallel = serial_for) const;
  // The part of a camera's image that answer and moments need; empty: the camera is only asked how bright it is.
  virtual Rect drawn(CameraIndex camera) const { return region(camera); }
  // How the cameras' brightness is to be matched; null: not at all.
  virtual const GainRequest* gains() const { return nullptr; }
  // What is made for the mean brightness that a request asks for: the unit that goes before the answer, empty if it
  // does not ask, and what is to be kept until that mean comes. `sources`: images that are not divided by `gains`.
  struct Brightness {
    ByteBuffer bytes;
    std::vector<WideLuma::Camera> seen;
  };
  virtual Brightness brightness(const wire::AnswerHeader&, std::span<const Source>, const CameraGains&,
                                const ParallelFor& = serial_for) const {
    return {};
  }
  // What the trials of the request came to.
  struct Tried {
    ByteBuffer unit;  // of moments, that goes before the answer; empty: there are no trials
    Drawing drawing;
    size_t nodes = 0;  // of all trials
    uint64_t ns = 0;   // nanoseconds of wall time
  };
  virtual Tried moments(const wire::AnswerHeader&, std::span<const Source>, const Options&,
                        const ParallelFor& = serial_for) const {
    return {};
  }
};

// The sum of what a node's cameras give for a view.
class SumTask : public AnswerTask {
 public:
  SumTask(const Rig& rig, ViewPlan plan, int quality, std::span<const CameraIndex> own, const ParallelFor& parallel)
      : rig_(rig), job_(std::move(plan), own, parallel), quality_(quality) {}
  const std::vector<CameraIndex>& cameras() const override { return job_.cameras(); }
  Rect region(CameraIndex camera) const override;
  bool takes_card_images() const override { return true; }
  std::unique_ptr<PendingAnswer> begin(const wire::AnswerHeader& header, std::span<const Source> sources,
                                       const Options& options) const override;

 protected:
  const Rig& rig_;
  const RenderJob job_;

 private:
  const int quality_;  // quality of JPEG
};

// The task of a view request: its sum, and the moments and the brightness that it asks for. `own`: indices of the
// node's cameras, ascending. `rig` must outlive the task. `parallel`: plans the view. Throws Error for what does not
// fit the rig.
std::unique_ptr<AnswerTask> make_task(const Rig& rig, const Mesh& mesh, const ViewRequest& request,
                                      std::span<const CameraIndex> own, const ParallelFor& parallel = serial_for);

}  // namespace lf
