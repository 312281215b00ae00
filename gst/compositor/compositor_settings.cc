// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/compositor_settings.h"

#include "base/number_text.h"
#include "fragment/lffragment.h"

GType lf_compositor_incomplete_get_type(void) {
  static const GType type = lf::register_enum<LfCompositorIncomplete>(
      "LfCompositorIncomplete",
      {{LF_COMPOSITOR_INCOMPLETE_CONCEAL,
        "Show what there is; with `rig`, the other cameras make up for what is missing, and the picture before where "
        "nothing is left",
        "conceal"},
       {LF_COMPOSITOR_INCOMPLETE_REPEAT, "Show the picture before again; conceal before the first", "repeat"},
       {LF_COMPOSITOR_INCOMPLETE_DROP, "Show nothing", "drop"}});
  return type;
}

GType lf_compositor_focus_get_type(void) {
  static const GType type = lf::register_enum<lf::FocusMode>(
      "LfCompositorFocus", {{lf::FocusMode::kPlane, "The viewer's focal plane", "plane"},
                            {lf::FocusMode::kSurface, "Every pixel on its own: trials with every request", "surface"},
                            {lf::FocusMode::kAuto, "The same with as many trials as the scene needs", "auto"}});
  return type;
}

GType lf_compositor_show_get_type(void) {
  static const GType type = lf::register_enum<lf::ShownWeights>(
      "LfCompositorShow",
      {{lf::ShownWeights::kNone, "What the cameras see", "picture"},
       {lf::ShownWeights::kContributions, "Over it in colours which cameras make each pixel, and the mesh between them",
        "contributions"},
       {lf::ShownWeights::kCoverage, "Over it how much of each pixel's weight is lost", "coverage"}});
  return type;
}

GType lf_compositor_gains_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {LF_COMPOSITOR_GAINS_OFF, "Cameras' images are shown as bright as they come", "off"},
        {LF_COMPOSITOR_GAINS_ON, "Cameras match their brightness, behind what the rig says of their colours", "on"},
        {LF_COMPOSITOR_GAINS_AUTO, "They do until the rig says how their colours are to be corrected", "auto"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfCompositorGains", values);
  }();
  return type;
}

namespace lf {

FocusControl::Settings CompositorSettings::view_focus() const {
  const bool on_plane = partial || (focus == FocusMode::kAuto && rig.empty());
  const FocusMode mode = on_plane ? FocusMode::kPlane : focus;
  if (!has_focus_range()) return {.mode = mode};
  return {.mode = mode, .near = focus_near, .far = focus_far};
}

std::string CompositorSettings::without_effect() const {
  std::string text;
  const auto say = [&text](bool idle, const std::string& why) {
    if (idle) text += (text.empty() ? "" : " ") + why;
  };
  const std::string range = format_text("focus-near is %g m and focus-far %g m", focus_near, focus_far);
  say(!has_focus_range(), range + ": the near end must be nearer. Both are left out, and the surface is " +
                              "looked for as the scene asks.");
  say(partial && focus == FocusMode::kSurface,
      "focus: inside a tree (partial) no surface is looked for; set it at the tree's root.");
  say(!partial && (node != 0 || codec != CodecChoice::kAuto),
      "node and codec: only a compositor inside a tree (partial) has answers of its own.");
  say(monitor_interval > 0 && rig.empty(), "monitor-interval: without a rig no camera is watched.");
  say(view_focus().mode == FocusMode::kPlane && (focus_near > 0 || focus_far > 0),
      "focus-near and focus-far: on a plane no depth is looked for.");
  say(gains == LF_COMPOSITOR_GAINS_ON && view_focus().mode == FocusMode::kPlane,
      "gains: cameras match their brightness where a surface is looked for, not on a plane.");
  say(show != ShownWeights::kNone && (partial || rig.empty()),
      "show: only pictures have colours of weights, and only with a rig.");
  return text;
}

PropertyTable<CompositorSettings>& CompositorSettings::properties() {
  using S = CompositorSettings;
  constexpr double kMaxFocus = 1e9;  // metres
  static PropertyTable<S> table = {
      property<&S::view_id>(kWhileReady, "view-id", "View id",
                            "The view to compose: requests and answers of others are ignored", 0, G_MAXUINT),
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Rig file (rig.json); optional: with it the weight of fragments that never came is known and "
                        "made up for, `background` shows outside the array's mesh, and cameras that never answered at "
                        "all are noticed. Set while running, it is read again and serves from the next request on"),
      property<&S::background>(kWhilePlaying, "background", "Background",
                               "Colour where nothing contributes, 0xAARRGGBB (alpha is ignored)", 0, G_MAXUINT32),
      property<&S::post_messages>(kWhilePlaying, "post-messages", "Post messages",
                                  "Post an element message \"lightfield-view\" for every picture"),
      property<&S::incomplete>(kWhilePlaying, "incomplete", "Incomplete",
                               "What is put out for a request of which something is missing at its deadline",
                               LF_TYPE_COMPOSITOR_INCOMPLETE),
      property<&S::max_missed>(
          kWhileReady, "max-missed", "Max missed",
          "Live, a camera that is missing from more pictures in a row is announced upstream as out of service, and a "
          "node that is is not waited for, until they answer in time again (0: never)",
          0, G_MAXUINT),
      property<&S::partial>(kWhileReady, "partial", "Partial",
                            "Put out the sum of the answers as one answer for the next compositor of a tree, in place "
                            "of a picture; needs `rig`"),
      property<&S::node>(kWhileReady, "node", "Node", "Number carried in partial answers, as that of a node", 0,
                         G_MAXUINT),
      property<&S::codec>(kWhilePlaying, "codec", "Codec", "How pixels travel in partial answers",
                          LF_TYPE_FRAGMENT_CODEC),
      property<&S::focus>(
          kWhilePlaying, "focus", "Focus",
          "What pictures are focused on. Other than on a plane, the focal surface is found from what the cameras have "
          "in common on trial surfaces, and the view's lfviewrequest is told of it. Without `rig` auto is plane",
          LF_TYPE_COMPOSITOR_FOCUS),
      property<&S::focus_near>(kWhilePlaying, "focus-near", "Focus near",
                               "Nearest that a focal surface can be, metres from the array (0: at first as near as the "
                               "array can tell depths apart, then as the scene asks)",
                               0, kMaxFocus),
      property<&S::focus_far>(
          kWhilePlaying, "focus-far", "Focus far",
          "Farthest that a focal surface can be, metres from the array (0: at first infinity, then as the scene asks)",
          0, kMaxFocus),
      property<&S::monitor_interval>(
          kWhilePlaying, "monitor-interval", "Monitor interval",
          "Beside one of so many requests a camera, each in turn, is left out and predicted from the others, in a "
          "small view: `stats` tell how well, and which cameras stand out (0: never). Needs `rig`",
          0, G_MAXUINT16),
      property<&S::trial_interval>(kWhilePlaying, "trial-interval", "Trial interval",
                                   "At most one of so many requests has trials, by which a focal surface is found: "
                                   "more where time is short and the surface may follow the scene more slowly",
                                   1, G_MAXUINT16),
      property<&S::gains>(
          kWhilePlaying, "gains", "Gains",
          "Let cameras match their brightness to that of the others; with focus surface or auto. auto: as long as "
          "`rig` does not say how their colours are to be corrected. The lffragments' stats have each camera's gain",
          LF_TYPE_COMPOSITOR_GAINS),
      property<&S::show>(kWhilePlaying, "show", "Show",
                         "What pictures show: what the cameras see, or over it who makes what of it. Needs `rig`",
                         LF_TYPE_COMPOSITOR_SHOW),
  };
  return table;
}

}  // namespace lf
