// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "focus/camera_gains.h"
#include "focus/focus_control.h"
#include "rig/mesh.h"
#include "rig/still_images.h"

namespace lf {

// The focal surface that the next request of a view is focused on, and what is tried for it.
struct FoundFocus {
  uint32_t sequence = 0;  // the number of the request that it was found from
  FocusControl::Plan plan;
  GainRequest gains;  // what the next request says of cameras' brightness
};

// Gives a request the surface of a plan, which was made for another request of its view, as its own view has it. The
// request has no map, and has the trials and gains already that it is to have.
void apply_plan(const FocusControl::Plan& plan, ViewRequest& request);

// Gives a request for another view of a set the surface of the one that leads, as its own view has it, and the same
// gains. Nothing is tried with it.
void apply_leader(const ViewRequest& leader, ViewRequest& beside);

// What the next request of a view says of its cameras' brightness. `use`: whether gains are used; `has_trials`: whether
// that request has trials. `brightness`, `gains`: what came of the mean that `sequence`, the request before, asked for;
// of no size: nothing.
GainRequest next_gains(MeanTurns& turns, bool use, bool has_trials, const Moments& brightness, const GainSum& gains,
                       uint32_t sequence);

// The focal surface of one view, and its cameras' brightness, from request to request, for those whose requests wait
// for what came of the one before. A plain value without locks.
class ViewFocus {
 public:
  // `match_gains`: whether cameras' brightness is matched where several make the picture.
  explicit ViewFocus(const FocusControl::Settings& settings = {}, bool match_gains = false)
      : settings_(settings), match_gains_(match_gains), control_(settings) {}

  const FocusControl::Settings& settings() const { return settings_; }
  bool matches_gains() const { return match_gains_; }
  // Gives a request, whose view has no map, the surface as its view has it, and what is to be tried with it.
  void apply(ViewRequest& request);
  // What came of a request that apply() has made ready: moments of its trials, in their order, and of the brightness,
  // empty where nothing came; and whether its picture was complete.
  struct Answers {
    std::vector<Moments> moments;
    Moments brightness;  // of no size where nothing came
    GainSum gains;
    bool complete = true;
  };
  void take(const ViewRequest& request, const Answers& answers, const FocusArray& array);

 private:
  FocusControl::Settings settings_;
  bool match_gains_;
  FocusControl control_;
  MeanTurns turns_;
  std::optional<FocusControl::Plan> plan_;
  GainRequest gains_;  // what the next request says of cameras' brightness
};

// The rounds after which a focal surface has settled, from the viewer's plane on.
inline constexpr int kSettledRounds = 12;
// The rounds after which cameras have matched their brightness on the surface, too.
inline constexpr int kMatchedRounds = 24;

// The view with the focal surface that `rounds` rounds of trials find, for an array that stands still: all that nodes
// and a compositor do, in one go. Asks `images` for cameras that contribute, which must be of the rig's sizes. The view
// must be valid. `gains`: cameras match their brightness, as nodes do, and it becomes what the images of the view are
// to be divided by; null: they do not.
View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const FocusControl::Settings& settings, int rounds = kSettledRounds, CameraGains* gains = nullptr);

}  // namespace lf
