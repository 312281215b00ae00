// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_task.h"

#include <algorithm>
#include <iterator>

#include "base/schedule.h"
#include "focus/trial_renderer.h"
#include "render/camera_projection.h"
#include "render/gl/sum_drawer.h"
#include "wire/moments_codec.h"

namespace lf {
namespace {

class ViewTask : public SumTask {
 public:
  ViewTask(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own,
           const ParallelFor& parallel)
      : SumTask(rig, ViewPlan(rig, mesh, shown_view(request), parallel), request.quality, own, parallel),
        gains_(request.gains) {
    if (gains_.ask) compare(rig, mesh, request, own);
    if (request.trials.empty()) return;
    trial_job_.emplace(rig, mesh, trial_view(request.view), own, parallel);
    for (const Trial& trial : request.trials) trials_.push_back(trial_levels(request.view, trial));
  }

  const std::vector<CameraIndex>& cameras() const override { return wide_ ? cameras_ : job_.cameras(); }
  Rect region(CameraIndex camera) const override {
    if (wide_ && std::ranges::binary_search(wide_->cameras(), camera))
      return {0, 0, rig_.cameras[camera].width, rig_.cameras[camera].height};
    return drawn(camera);
  }
  Rect drawn(CameraIndex camera) const override {
    if (!is_in_view(camera)) return {};
    const Rect colour = answer_region(camera);
    if (trials_.empty() || trial_job_->plan().camera_rect(camera).empty()) return colour;
    return unite(colour, trial_pixels(trial_job_->plan(), camera, rig_.cameras[camera], trials_));
  }
  Rect answer_region(CameraIndex camera) const override { return SumTask::region(camera); }
  bool shows_detail(CameraIndex camera) const override {
    return lf::shows_detail(job_.plan().view(), rig_.cameras[camera]);
  }
  std::unique_ptr<PendingAnswer> begin(const wire::AnswerHeader& header, std::span<const Source> sources,
                                       const Options& options) const override {
    if (!wide_) return SumTask::begin(header, sources, options);
    std::vector<Source> in_view;
    std::ranges::copy_if(sources, std::back_inserter(in_view),
                         [this](const Source& source) { return is_in_view(source.camera); });
    return SumTask::begin(header, in_view, options);
  }
  Tried moments(const wire::AnswerHeader& header, std::span<const Source> sources, const Options& options,
                const ParallelFor& parallel) const override {
    if (trials_.empty()) return {};
    const uint64_t begun = now_ns();
    const View& view = trial_job_->plan().view();
    const wire::MomentsHeader about{header.view_id, header.sequence, header.rig_hash, header.node, {}};
    std::vector<Moments> sums(trials_.size());
    for (Moments& sum : sums) sum.reset(view.width, view.height);
    Tried tried{.nodes = trials_.size() * view.width * view.height};
    tried.drawing = add_moments(*trial_job_, sources, trials_, sums, parallel, options.trial_card.get());
    tried.ns = now_ns() - begun;
    tried.unit = wire::encode_moments(about, sums, !options.in_process);
    return tried;
  }

  const GainRequest* gains() const override { return gains_.use || gains_.ask ? &gains_ : nullptr; }
  Brightness brightness(const wire::AnswerHeader& header, std::span<const Source> sources, const CameraGains& gains,
                        const ParallelFor& parallel) const override {
    if (!wide_) return {};
    WideLuma::Seen seen = wide_->see(sources, gains, parallel);
    return {wire::encode_moments({header.view_id, header.sequence, header.rig_hash, header.node, seen.gains},
                                 {&seen.moments, 1}),
            std::move(seen.cameras)};
  }

 private:
  bool is_in_view(CameraIndex camera) const { return std::ranges::binary_search(job_.cameras(), camera); }
  void compare(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own) {
    std::vector<CameraIndex> in_service;
    std::ranges::set_difference(own, request.out_of_service, std::back_inserter(in_service));
    wide_.emplace(rig, mesh, mean_view(request.view), in_service);
    std::ranges::set_union(job_.cameras(), wide_->cameras(), std::back_inserter(cameras_));
  }

  const GainRequest gains_;
  std::optional<WideLuma> wide_;              // that it asks for
  std::vector<CameraIndex> cameras_;          // of both
  std::optional<RenderJob> trial_job_;        // with trials
  std::vector<std::vector<uint8_t>> trials_;  // their levels
};

}  // namespace

Rect SumTask::region(CameraIndex camera) const { return needed_pixels(job_.plan(), camera, rig_.cameras[camera]); }

RenderedAnswer AnswerTask::render(const wire::AnswerHeader& header, std::span<const Source> sources,
                                  const Options& options, ByteBuffer memory, const ParallelFor& parallel) const {
  const std::unique_ptr<PendingAnswer> answer = begin(header, sources, options);
  PendingAnswer* const only = answer.get();
  return std::move(finish_answers(
                       {&only, 1}, options.card.get(), [&] { return std::move(memory); }, parallel)
                       .front());
}

std::unique_ptr<PendingAnswer> SumTask::begin(const wire::AnswerHeader& header, std::span<const Source> sources,
                                              const Options& options) const {
  AnswerForm form = choose_form(job_.plan().view(), options.codec, options.in_process, quality_);
  form.strip_pixels = options.strip_pixels;
  form.may_stay = options.in_process && options.card && options.group != 0 && options.card->group() == options.group;
  return begin_answer(header, job_, {sources.begin(), sources.end()}, form);
}

std::unique_ptr<AnswerTask> make_task(const Rig& rig, const Mesh& mesh, const ViewRequest& request,
                                      std::span<const CameraIndex> own, const ParallelFor& parallel) {
  return std::make_unique<ViewTask>(rig, mesh, request, own, parallel);
}

}  // namespace lf
