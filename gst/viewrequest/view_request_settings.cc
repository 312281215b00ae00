// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_request_settings.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/custom_events.h"
#include "rig/rig.h"
#include "view/view.h"
#include "viewrequest/lfviewrequest.h"

#define GST_CAT_DEFAULT lf_view_request_debug

namespace lf {
namespace {

void limit_side(GstStructure* wanted, const char* name, int set, int count) {
  if (set > 0)
    gst_structure_set(wanted, name, G_TYPE_INT, set * count, nullptr);
  else
    gst_structure_set(wanted, name, GST_TYPE_INT_RANGE, 1, kMaxImageSize, nullptr);
}

GstStructure* requested_format(const PictureFormat& set, int columns, int rows) {
  GstStructure* wanted = gst_structure_new_empty("video/x-raw");
  limit_side(wanted, "width", set.width, columns);
  limit_side(wanted, "height", set.height, rows);
  gst_structure_set(wanted, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  if (set.fps_n > 0)
    gst_structure_set(wanted, "framerate", GST_TYPE_FRACTION, set.fps_n, set.fps_d, nullptr);
  else
    gst_structure_set(wanted, "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  return wanted;
}

// Copies only size and rate, because lfcompositor negotiates format, colorimetry and memory.
GstStructure* size_and_rate_of(const GstStructure* video) {
  GstStructure* copy = gst_structure_new_empty("video/x-raw");
  for (const char* name : {"width", "height", "framerate", "pixel-aspect-ratio"})
    if (const GValue* value = gst_structure_get_value(video, name)) gst_structure_set_value(copy, name, value);
  return copy;
}

// Chooses the width or height of a view, as close to `target` as the structure allows for `count` views in a row.
// Returns 0 if that is impossible. `is_set` means that the picture has several views.
int choose_side(GstStructure* form, const char* name, int target, int count, bool is_set) {
  const int step = is_set ? 2 * count : 1;
  const bool is_open = !gst_structure_has_field_typed(form, name, G_TYPE_INT);
  gst_structure_fixate_field_nearest_int(form, name, std::clamp(target * count, 1, kMaxImageSize));
  int side = 0;
  gst_structure_get_int(form, name, &side);
  if (is_open && side != target * count) side -= side % step;
  return side % step == 0 ? side / count : 0;
}

int scaled(int side, int numerator, int denominator) {
  const double exact = static_cast<double>(side) * numerator / denominator;
  return std::max(2, 2 * static_cast<int>(exact / 2 + 0.5));
}

std::optional<PictureFormat> fit_to_structure(GstStructure* form, const PictureFormat& set,
                                              const PictureFormat& defaults, int columns, int rows) {
  PictureFormat fitted = set;
  const bool is_set = columns * rows > 1;
  const bool is_wide_fixed = set.width == 0 && gst_structure_has_field_typed(form, "width", G_TYPE_INT);
  const bool is_high_fixed = set.height == 0 && gst_structure_has_field_typed(form, "height", G_TYPE_INT);
  PictureFormat target = defaults;
  if (is_high_fixed && !is_wide_fixed) {
    fitted.height = choose_side(form, "height", defaults.height, rows, is_set);
    if (fitted.height != defaults.height) target.width = scaled(fitted.height, defaults.width, defaults.height);
  }
  fitted.width = set.width > 0 ? set.width : choose_side(form, "width", target.width, columns, is_set);
  if (set.width == 0 && !is_high_fixed && fitted.width != defaults.width)
    target.height = scaled(fitted.width, defaults.height, defaults.width);
  fitted.height = set.height > 0 ? set.height : choose_side(form, "height", target.height, rows, is_set);
  if (fitted.width <= 0 || fitted.height <= 0) return std::nullopt;
  gst_structure_fixate_field_nearest_fraction(form, "framerate", defaults.fps_n, defaults.fps_d);
  if (!gst_structure_get_fraction(form, "framerate", &fitted.fps_n, &fitted.fps_d)) return std::nullopt;
  return fitted;
}

}  // namespace

PictureFormat with_defaults(const PictureFormat& set, const PictureFormat& defaults) {
  PictureFormat form = set;
  if (form.width == 0) form.width = defaults.width;
  if (form.height == 0) form.height = defaults.height;
  if (form.fps_n == 0) form.fps_n = defaults.fps_n, form.fps_d = defaults.fps_d;
  return form;
}

std::optional<PictureFormat> fit_to_caps(const GstCaps* caps, const PictureFormat& set, const PictureFormat& defaults,
                                         int columns, int rows) {
  if (gst_caps_is_any(caps)) return with_defaults(set, defaults);
  g_autoptr(GstStructure) wanted = requested_format(set, columns, rows);
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    const GstStructure* offered = gst_caps_get_structure(caps, i);
    if (!gst_structure_has_name(offered, "video/x-raw")) continue;
    g_autoptr(GstStructure) sizes = size_and_rate_of(offered);
    g_autoptr(GstStructure) form = gst_structure_intersect(sizes, wanted);
    if (!form) continue;
    if (auto fitted = fit_to_structure(form, set, defaults, columns, rows)) return fitted;
  }
  return std::nullopt;
}

}  // namespace lf

// Size and rate of pictures come from the properties, or, if these are not set, from the caps downstream of the view's
// lfcompositor.

using lf::PictureFormat;

static PictureFormat default_format(const lf::RequestStream& stream) {
  return {stream.default_width(), stream.default_height(), lf::kDefaultViewFps, 1};
}

// Views of a file define their sizes, but no rate.
static lf::SharedCaps without_size(const GstCaps* caps) {
  GstCaps* copy = gst_caps_copy(caps);
  for (guint i = 0; i < gst_caps_get_size(copy); i++)
    gst_structure_remove_fields(gst_caps_get_structure(copy, i), "width", "height", nullptr);
  return lf::share_caps(copy);
}

void lf_view_request_choose_format(LfViewRequest* self) {
  auto& state = *self->state;
  if (!state.stream) return;
  const lf::ViewRequestSettings& settings = state.settings;
  const PictureFormat set{settings.width, settings.height, settings.fps_n, settings.fps_d};
  const PictureFormat defaults = default_format(*state.stream);
  const bool from_file = state.stream->from_file();
  std::optional<PictureFormat> fitted;
  if (state.downstream) {
    const lf::SharedCaps caps = from_file ? without_size(state.downstream.get()) : state.downstream;
    const lf::ViewSetPosition place = settings.place(0);
    fitted = lf::fit_to_caps(caps.get(), set, defaults, place.columns, place.rows);
  }
  state.form = fitted.value_or(lf::with_defaults(set, defaults));
  state.follows_caps = fitted && !from_file;
}

gboolean lf_view_request_follow_caps(LfViewRequest* self, lf::SharedCaps caps) {
  const lf::ObjectLock lock(self);
  self->state->downstream = std::move(caps);
  lf_view_request_choose_format(self);
  return self->state->stream && self->state->follows_caps;
}

void lf_view_request_begin_view(LfViewRequest* self, std::unique_ptr<lf::RequestStream> stream) {
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  const lf::ViewRequestSettings settings = state.settings;
  auto share = state.control.visible_share();
  lock.unlock();
  if (stream) share = lf_view_request_visible_share(settings, stream->rig());
  lf::ObjectLock again(self);
  if (stream) {
    // GstBaseSrc does not stop an element after a failed initial seek.
    state.stream = std::move(stream);
    state.downstream.reset();
    lf_view_request_choose_format(self);
  }
  const PictureFormat form = state.form;
  const bool from_file = state.stream->from_file();
  lf::Viewpoint home = state.stream->default_viewpoint();
  again.unlock();
  if (share && !from_file) home = share->home(static_cast<double>(form.width) / form.height, 0, settings);
  lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    control.begin(home);
    control.constrain_view(share);
    return TRUE;
  });
}

static PictureFormat format_of(LfViewRequest* self) {
  const lf::ObjectLock lock(self);
  return self->state->form;
}

// Without an answer, for example because the compositor is on another host, properties define size and rate.
static void ask_downstream(LfViewRequest* self) {
  const PictureFormat before = format_of(self);
  lf::SharedCaps caps = lf::query_picture_caps(GST_BASE_SRC_PAD(self), lf_view_request_view_id(self));
  if (!caps) return;
  lf_view_request_follow_caps(self, std::move(caps));
  const PictureFormat now = format_of(self);
  const bool is_other_shape = now.width * before.height != before.width * now.height;
  if (is_other_shape && self->state->stream->next_number == 0) lf_view_request_begin_view(self);
}

static void use_negotiated_rate(LfViewRequest* self) {
  const lf::SharedCaps caps = lf::share_caps(gst_pad_get_current_caps(GST_BASE_SRC_PAD(self)));
  PictureFormat agreed;
  if (!caps ||
      !gst_structure_get_fraction(gst_caps_get_structure(caps.get(), 0), "framerate", &agreed.fps_n, &agreed.fps_d))
    return;
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  state.form.fps_n = agreed.fps_n, state.form.fps_d = agreed.fps_d;
  lock.unlock();
  if (agreed.fps_n == state.agreed.fps_n && agreed.fps_d == state.agreed.fps_d) return;
  state.agreed = agreed;
  if (!state.stream->schedule.set_rate(lf::Schedule(agreed.fps_n, agreed.fps_d)))
    GST_ELEMENT_WARNING(
        self, STREAM, FAILED,
        ("location: downstream requires %d/%d pictures per second, but the rate of a list of views can't change: "
         "insert a videorate.",
         agreed.fps_n, agreed.fps_d),
        (nullptr));
  GST_INFO_OBJECT(self, "%d/%d requests a second", agreed.fps_n, agreed.fps_d);
  if (gst_base_src_is_live(GST_BASE_SRC(self)))
    gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
}

// A relay does not negotiate here, because it receives its caps with the first request.
static gboolean lf_view_request_negotiate(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (self->state->relay.is_on()) return TRUE;
  ask_downstream(self);
  if (!GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->negotiate(base)) return FALSE;
  use_negotiated_rate(self);
  return TRUE;
}

static GstCaps* lf_view_request_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GstCaps* caps = gst_caps_make_writable(lf::unit_caps(LF_REQUEST_MEDIA_TYPE));
  const lf::ViewRequestSettings settings = lf_view_request_settings(self);
  if (settings.fps_n > 0)
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, settings.fps_n, settings.fps_d, nullptr);
  else
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  return lf::filter_caps(caps, filter);
}

static GstCaps* lf_view_request_fixate(GstBaseSrc* base, GstCaps* caps) {
  const PictureFormat form = format_of(LF_VIEW_REQUEST(base));
  caps = gst_caps_make_writable(caps);
  for (guint i = 0; i < gst_caps_get_size(caps); i++)
    gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, i), "framerate", form.fps_n, form.fps_d);
  return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->fixate(base, caps);
}

GstFlowReturn lf_view_request_follow_rate(LfViewRequest* self) {
  const PictureFormat form = format_of(self);
  const PictureFormat& agreed = self->state->agreed;
  if (form.fps_n == agreed.fps_n && form.fps_d == agreed.fps_d) return GST_FLOW_OK;
  if (gst_base_src_negotiate(GST_BASE_SRC(self))) return GST_FLOW_OK;
  return GST_PAD_IS_FLUSHING(GST_BASE_SRC_PAD(self)) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
}

void lf_view_request_install_format(GstBaseSrcClass* klass) {
  klass->get_caps = lf::callback<lf_view_request_get_caps>;
  klass->fixate = lf::callback<lf_view_request_fixate>;
  klass->negotiate = lf::callback<lf_view_request_negotiate>;
}

namespace lf {
namespace {

using S = ViewRequestSettings;

constexpr gint64 kMaxCaptureDelay = 60 * GST_SECOND;
constexpr double kMaxEyeDistance = 1e6;

Property<S> frame_rate_property() {
  return fraction_property<&S::fps_n, &S::fps_d>(
      kWhileReady, "framerate", "Frame rate",
      "Rate of the requests and pictures, per second. Views from a file keep their own times (0/1: the rate in the "
      "caps downstream of this view's lfcompositor, or 15/1 if they contain none)",
      0, 1);
}

GType layout_type() {
  static const GType type = register_enum<ViewSetLayout>(
      "LfSetLayout",
      {{ViewSetLayout::kMono, "One view", "mono"},
       {ViewSetLayout::kStereo, "Two views side by side: the view of the left eye is on the left", "stereo"},
       {ViewSetLayout::kCrossEyed,
        "Two views side by side: the view of the left eye is on the right, for cross-eyed "
        "viewing",
        "cross-eyed"},
       {ViewSetLayout::kTopBottom, "Two views on top of each other: the view of the left eye is on top", "top-bottom"},
       {ViewSetLayout::kRow, "One row of views, with \"columns\" views from left to right", "row"},
       {ViewSetLayout::kQuilt,
        "A grid of \"rows\" times \"columns\" views, starting at the bottom left, for light field displays", "quilt"}});
  return type;
}

}  // namespace

std::string ViewRequestSettings::ignored_settings(bool live) const {
  std::string text;
  const auto say = [&text](bool idle, const char* why) {
    if (idle) text += (text.empty() ? "" : " ") + std::string(why);
  };
  const bool from_file = !location.empty();
  say(eager && !live, "eager: has an effect on live requests only; set is-live=true, or omit eager.");
  say(eager && live && from_file,
      "eager: views of a file (location) keep their times. Set eager=false, or define the "
      "view by properties.");
  say(capture_delay > 0 && !live,
      "capture-delay: has an effect on live requests only; set is-live=true, or omit "
      "capture-delay.");
  say(from_file && (width > 0 || height > 0), "width and height: the file (location) defines the sizes of its views.");
  say(loop && !from_file, "loop: has no effect without a file (location).");
  const S initial;
  say(layout == ViewSetLayout::kMono && (cone != 0 || eye_distance != initial.eye_distance),
      "eye-distance and view-cone: have no effect on a single view (views). Set views to a stereo or multi-view "
      "layout.");
  const bool is_row = layout == ViewSetLayout::kRow;
  say(layout != ViewSetLayout::kQuilt && (rows != initial.rows || (!is_row && columns != initial.columns)),
      "columns and rows: only a row has columns, and only a quilt has both (views).");
  return text;
}

// The properties of several views in one picture.
static std::vector<Property<S>> view_set_properties() {
  return {
      inherited_property<S, &S::layout>(kWhilePlaying, "views", "Views",
                                        "Arrangement of several views in one picture, for stereo or light field "
                                        "displays. Their viewpoints (the eyes) lie in a horizontal row around the "
                                        "viewpoint of this element. `width` and `height` are the size of each view",
                                        layout_type()),
      inherited_property<S, &S::columns>(kWhilePlaying, "columns", "Columns",
                                         "Number of views side by side in the picture, if `views` is row or quilt. "
                                         "More views allow a larger viewing angle, but each view takes rendering time",
                                         1, ViewSetPosition::kMaxViews),
      inherited_property<S, &S::rows>(
          kWhilePlaying, "rows", "Rows",
          "Number of rows of views in the picture, if `views` is quilt. A quilt has `rows` times `columns` views", 1,
          ViewSetPosition::kMaxViews),
      inherited_property<S, &S::eye_distance>(
          kWhilePlaying, "eye-distance", "Eye distance",
          "Distance between neighbouring eyes (the viewpoints of the views), in metres. A larger distance gives a "
          "stronger impression of depth. The default is the distance between human eyes",
          0.0, kMaxEyeDistance),
      inherited_property<S, &S::cone>(kWhilePlaying, "view-cone", "View cone",
                                      "Angle between the outermost eyes (viewpoints), seen from the middle of the "
                                      "focal plane, in degrees. Set it to the viewing cone in the data sheet of the "
                                      "display. It replaces `eye-distance` (0: `eye-distance` applies)",
                                      0.0, 179.0),
      inherited_property<S, &S::converged>(
          kWhilePlaying, "converged", "Converged",
          "If true, the views are shifted so that objects in the focal plane appear at the depth of the screen. Set "
          "this to false for headsets, which require parallel lines of sight"),
  };
}

// The properties of a picture's views, and of their control by mouse and keys.
static std::vector<Property<S>> viewer_properties() {
  std::vector<Property<S>> rows = view_set_properties();
  rows.insert(
      rows.end(),
      {
          property<&S::navigation>(
              kWhilePlaying, "navigation", "Navigation",
              "If true, mouse and keys (GstNavigation events) move the view. A drag orbits, a shift-drag pans, the "
              "wheel zooms, and ctrl-wheel focuses. The keys are the arrows, w s a d q e, + -, [ ] and r"),
          property<&S::constrain_view>(
              kWhilePlaying, "constrain-view", "Constrain view",
              "If true, the view stays in the range that the cameras can see. It starts inside the mesh of the array "
              "(the triangles of neighbouring cameras), with a field of view that the cameras cover completely. "
              "Movements by mouse and keys stop before more than a twentieth of the view is lost, except with the "
              "shift key. Requires `rig`"),
          property<&S::navigation_element>(
              kWhileReady, "navigation-element", "Navigation element",
              "Name of an element of this pipeline that the pictures pass through, for example a decoder. Mouse and "
              "key events that reach this element then move the view. Set this if the pictures come from another host"),
          property<&S::eager>(
              kWhilePlaying, "eager", "Eager",
              "If true, a change of a live view, for example by the mouse, causes an early request for the newest "
              "frames. The element sends this request before the next instant of the schedule, at the earliest a "
              "quarter of a frame after the previous instant. This shortens the reaction to mouse and keys, but the "
              "number of requests stays the same. Views from a file are not affected"),
          property<&S::focus_continuous>(
              kWhilePlaying, kFocusContinuous, "Focus continuous",
              "If true, the focus follows a point while the scene moves. This is the point of the last click or "
              "`focus-at` signal, initially the middle of the picture. Its depth comes from the focal surface of the "
              "lfcompositor. Without a focal surface, the element requests an additional small view with every eighth "
              "request, to measure the depth"),
      });
  return rows;
}

PropertyTable<S>& ViewRequestSettings::properties() {
  static PropertyTable<S> table = {
      {
          property<&S::location>(kWhileReady, "location", "Location",
                                 "Path of a file with the views to request (views.json), for example a camera path "
                                 "from lf-path. If empty, the properties define the view"),
          property<&S::rig>(kWhilePlaying, "rig", "Rig",
                            "Path of the rig file (rig.json), which describes the cameras of the array. Requests "
                            "contain a checksum of the rig, so that nodes detect a different rig file. View properties "
                            "that are not set get values that suit the array. If the property is set while the element "
                            "runs, the element loads the file again and uses it from the next request on"),
          property<&S::view_id>(
              kWhileReady, "view-id", "View id",
              "Number that identifies this view in requests and answers. The lfcompositor of the view must have the "
              "same number, and viewers that share cameras must have different numbers",
              0, G_MAXUINT),
          property<&S::width>(kWhilePlaying, "width", "Width",
                              "Width of the view, in pixels. Views from a file have their own sizes (0: the width in "
                              "the caps downstream of this view's lfcompositor. If they contain none, the width of the "
                              "cameras in the rig, or 640 without a rig)",
                              0, kMaxImageSize),
          property<&S::height>(kWhilePlaying, "height", "Height",
                               "Height of the view, in pixels. Views from a file have their own sizes (0: the height "
                               "in the caps downstream of this view's lfcompositor. If they contain none, the height "
                               "of the cameras in the rig, or 480 without a rig)",
                               0, kMaxImageSize),
          frame_rate_property(),
          property<&S::capture_delay>(
              kWhileReady, "capture-delay", "Capture delay",
              "Time from the capture of a live frame to the request for it, in nanoseconds. It must be long enough for "
              "frames to reach the nodes; otherwise the nodes answer with frames that are too old. The element reports "
              "the delay as latency (-1: the delay that the nodes in this process measure. The element posts a LATENCY "
              "message whenever this value changes)",
              gint64{-1}, kMaxCaptureDelay),
          property<&S::quality>(kWhilePlaying, "quality", "Quality",
                                "JPEG quality of answers that cross the network, from 1 to 100. A lower value saves "
                                "bandwidth, but causes more compression artefacts (0: uncompressed)",
                                0, 100),
          property<&S::out_of_service>(kWhilePlaying, "out-of-service", "Out of service",
                                       "Ids of cameras that must not contribute to the view, as a list of numbers and "
                                       "ranges such as \"0-3,7\". Their neighbours contribute instead. Requires `rig`"),
          property<&S::access>(
              kWhileReady, "access", "Access",
              "Selects how much of the rendering the cameras do. Set the same value for the lffragment of the cameras. "
              "The value self is for cameras that know the rig and need only the view requests. The value warp also "
              "sends the transformations of the camera images. The value pixels also sends the image regions to "
              "deliver. The values warp and pixels require `rig`",
              LF_TYPE_ACCESS),
          property<&S::nearest_cameras>(
              kWhilePlaying, "nearest-cameras", "Nearest cameras",
              "Approximate number of cameras that contribute to a pixel. The cameras that match the view best in "
              "direction, resolution and field of view are selected. Use this for irregular arrays; 4 is a good value. "
              "It has no effect if `aperture` is set (0: each pixel is blended from the three cameras of a triangle in "
              "the mesh of the array)",
              0, Blending::kMaxNearest),
          property<&S::loop>(
              kWhileReady, "loop", "Loop",
              "If true, the views in `location` repeat endlessly. If false, the stream ends after the last view"),
      },
      viewer_properties()};
  return table;
}

}  // namespace lf
