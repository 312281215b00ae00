// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_request_settings.h"

#include "rig/rig.h"
#include "view/view.h"

namespace lf {
namespace {

using S = ViewRequestSettings;

constexpr GstClockTime kMostCaptureDelay = 60 * GST_SECOND;
constexpr double kMostEyeDistance = 1e6;  // metres

Property<S> capture_delay_property() {
  Property<S> bounded = property<&S::capture_delay>(
      kWhileReady, "capture-delay", "Capture delay",
      "Live: how old, in nanoseconds, the capture time asked for is at least; long enough for frames of that time to "
      "have reached the nodes. It is told as latency. -1 (GST_CLOCK_TIME_NONE) is automatic: what the nodes of this "
      "process find that their cameras need, followed by LATENCY messages",
      guint64{0}, G_MAXUINT64);
  bounded.set = [](S& settings, const GValue* value) {
    const GstClockTime delay = g_value_get_uint64(value);
    settings.capture_delay = GST_CLOCK_TIME_IS_VALID(delay) ? MIN(delay, kMostCaptureDelay) : delay;
  };
  return bounded;
}

}  // namespace

std::string ViewRequestSettings::without_effect(bool live) const {
  std::string text;
  const auto say = [&text](bool idle, const char* why) {
    if (idle) text += (text.empty() ? "" : " ") + std::string(why);
  };
  const bool from_file = !location.empty();
  say(eager && !live, "eager: nothing waits for its turn that is not live.");
  say(eager && live && from_file, "eager: views of a file (location) come in their own time.");
  say(capture_delay > 0 && GST_CLOCK_TIME_IS_VALID(capture_delay) && !live,
      "capture-delay: what is not live waits for no camera.");
  say(from_file && (width > 0 || height > 0), "width and height: views of a file (location) have sizes of their own.");
  say(loop && !from_file, "loop: there is no file (location) to begin again.");
  const S initial;
  say(layout == SetLayout::kMono && (cone != 0 || eye_distance != initial.eye_distance),
      "eye-distance and view-cone: one view (views) has no other beside it.");
  const bool is_row = layout == SetLayout::kRow;
  say(layout != SetLayout::kQuilt && (rows != initial.rows || (!is_row && columns != initial.columns)),
      "columns and rows: only a row has columns, and only a quilt has both (views).");
  return text;
}

PropertyTable<S>& ViewRequestSettings::properties() {
  static PropertyTable<S> table = {
      property<&S::location>(
          kWhileReady, "location", "Location",
          "A views.json file to ask for, view by view; without it the view is made of the properties"),
      property<&S::rig>(
          kWhilePlaying, "rig", "Rig",
          "The rig.json file the view is of: requests carry its hash, and what is not set of the view is chosen to "
          "suit it. Set while running, it is read again and its hash is that of the next request"),
      property<&S::view_id>(kWhileReady, "view-id", "View id", "Id of the view, that of its lfcompositor", 0,
                            G_MAXUINT),
      property<&S::width>(kWhilePlaying, "width", "Width",
                          "Width of the view in pixels, without location (0: as the caps downstream of the view's "
                          "lfcompositor say, else that of the rig's cameras, without rig 640)",
                          0, kMaxImageSize),
      property<&S::height>(kWhilePlaying, "height", "Height",
                           "Height of the view in pixels, without location (0: as the caps downstream of the view's "
                           "lfcompositor say, else that of the rig's cameras, without rig 480)",
                           0, kMaxImageSize),
      fraction_property<&S::fps_n, &S::fps_d>(kWhileReady, "framerate", "Frame rate",
                                              "Requests per second, also the rate of the capture schedule; views of a "
                                              "file that have times keep these (0/1: "
                                              "as the caps downstream of the view's lfcompositor say, else 15/1)",
                                              0, 1),
      capture_delay_property(),
      property<&S::navigation>(kWhilePlaying, "navigation", "Navigation",
                               "Let GstNavigation events move the view: drag orbits, shift-drag pans, the wheel "
                               "zooms, with ctrl it focuses; keys are arrows, w s a d q e, + -, [ ], r"),
      property<&S::keep_visible>(
          kWhilePlaying, "keep-visible", "Keep visible",
          "The view begins inside the array's mesh and no wider than its cameras see, and mouse and keys, but with "
          "shift, lose sight of no more than a twentieth of that: the view is held back. Needs rig"),
      property<&S::quality>(kWhilePlaying, "quality", "Quality",
                            "Quality of the JPEG in which answers come over links (0: uncompressed)", 0, 100),
      property<&S::out_of_service>(kWhilePlaying, "out-of-service", "Out of service",
                                   "Ids of cameras that the nodes are to do without, like \"0-3,7\"; needs rig"),
      property<&S::navigation_from>(kWhileReady, "navigation-from", "Navigation from",
                                    "Name of an element of this pipeline that the pictures pass: mouse and keys of "
                                    "their window steer the view, though the pictures come from another host"),
      property<&S::access>(kWhileReady, "access", "Access",
                           "What the cameras know: behind each request go commands for those that do not find out "
                           "themselves what they have to give (lffragment access); needs rig",
                           LF_TYPE_ACCESS),
      property<&S::eager>(kWhilePlaying, "eager", "Eager",
                          "Live, without location: once the view is changed the next request does not wait for its "
                          "turn, but for a quarter of a frame after the turn before, and asks for the newest capture "
                          "there is. No more requests are made for it"),
      inherited_property<S, &S::layout>(
          kWhilePlaying, "views", "Views",
          "Views of one moment from eyes in a row around the view, whose pictures, of width x height each, make one",
          LF_TYPE_SET_LAYOUT),
      inherited_property<S, &S::columns>(kWhilePlaying, "columns", "Columns",
                                         "Views side by side, with views=row and views=quilt", 1,
                                         PlaceInSet::kMostViews),
      inherited_property<S, &S::rows>(kWhilePlaying, "rows", "Rows", "Rows of views, with views=quilt", 1,
                                      PlaceInSet::kMostViews),
      inherited_property<S, &S::eye_distance>(kWhilePlaying, "eye-distance", "Eye distance",
                                              "Metres between neighbouring eyes of the views", 0.0, kMostEyeDistance),
      inherited_property<S, &S::cone>(
          kWhilePlaying, "view-cone", "View cone",
          "Degrees between the outermost eyes of the views, as seen from the middle of the focal plane, in place of "
          "eye-distance (0: eye-distance)",
          0.0, 179.0),
      inherited_property<S, &S::converged>(
          kWhilePlaying, "converged", "Converged",
          "Shift the pictures of the views so that what is in the focal plane is in the same place of all, as on a "
          "screen that stands there; else lines of sight are parallel, as headsets want them"),
      property<&S::focus_continuous>(
          kWhilePlaying, kFocusContinuous, "Focus continuous",
          "Keep the place of the view in focus that a click or focus-at named last (before: the middle), as what is "
          "seen there moves: from the focal surface of its lfcompositor, or by a sweep of depths, in a small view "
          "beside one of eight requests"),
      property<&S::nearest_cameras>(
          kWhilePlaying, "nearest-cameras", "Nearest cameras",
          "Without aperture: blend about as many cameras a pixel, weighed by angle, resolution and field of view, for "
          "arrays without structure (0: three cameras, blended by the mesh)",
          0, Blending::kMaxNearest),
      property<&S::loop>(kWhileReady, "loop", "Loop", "Begin the file of location again at its end"),
  };
  return table;
}

}  // namespace lf

GType lf_set_layout_get_type(void) {
  using lf::SetLayout;
  static const GType type = lf::register_enum<SetLayout>(
      "LfSetLayout",
      {{SetLayout::kMono, "One view", "mono"},
       {SetLayout::kStereo, "Two, side by side", "stereo"},
       {SetLayout::kCrossEyed, "Two, side by side, the right one on the left: for eyes that cross", "cross-eyed"},
       {SetLayout::kTopBottom, "Two, the left one on top", "top-bottom"},
       {SetLayout::kRow, "One row of \"columns\", from left to right", "row"},
       {SetLayout::kQuilt, "\"rows\" of \"columns\", from the bottom left, as displays of light fields take them",
        "quilt"}});
  return type;
}
