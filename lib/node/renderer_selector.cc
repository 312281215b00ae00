// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/renderer_selector.h"

#include <algorithm>
#include <utility>

#include "base/text.h"

namespace lf {
namespace {

std::string per_pixel(double nanoseconds) { return format_text("%.2f", nanoseconds); }

}  // namespace

std::optional<RendererChoice> renderer_choice(const std::string& name) {
  if (name == "cpu") return RendererChoice::kCpu;
  if (name == "gl") return RendererChoice::kGl;
  if (name == "auto") return RendererChoice::kAuto;
  return std::nullopt;
}

bool RendererTuner::gpu_is_next() const {
  if (decided()) return best(true) < best(false);
  return rounds_[true] <= rounds_[false];
}

void RendererTuner::add(bool drawn, size_t pixels, uint64_t nanoseconds) {
  if (decided() || pixels == 0) return;
  if (drawn && !std::exchange(warm_, true)) return;
  rounds_[drawn]++;
  best_[drawn] = std::min(best_[drawn], static_cast<double>(nanoseconds) / static_cast<double>(pixels));
}

void Backoff::add(bool refused, uint64_t now) {
  refusals_ = refused ? refusals_ + 1 : 0;
  retry_time_ = refusals_ < kMaxRefusals ? 0 : now + kRest;
}

RendererSelector::RendererSelector(Open open, Clock now) : open_(std::move(open)), now_(std::move(now)) {}

bool RendererSelector::is_open(RendererChoice choice, std::string& news) {
  const auto drivers = choice == RendererChoice::kAuto ? gl::Context::Drivers::kHardware : gl::Context::Drivers::kAny;
  if (!renderer_ && tried_ != drivers && tried_ != gl::Context::Drivers::kAny) {
    tried_ = drivers;
    renderer_ = open_(drivers, why_);
    if (!renderer_ && choice == RendererChoice::kGl)
      news = "OpenGL ES 3.1 is not available, so the CPU renders: " + why_ +
             " (check the EGL driver of the GPU and the access rights of /dev/dri/renderD*)";
  }
  if (!renderer_) return false;
  if (!renderer_->is_lost()) return choice == RendererChoice::kGl || !renderer_->is_software();
  if (!std::exchange(loss_reported_, true))
    news = renderer_->device() + " no longer responds to this process, so the CPU renders from now on";
  return false;
}

std::shared_ptr<gl::GlesRenderer> RendererSelector::open(RendererChoice choice, std::string& news) {
  if (choice == RendererChoice::kCpu) return nullptr;
  const std::lock_guard lock(mutex_);
  if (!is_open(choice, news)) return nullptr;
  if (backoff_.is_exhausted(now_())) {
    if (choice == RendererChoice::kGl && std::exchange(reported_refusal_, refusal_) != refusal_)
      news = renderer_->device() + " cannot render this view, so the CPU does: " + refusal_;
    return nullptr;
  }
  return draws(choice) ? renderer_ : nullptr;
}

bool RendererSelector::can_batch(RendererChoice choice) const {
  if (choice == RendererChoice::kCpu) return false;
  const std::lock_guard lock(mutex_);
  const bool is_decided = choice == RendererChoice::kGl || tuner_.decided();
  return renderer_ && !renderer_->is_lost() && is_decided && draws(choice) && !backoff_.is_exhausted(now_());
}

void RendererSelector::rendered(RendererChoice choice, const RenderedAnswer& answer, uint64_t before) {
  if (choice == RendererChoice::kCpu || answer.pixels == 0) return;
  const GpuStatus& drawing = answer.drawing;
  const std::lock_guard lock(mutex_);
  const uint64_t now = now_();
  if (drawing.drawn || drawing.refused) backoff_.add(drawing.refused, now);
  if (drawing.refused) refusal_ = drawing.why_not;
  const bool is_left_alone = !drawing.drawn && backoff_.is_exhausted(now);
  failure_reason_ = drawing.why_not.empty() && is_left_alone ? refusal_ : drawing.why_not;
  // An answer that the GPU could not render does not show which renderer is faster.
  if (choice != RendererChoice::kAuto || !drawing.why_not.empty()) return;
  if (is_in_race()) tuner_.add(drawing.drawn, answer.pixels, before + answer.render_ns);
}

bool RendererSelector::move_to(RendererChoice choice, gl::ShareGroup group, bool early, const OpenIn& open,
                               std::string& why) {
  const std::lock_guard lock(mutex_);
  const bool is_decided = choice == RendererChoice::kGl || tuner_.decided();
  if (choice == RendererChoice::kCpu || !renderer_ || renderer_->is_lost()) return false;
  if (choice == RendererChoice::kAuto && renderer_->is_software()) return false;
  if (!draws(choice) || !(is_decided || early)) return false;
  if (!groups_.insert(group).second) return renderer_->group() == group;
  std::shared_ptr<gl::GlesRenderer> drawer = open(why);
  if (!drawer) return false;
  if (drawer->device() != renderer_->device()) {
    why = drawer->device() + " is not the same GPU as " + renderer_->device();
    return false;
  }
  renderer_ = std::move(drawer);
  if (!tuner_.decided()) tuner_.begin_again();
  if (!depth_tuner_.decided()) depth_tuner_.begin_again();
  return true;
}

void RendererSelector::leave() {
  const std::lock_guard lock(mutex_);
  groups_.clear();
  if (!renderer_ || renderer_->group() == 0) return;
  left_ = renderer_->device();
  renderer_.reset();
  tried_.reset();
  loss_reported_ = false;
}

std::shared_ptr<gl::GlesRenderer> RendererSelector::open_for_depth(RendererChoice choice) {
  if (choice == RendererChoice::kCpu) return nullptr;
  const std::lock_guard lock(mutex_);
  if (!renderer_ || renderer_->is_lost() || depth_backoff_.is_exhausted(now_())) return nullptr;
  const bool is_wanted = choice == RendererChoice::kGl || (!renderer_->is_software() && depth_tuner_.gpu_is_next());
  return is_wanted ? renderer_ : nullptr;
}

void RendererSelector::tried(RendererChoice choice, const RenderedConsistency& consistency) {
  if (choice == RendererChoice::kCpu || consistency.nodes == 0) return;
  const GpuStatus& drawing = consistency.drawing;
  const std::lock_guard lock(mutex_);
  draws_consistency_ = drawing.drawn;
  if (drawing.drawn || drawing.refused) depth_backoff_.add(drawing.refused, now_());
  if (choice == RendererChoice::kAuto && !drawing.refused && is_in_race())
    depth_tuner_.add(drawing.drawn, consistency.nodes, consistency.ns);
}

std::string RendererSelector::explain(RendererChoice choice) const {
  if (choice == RendererChoice::kCpu) return "cpu";
  const std::lock_guard lock(mutex_);
  return explain_answers(choice) + (draws_consistency_ ? ", photo-consistency, too" : "");
}

std::string RendererSelector::explain_answers(RendererChoice choice) const {
  const bool is_auto = choice == RendererChoice::kAuto;
  const std::string name = is_auto ? "auto: " : "";
  const std::string device = renderer_ ? renderer_->device() : left_;
  if (!renderer_ && (tried_ || device.empty()))
    return tried_ ? name + "cpu, there is no other: " + why_ : name + "nothing has been rendered yet";
  if (renderer_ && renderer_->is_lost()) return name + "cpu, " + device + " is lost";
  if (renderer_ && is_auto && renderer_->is_software()) return name + "cpu, " + device + " is the CPU, too";
  if (!failure_reason_.empty()) return name + "cpu, " + device + " cannot draw this view: " + failure_reason_;
  if (!is_auto) return "gl: " + device;
  if (!tuner_.decided()) return name + "cpu and " + device + " by turns, to see which is faster";
  return name + (tuner_.gpu_is_next() ? "gl" : "cpu") + ", " + device + " takes " + per_pixel(tuner_.best(true)) +
         " ns a pixel, the CPU " + per_pixel(tuner_.best(false));
}

}  // namespace lf
