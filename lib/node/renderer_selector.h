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
// Parses "cpu", "gl" or "auto"; returns nullopt for other names.
std::optional<RendererChoice> renderer_choice(const std::string& name);

// Measures whether the CPU or the GPU renders faster, without extra work: both render real answers alternately, until
// each has kRounds measurements. The smallest time per pixel decides.
class RendererTuner {
 public:
  // Number of samples needed from each renderer. The first GPU answer does not count, because it compiles shaders.
  static constexpr int kRounds = 3;

  void begin_again() { *this = {}; }
  bool decided() const { return rounds_[0] >= kRounds && rounds_[1] >= kRounds; }
  // True if the GPU should render the next answer. The result alternates until decided().
  bool gpu_is_next() const;
  // Adds a measurement: the duration of an answer, including transfers to and from the GPU. `drawn` is true if the GPU
  // has rendered the answer, and `pixels` is the work (RenderedAnswer::pixels).
  void add(bool drawn, size_t pixels, uint64_t nanoseconds);
  // Returns the smallest time of the GPU (true) or CPU (false), in nanoseconds per pixel.
  double best(bool drawn) const { return best_[drawn]; }

 private:
  bool warm_ = false;
  int rounds_[2] = {};  // CPU, GPU
  double best_[2] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
};

// Decides when to try the GPU again after a refusal. The GPU cannot render some views, for example if its memory is too
// small, and each attempt costs time. After kMaxRefusals refusals in a row, the GPU is not used for the time kRest.
class Backoff {
 public:
  static constexpr int kMaxRefusals = 3;
  static constexpr uint64_t kRest = 10'000'000'000;  // duration of a pause, nanoseconds

  // Records an attempt. `now` is nanoseconds of a monotonic clock.
  void add(bool refused, uint64_t now);
  bool is_exhausted(uint64_t now) const { return now < retry_time_; }

 private:
  int refusals_ = 0;
  uint64_t retry_time_ = 0;
};

// Implements the property `renderer`: decides for each answer whether the GPU or the CPU renders, and owns the GPU
// renderer. The first answer opens the GPU renderer. If this fails, or if the OpenGL context is lost later, the CPU
// renders all further answers. If the GPU only refuses a task, it is used again after a pause (see Backoff).
// Thread-safe.
class RendererSelector {
 public:
  using Open = std::function<std::unique_ptr<gl::GlesRenderer>(gl::Context::Drivers, std::string& why)>;
  using Clock = std::function<uint64_t()>;
  RendererSelector() : RendererSelector(gl::GlesRenderer::create) {}
  // for tests: replaces gl::GlesRenderer::create() and now_ns()
  explicit RendererSelector(Open open, Clock now = now_ns);

  // Returns the GPU renderer for the next answer, or null if the CPU must render. If the GPU is missing, lost, or
  // cannot render the view, `news` is set to a message for the user, once for each of these problems. A missing GPU is
  // no problem for kAuto.
  std::shared_ptr<gl::GlesRenderer> open(RendererChoice choice, std::string& news);
  // Returns true if the renderer can render several views in one pass, so that answering requests together saves time.
  bool can_batch(RendererChoice choice) const;
  // Call this after each answer that open() was called for, so that the durations can be compared. `before` is the time
  // in nanoseconds for getting the images into system or GPU memory, because it depends on the renderer, too.
  void rendered(RendererChoice choice, const RenderedAnswer& answer, uint64_t before = 0);
  // Returns the GPU renderer for the depth hypotheses of the answer that open() was called for, or null to use the CPU.
  // With kAuto, hypotheses are measured separately, because they involve less rendering per uploaded image.
  std::shared_ptr<gl::GlesRenderer> open_for_depth(RendererChoice choice);
  // Moves the renderer to an OpenGL context in the given share group, so that a compositor in this process can use its
  // textures directly. `open` creates the context. Returns true if the renderer is then in this group.
  //
  // The renderer only moves if the GPU renders answers. If `early` is true, the renderer also moves before kAuto has
  // decided; the new context may be faster, so the measurement restarts. Each group is tried only once, because viewers
  // in several groups would otherwise cause constant moves. If opening fails, or the context belongs to another GPU
  // (which may be slower), the old context stays and `why` is set.
  using OpenIn = std::function<std::unique_ptr<gl::GlesRenderer>(std::string& why)>;
  bool move_to(RendererChoice choice, gl::ShareGroup group, bool early, const OpenIn& open, std::string& why);
  // Call this after the depth hypotheses that open_for_depth() was called for, so that the durations can be compared.
  void tried(RendererChoice choice, const RenderedConsistency& consistency);
  // Releases a context that move_to() has opened, because the compositor's OpenGL context may be destroyed now. The
  // selector opens a new context when it is needed.
  void leave();
  // Describes the active renderer and the reason for the choice, for example "cpu", "gl: NVIDIA ..." or "auto: cpu,
  // there is no other: device 0: computes on the CPU". ", photo-consistency, too" at the end means that the GPU also
  // computes depth hypotheses.
  std::string explain(RendererChoice choice) const;

 private:
  bool is_open(RendererChoice choice, std::string& news);
  bool draws(RendererChoice choice) const { return choice == RendererChoice::kGl || tuner_.gpu_is_next(); }
  bool is_in_race() const { return renderer_ && !renderer_->is_lost() && !renderer_->is_software(); }
  std::string explain_answers(RendererChoice choice) const;

  const Open open_;
  const Clock now_;
  mutable std::mutex mutex_;
  std::shared_ptr<gl::GlesRenderer> renderer_;
  std::set<gl::ShareGroup> groups_;  // groups that move_to() has tried, including failures
  std::string left_;
  std::optional<gl::Context::Drivers> tried_;  // drivers of the latest attempt to open a renderer
  std::string why_;
  bool loss_reported_ = false;
  RendererTuner tuner_;
  Backoff backoff_;
  RendererTuner depth_tuner_;
  Backoff depth_backoff_;
  bool draws_consistency_ = false;
  std::string failure_reason_;              // why the latest answer was not rendered by the GPU
  std::string refusal_, reported_refusal_;  // latest refusal, and the refusal that was last reported to the user
};

}  // namespace lf
