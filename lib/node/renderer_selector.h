// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include <lightfield/renderer.h>

#include "base/schedule.h"
#include "node/answer_encoder.h"
#include "render/gl/gles_renderer.h"

namespace lf {

using lightfield::RendererChoice;
// Parses "cpu", "gl" or "auto".
std::optional<RendererChoice> renderer_choice(const std::string& name);

// Finds out whether the CPU or the GPU is faster: lets them take turns at regular work until both have enough samples.
class RendererTuner {
 public:
  // Samples needed per renderer. The first GPU answer does not count, because it compiles shaders.
  static constexpr int kRounds = 3;

  void begin_again() { *this = {}; }
  bool decided() const { return rounds_[0] >= kRounds && rounds_[1] >= kRounds; }
  // True if the GPU should draw the next answer; alternates until decided().
  bool gpu_is_next() const;
  // Adds the duration of an answer, including transfers to and from the GPU. `pixels`: pixels of the sum.
  void add(bool drawn, size_t pixels, uint64_t nanoseconds);
  // Returns the shortest duration in nanoseconds per pixel; infinity: no sample.
  double best(bool drawn) const { return best_[drawn]; }

 private:
  bool warm_ = false;
  int rounds_[2] = {};  // CPU, GPU
  double best_[2] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
};

// Pauses attempts after repeated refusals, because an attempt takes time.
class Backoff {
 public:
  static constexpr int kMaxRefusals = 3;
  static constexpr uint64_t kRest = 10'000'000'000;  // pause, nanoseconds

  // `now`: monotonic clock, nanoseconds.
  void add(bool refused, uint64_t now);
  bool is_exhausted(uint64_t now) const { return now < rests_until_; }

 private:
  int refusals_ = 0;
  uint64_t rests_until_ = 0;
};

// The GPU renderer of a node. It is opened when there is something to draw, because that takes tens to hundreds of
// milliseconds. After a failure to open or a lost context it is not used again. After repeated refusals it is paused.
// Thread-safe.
class RendererSelector {
 public:
  using Open = std::function<std::unique_ptr<gl::GlesRenderer>(gl::Context::Drivers, std::string& why)>;
  using Clock = std::function<uint64_t()>;
  RendererSelector() : RendererSelector(gl::GlesRenderer::create) {}
  explicit RendererSelector(Open open, Clock now = now_ns);  // replaces gl::GlesRenderer::create() and now_ns()

  // Returns the renderer for the next answer; null: use the CPU. Sets `news` once to a message for the user: why no GPU
  // is available (any more), or why it does not draw. kAuto does not report missing GPUs.
  std::shared_ptr<gl::GlesRenderer> open(RendererChoice choice, std::string& news);
  // True if the renderer draws several views in one pass, so that batching saves time.
  bool can_batch(RendererChoice choice) const;
  // Reports the duration of that answer. `before`: nanoseconds spent on getting its images, as far as this depends on
  // the renderer.
  void rendered(RendererChoice choice, const RenderedAnswer& answer, uint64_t before = 0);
  // Returns the renderer for the depth hypotheses of the answer that open() was called for; null: use the CPU. kAuto
  // decides separately for hypotheses, because hypotheses draw less per uploaded image.
  std::shared_ptr<gl::GlesRenderer> open_for_depth(RendererChoice choice);
  // Moves the renderer to a context of this share group, created by `open`, if the GPU draws answers. `early`: move
  // even before kAuto has decided; the new context may be faster, so the measurement restarts. Tries each group only
  // once; viewers with pictures in several groups would otherwise cause constant moves. On failure, or if the context
  // belongs to another GPU (possibly slower), keeps the old context and sets `why`. Returns true if the renderer is in
  // this group now.
  using OpenIn = std::function<std::unique_ptr<gl::GlesRenderer>(std::string& why)>;
  bool move_to(RendererChoice choice, gl::ShareGroup group, bool early, const OpenIn& open, std::string& why);
  void tried(RendererChoice choice, const RenderedConsistency& trials);
  // Releases a context that move_to() opened, even if it was lost. The selector opens a context again when needed.
  void leave();
  // Describes the active renderer and the reason: "cpu", "gl: NVIDIA ...", "auto: cpu, there is no other: device 0:
  // computes on the CPU"; ", trials, too" if the GPU also draws depth hypotheses.
  std::string explain(RendererChoice choice) const;

 private:
  bool is_open(RendererChoice choice, std::string& news);
  bool draws(RendererChoice choice) const { return choice == RendererChoice::kGl || tuner_.gpu_is_next(); }
  bool is_in_race() const { return drawer_ && !drawer_->is_lost() && !drawer_->is_software(); }
  std::string explain_answers(RendererChoice choice) const;

  const Open open_;
  const Clock now_;
  mutable std::mutex mutex_;
  std::shared_ptr<gl::GlesRenderer> drawer_;
  std::set<gl::ShareGroup> groups_;            // includes failed moves
  std::string left_;                           // device before leave()
  std::optional<gl::Context::Drivers> tried_;  // latest attempt to open
  std::string why_;                            // reason of the failure
  bool loss_reported_ = false;
  RendererTuner tuner_;
  Backoff backoff_;
  RendererTuner depth_tuner_;
  Backoff depth_backoff_;
  bool draws_consistency_ = false;
  std::string why_not_;                     // reason why the latest answer was not drawn
  std::string refusal_, reported_refusal_;  // latest refusal, and the refusal last reported to the user
};

}  // namespace lf
