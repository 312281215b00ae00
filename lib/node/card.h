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
#include "render/gl/sum_drawer.h"

namespace lf {

using lightfield::RendererChoice;
// "cpu", "gl", "auto".
std::optional<RendererChoice> renderer_choice(const std::string& name);

// Which of two is faster, found out on what they have to do anyway: by turns, until both have been seen often enough.
class RendererRace {
 public:
  // Answers of each that count. The card's first one does not: its programs are compiled then.
  static constexpr int kRounds = 3;

  // What has been seen so far tells nothing any more.
  void begin_again() { *this = {}; }
  bool decided() const { return rounds_[0] >= kRounds && rounds_[1] >= kRounds; }
  // Whether the card is to draw the next one; until it is decided, by turns.
  bool card_is_next() const;
  // What one came to, with all that it took to get images to a card and sums back. `pixels`: of the sum.
  void add(bool drawn, size_t pixels, uint64_t nanoseconds);
  // The best, nanoseconds a pixel; infinity: not seen yet.
  double best(bool drawn) const { return best_[drawn]; }

 private:
  bool warm_ = false;
  int rounds_[2] = {};  // of the CPU, of the card
  double best_[2] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
};

// With what refuses again and again: it is left alone for a while, as asking takes time, too.
class Patience {
 public:
  static constexpr int kRefusals = 3;                // in a row
  static constexpr uint64_t kRest = 10'000'000'000;  // nanoseconds

  // What came of asking at `now`, nanoseconds of any clock that never jumps.
  void add(bool refused, uint64_t now);
  bool is_at_end(uint64_t now) const { return now < rests_until_; }

 private:
  int refusals_ = 0;
  uint64_t rests_until_ = 0;
};

// The graphics card of a node that is to use one: opened when there is something to draw, as that takes tens to
// hundreds of milliseconds; left alone for good once it can't be opened or is lost, and for a while where it refuses
// what it is asked for. Thread-safe.
class Card {
 public:
  using Open = std::function<std::unique_ptr<gl::SumDrawer>(gl::Context::Drivers, std::string& why)>;
  using Clock = std::function<uint64_t()>;
  Card() : Card(gl::SumDrawer::create) {}
  explicit Card(Open open, Clock now = now_ns);  // in place of gl::SumDrawer::create(), and of now_ns()

  // What is to draw the next answer; null: the CPU has to render it. `news`: what the user should know, once: why there
  // is no card (any more), or why it does not draw. Nobody needs to know that of kAuto.
  std::shared_ptr<gl::SumDrawer> open(RendererChoice choice, std::string& news);
  // Whether it draws several views in a pass, so that answers are quicker together.
  bool draws_several(RendererChoice choice) const;
  // That answer, to decide by. `before`: what it took to get at its images, as far as that depends on who draws,
  // nanoseconds.
  void rendered(RendererChoice choice, const RenderedAnswer& answer, uint64_t before = 0);
  // What is to draw the trials of the answer that open() was called for; null: the CPU has to. kAuto decides apart from
  // answers: there is less to draw for the images that have to go to the card.
  std::shared_ptr<gl::SumDrawer> open_for_trials(RendererChoice choice);
  // From now on what draws is in a context of this group, which `open` makes, where the card draws answers; `early`:
  // even if it has yet to be seen whether it should, as it may be faster there, which is then seen anew. That is done
  // once for a group, as viewers whose pictures are in several would have it done all the time. Where it fails, or is
  // another card's, which may be slower, all stays as it is, with the reason in `why`. Returns whether what draws is in
  // that group now.
  using OpenIn = std::function<std::unique_ptr<gl::SumDrawer>(std::string& why)>;
  bool move_to(RendererChoice choice, gl::ShareGroup group, bool early, const OpenIn& open, std::string& why);
  void tried(RendererChoice choice, const RenderedTrials& trials);
  // Lets go of the context of somebody else's that move_to() has opened, even if it was lost; one of its own is opened
  // again when needed.
  void leave();
  // What renders, and why: "cpu", "gl: NVIDIA ...", "auto: cpu, there is no other: device 0: computes on the CPU";
  // ", trials, too" where a card draws these.
  std::string explain(RendererChoice choice) const;

 private:
  bool is_open(RendererChoice choice, std::string& news);
  bool draws(RendererChoice choice) const { return choice == RendererChoice::kGl || race_.card_is_next(); }
  bool is_in_race() const { return drawer_ && !drawer_->is_lost() && !drawer_->is_software(); }
  std::string explain_answers(RendererChoice choice) const;

  const Open open_;
  const Clock now_;
  mutable std::mutex mutex_;
  std::shared_ptr<gl::SumDrawer> drawer_;
  std::set<gl::ShareGroup> groups_;            // that it has moved to, or tried to
  std::string left_;                           // what drew before leave()
  std::optional<gl::Context::Drivers> tried_;  // the last ones
  std::string why_;                            // there is no card for these
  bool told_ = false;
  RendererRace race_;
  Patience patience_;
  RendererRace trial_race_;
  Patience trial_patience_;
  bool draws_trials_ = false;           // drew the latest ones
  std::string why_not_;                 // the latest answer was not drawn
  std::string refusal_, told_refusal_;  // the latest reason to refuse one, and what of it the user knows
};

}  // namespace lf
