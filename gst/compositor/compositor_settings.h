// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "common/properties.h"
#include "composite/weight_overlay.h"
#include "compositor/lfcompositor.h"
#include "focus/focus_control.h"
#include "node/answer_form.h"

namespace lf {

// lfcompositor's properties, but for those of RequestGuard.
struct CompositorSettings {
  guint view_id = 0;
  std::string rig;
  guint background = 0xff000000;  // 0xAARRGGBB
  bool post_messages = false;
  LfCompositorIncomplete incomplete = LF_COMPOSITOR_INCOMPLETE_CONCEAL;
  guint max_missed = 5;  // a sixth of a second at 30 pictures a second
  bool partial = false;
  guint node = 0;
  CodecChoice codec = CodecChoice::kAuto;
  FocusMode focus = FocusMode::kAuto;
  double focus_near = 0, focus_far = 0;  // metres
  guint monitor_interval = 0;
  guint trial_interval = 1;
  LfCompositorGains gains = LF_COMPOSITOR_GAINS_AUTO;
  ShownWeights show = ShownWeights::kNone;

  // What a view is focused on: `auto` is for arrays that are known, and a compositor inside a tree leaves it to the
  // root.
  FocusControl::Settings view_focus() const;
  // What is set and can have no effect beside the other settings, and why, for a person to read; empty if nothing is.
  std::string without_effect() const;

  // Whether cameras match their brightness. `has_colour`: the rig in use says how their colours are to be corrected.
  bool match_gains(bool has_colour) const {
    return gains == LF_COMPOSITOR_GAINS_ON || (gains == LF_COMPOSITOR_GAINS_AUTO && !has_colour);
  }

  static PropertyTable<CompositorSettings>& properties();

 private:
  // False if the near end of the range of depths is not nearer than the far one: then the scene decides on both.
  bool has_focus_range() const { return focus_far == 0 || focus_near < focus_far; }
};

}  // namespace lf
