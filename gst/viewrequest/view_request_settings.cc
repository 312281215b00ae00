// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_request_settings.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "common/custom_events.h"
#include "rig/rig.h"
#include "view/view.h"
#include "viewrequest/lfviewrequest.h"

#define GST_CAT_DEFAULT lf_view_request_debug

namespace lf {
namespace {

using StructurePtr = std::unique_ptr<GstStructure, void (*)(GstStructure*)>;

StructurePtr structure_ptr(GstStructure* owned) { return {owned, gst_structure_free}; }

void limit_side(GstStructure* wanted, const char* name, int set, int count) {
  if (set > 0)
    gst_structure_set(wanted, name, G_TYPE_INT, set * count, nullptr);
  else
    gst_structure_set(wanted, name, GST_TYPE_INT_RANGE, 1, kMaxImageSize, nullptr);
}

// What the properties allow, of whole pictures.
StructurePtr wanted_form(const PictureForm& set, int columns, int rows) {
  StructurePtr wanted = structure_ptr(gst_structure_new_empty("video/x-raw"));
  limit_side(wanted.get(), "width", set.width, columns);
  limit_side(wanted.get(), "height", set.height, rows);
  gst_structure_set(wanted.get(), "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  if (set.fps_n > 0)
    gst_structure_set(wanted.get(), "framerate", GST_TYPE_FRACTION, set.fps_n, set.fps_d, nullptr);
  else
    gst_structure_set(wanted.get(), "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  return wanted;
}

// Formats, colours and the memory are for lfcompositor to agree on.
StructurePtr size_and_rate_of(const GstStructure* video) {
  StructurePtr copy = structure_ptr(gst_structure_new_empty("video/x-raw"));
  for (const char* name : {"width", "height", "framerate", "pixel-aspect-ratio"})
    if (const GValue* value = gst_structure_get_value(video, name)) gst_structure_set_value(copy.get(), name, value);
  return copy;
}

// One side of a view, as near to `target` as the structure allows for `count` views in a row. 0: no such side.
// `is_set`: the picture has several views.
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

std::optional<PictureForm> fit_to_structure(GstStructure* form, const PictureForm& set, const PictureForm& usual,
                                            int columns, int rows) {
  PictureForm fitted = set;
  const bool is_set = columns * rows > 1;
  const bool is_wide_fixed = set.width == 0 && gst_structure_has_field_typed(form, "width", G_TYPE_INT);
  const bool is_high_fixed = set.height == 0 && gst_structure_has_field_typed(form, "height", G_TYPE_INT);
  PictureForm target = usual;
  if (is_high_fixed && !is_wide_fixed) {
    fitted.height = choose_side(form, "height", usual.height, rows, is_set);
    if (fitted.height != usual.height) target.width = scaled(fitted.height, usual.width, usual.height);
  }
  fitted.width = set.width > 0 ? set.width : choose_side(form, "width", target.width, columns, is_set);
  if (set.width == 0 && !is_high_fixed && fitted.width != usual.width)
    target.height = scaled(fitted.width, usual.height, usual.width);
  fitted.height = set.height > 0 ? set.height : choose_side(form, "height", target.height, rows, is_set);
  if (fitted.width <= 0 || fitted.height <= 0) return std::nullopt;
  gst_structure_fixate_field_nearest_fraction(form, "framerate", usual.fps_n, usual.fps_d);
  if (!gst_structure_get_fraction(form, "framerate", &fitted.fps_n, &fitted.fps_d)) return std::nullopt;
  return fitted;
}

}  // namespace

PictureForm with_usual(const PictureForm& set, const PictureForm& usual) {
  PictureForm form = set;
  if (form.width == 0) form.width = usual.width;
  if (form.height == 0) form.height = usual.height;
  if (form.fps_n == 0) form.fps_n = usual.fps_n, form.fps_d = usual.fps_d;
  return form;
}

std::optional<PictureForm> fit_to_caps(const GstCaps* caps, const PictureForm& set, const PictureForm& usual,
                                       int columns, int rows) {
  if (gst_caps_is_any(caps)) return with_usual(set, usual);
  const StructurePtr wanted = wanted_form(set, columns, rows);
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    const GstStructure* offered = gst_caps_get_structure(caps, i);
    if (!gst_structure_has_name(offered, "video/x-raw")) continue;
    const StructurePtr sizes = size_and_rate_of(offered);
    const StructurePtr form = structure_ptr(gst_structure_intersect(sizes.get(), wanted.get()));
    if (!form) continue;
    if (auto fitted = fit_to_structure(form.get(), set, usual, columns, rows)) return fitted;
  }
  return std::nullopt;
}

}  // namespace lf

// Properties decide on the size and rate of pictures; where properties are not set, the caps behind the view's
// lfcompositor do.

using lf::PictureForm;

static PictureForm usual_form(const lf::RequestStream& stream) {
  return {stream.default_width(), stream.default_height(), lf::kUsualFps, 1};
}

// Views of a file have sizes of their own, but no rate.
static lf::SharedCaps without_size(const GstCaps* caps) {
  GstCaps* copy = gst_caps_copy(caps);
  for (guint i = 0; i < gst_caps_get_size(copy); i++)
    gst_structure_remove_fields(gst_caps_get_structure(copy, i), "width", "height", nullptr);
  return lf::share_caps(copy);
}

void lf_view_request_choose_form(LfViewRequest* self) {
  auto& state = *self->state;
  if (!state.stream) return;
  const lf::ViewRequestSettings& settings = state.settings;
  const PictureForm set{settings.width, settings.height, settings.fps_n, settings.fps_d};
  const PictureForm usual = usual_form(*state.stream);
  const bool from_file = state.stream->from_file();
  std::optional<PictureForm> fitted;
  if (state.downstream) {
    const lf::SharedCaps caps = from_file ? without_size(state.downstream.get()) : state.downstream;
    const lf::PlaceInSet place = settings.place(0);
    fitted = lf::fit_to_caps(caps.get(), set, usual, place.columns, place.rows);
  }
  state.form = fitted.value_or(lf::with_usual(set, usual));
  state.follows_caps = fitted && !from_file;
}

gboolean lf_view_request_follow_caps(LfViewRequest* self, lf::SharedCaps caps) {
  const lf::ObjectLock lock(self);
  self->state->downstream = std::move(caps);
  lf_view_request_choose_form(self);
  return self->state->stream && self->state->follows_caps;
}

void lf_view_request_begin_view(LfViewRequest* self, std::unique_ptr<lf::RequestStream> stream) {
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  const lf::ViewRequestSettings settings = state.settings;
  auto share = state.control.visible_share();
  lock.unlock();
  if (stream) share = lf_view_request_visible_share(settings, stream->rig());  // before anything changes: may throw
  lf::ObjectLock again(self);
  if (stream) {
    // GstBaseSrc does not stop an element that could not seek to its beginning.
    state.stream = std::move(stream);
    state.downstream.reset();
    lf_view_request_choose_form(self);
  }
  const PictureForm form = state.form;
  const bool from_file = state.stream->from_file();
  lf::Viewpoint home = state.stream->default_viewpoint();
  again.unlock();
  if (share && !from_file) home = share->home(static_cast<double>(form.width) / form.height, 0, settings);
  lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    control.begin(home);
    control.keep_visible(share);
    return TRUE;
  });
}

static PictureForm form_of(LfViewRequest* self) {
  const lf::ObjectLock lock(self);
  return self->state->form;
}

// Without an answer, as from a compositor on another host, pictures have the size and rate of the properties.
static void ask_downstream(LfViewRequest* self) {
  const PictureForm before = form_of(self);
  lf::SharedCaps caps = lf::query_picture_caps(GST_BASE_SRC_PAD(self), lf_view_request_view_id(self));
  if (!caps) return;
  lf_view_request_follow_caps(self, std::move(caps));
  const PictureForm now = form_of(self);
  const bool is_other_shape = now.width * before.height != before.width * now.height;
  if (is_other_shape && self->state->stream->next_number == 0) lf_view_request_begin_view(self);
}

// Makes requests at the rate of the current caps.
static void use_agreed_rate(LfViewRequest* self) {
  const lf::SharedCaps caps = lf::share_caps(gst_pad_get_current_caps(GST_BASE_SRC_PAD(self)));
  PictureForm agreed;
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
        ("location: downstream asks for %d/%d pictures a second, but a list of views keeps the rate that "
         "it began with: put a videorate in between.",
         agreed.fps_n, agreed.fps_d),
        (nullptr));
  GST_INFO_OBJECT(self, "%d/%d requests a second", agreed.fps_n, agreed.fps_d);
  if (gst_base_src_is_live(GST_BASE_SRC(self)))
    gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
}

// A relay gets its caps with the first request.
static gboolean lf_view_request_negotiate(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (self->state->relay.is_on()) return TRUE;
  ask_downstream(self);
  if (!GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->negotiate(base)) return FALSE;
  use_agreed_rate(self);
  return TRUE;
}

static GstCaps* lf_view_request_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GstCaps* caps = gst_caps_make_writable(lf::unit_caps(LF_REQUEST_MEDIA_TYPE));
  lf::ObjectLock lock(self);
  const gint fps_n = self->state->settings.fps_n, fps_d = self->state->settings.fps_d;
  lock.unlock();
  if (fps_n > 0)
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, fps_n, fps_d, nullptr);
  else
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  if (!filter) return caps;
  GstCaps* filtered = gst_caps_intersect_full(filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(caps);
  return filtered;
}

static GstCaps* lf_view_request_fixate(GstBaseSrc* base, GstCaps* caps) {
  const PictureForm form = form_of(LF_VIEW_REQUEST(base));
  caps = gst_caps_make_writable(caps);
  for (guint i = 0; i < gst_caps_get_size(caps); i++)
    gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, i), "framerate", form.fps_n, form.fps_d);
  return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->fixate(base, caps);
}

GstFlowReturn lf_view_request_follow_rate(LfViewRequest* self) {
  const PictureForm form = form_of(self);
  const PictureForm& agreed = self->state->agreed;
  if (form.fps_n == agreed.fps_n && form.fps_d == agreed.fps_d) return GST_FLOW_OK;
  if (gst_base_src_negotiate(GST_BASE_SRC(self))) return GST_FLOW_OK;
  return GST_PAD_IS_FLUSHING(GST_BASE_SRC_PAD(self)) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
}

void lf_view_request_install_form(GstBaseSrcClass* klass) {
  klass->get_caps = lf::callback<lf_view_request_get_caps>;
  klass->fixate = lf::callback<lf_view_request_fixate>;
  klass->negotiate = lf::callback<lf_view_request_negotiate>;
}

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

Property<S> frame_rate_property() {
  return fraction_property<&S::fps_n, &S::fps_d>(
      kWhileReady, "framerate", "Frame rate",
      "Requests per second, also the rate of the capture schedule; views of a file that have times keep these (0/1: "
      "as the caps downstream of the view's lfcompositor say, else 15/1)",
      0, 1);
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
      frame_rate_property(),
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
