// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/picture_output.h"

#include <algorithm>
#include <initializer_list>
#include <string>
#include <utility>

#include <GLES3/gl31.h>
#include <gst/gl/gl.h>
#include <gst/video/video.h>

#include "base/text.h"
#include "common/common.h"
#include "common/custom_events.h"
#include "common/gl_share.h"
#include "common/gst_pointers.h"
#include "render/gl/gpu_sum.h"

namespace lf {
namespace {

// Sets the caps fields multiview-mode and multiview-flags for the stereo layouts. All other layouts must not have these
// fields, because players would show only one view.
void set_multiview(GstCaps* caps, ViewSetLayout layout) {
  const bool crossed = layout == ViewSetLayout::kCrossEyed;
  const auto mode = layout == ViewSetLayout::kTopBottom           ? GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM
                    : layout == ViewSetLayout::kStereo || crossed ? GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE
                                                                  : GST_VIDEO_MULTIVIEW_MODE_NONE;
  if (mode == GST_VIDEO_MULTIVIEW_MODE_NONE) return;
  const guint flags = crossed ? GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST : GST_VIDEO_MULTIVIEW_FLAGS_NONE;
  gst_caps_set_simple(caps, "multiview-mode", G_TYPE_STRING, gst_video_multiview_mode_to_caps_string(mode),
                      "multiview-flags", GST_TYPE_VIDEO_MULTIVIEW_FLAGSET, flags, GST_FLAG_SET_MASK_EXACT, nullptr);
}

// Returns video caps in system memory. Full range, which the cameras use, comes before video range, which some elements
// need.
GstCaps* caps_of_family(PixelFamily family) {
  constexpr char kRgb[] = "video/x-raw, format=(string){ " LF_RGB_FORMATS " }";
  constexpr char kYCbCr[] = "video/x-raw, format=(string){ I420, NV12 }, colorimetry=(string){ 1:4:0:0, bt601 }";
  GstCaps* caps = gst_caps_new_empty();
  if (family != PixelFamily::kI420) gst_caps_append(caps, gst_caps_from_string(kRgb));
  if (family != PixelFamily::kRgb) gst_caps_append(caps, gst_caps_from_string(kYCbCr));
  return caps;
}

void request_rate(GstPad* request, gint* numerator, gint* denominator) {
  *numerator = 0, *denominator = 1;
  const SharedCaps caps = share_caps(gst_pad_get_current_caps(request));
  if (caps) gst_structure_get_fraction(gst_caps_get_structure(caps.get(), 0), "framerate", numerator, denominator);
}

std::string accepted_values(const GstCaps* caps, std::initializer_list<const char*> fields) {
  std::string all;
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    std::string one;
    for (const char* field : fields) {
      const GValue* value = gst_structure_get_value(gst_caps_get_structure(caps, i), field);
      if (!value) continue;
      g_autofree gchar* text = gst_value_serialize(value);
      one += (one.empty() ? "" : ",") + std::string(field) + "=" + text;
    }
    if (!one.empty() && all.find(one) == std::string::npos) all += (all.empty() ? "" : " or ") + one;
  }
  return all.empty() ? "nothing of that kind" : all;
}

void put_in_gpu(GstCaps* caps) {
  gst_caps_set_features_simple(caps, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_set_simple(caps, "texture-target", G_TYPE_STRING, "2D", nullptr);
}

// Appends the same caps in GPU memory. System memory comes first, because it is preferred.
void append_gpu(GstCaps* caps) {
  GstCaps* in_gpu = gst_caps_copy(caps);
  put_in_gpu(in_gpu);
  gst_caps_append(caps, in_gpu);
}

GstFlowReturn no_memory(GstAggregator* element) {
  GST_ELEMENT_ERROR(element, RESOURCE, NO_SPACE_LEFT,
                    ("No memory for a picture. Reduce the size of the views, or "
                     "close other programs."),
                    (nullptr));
  return GST_FLOW_ERROR;
}

}  // namespace

bool is_in_gpu(const GstCaps* caps) {
  const guint count = gst_caps_get_size(caps);
  for (guint i = 0; i < count; i++)
    if (!gst_caps_features_contains(gst_caps_get_features(caps, i), LF_GL_MEMORY)) return false;
  return count > 0 && !gst_caps_is_any(caps);
}

GstCaps* offered_caps(PixelFamily family) {
  GstCaps* caps = caps_of_family(family);
  for (guint i = 0; i < gst_caps_get_size(caps); i++)
    gst_structure_remove_field(gst_caps_get_structure(caps, i), "colorimetry");
  GstCaps* in_gpu = gst_caps_copy(caps);
  gst_caps_set_features_simple(in_gpu, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_append(caps, in_gpu);
  return caps;
}

namespace {

// Chooses the fixed caps of the output for pictures of width x height pixels. `downstream` are the caps that downstream
// accepts. `family` is the pixel family (RGB or YCbCr) that the nodes send, or kNone if it is not known yet. The frame
// rate is taken from the caps of the pad `request`. Stereo layouts set the field multiview-mode. Returns caps that the
// caller owns, or null if downstream accepts no suitable caps. YCbCr keeps the full range of the cameras. The range is
// converted here to video range only if downstream requires BT.601 in video range, because GstVideoConverter 1.22 would
// ignore the difference. GPU memory is chosen only if downstream accepts nothing else.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            ViewSetLayout layout) {
  g_autoptr(GstCaps) wanted = caps_of_family(family);
  gint rate_n = 0, rate_d = 1;
  request_rate(request, &rate_n, &rate_d);
  gst_caps_set_simple(wanted, "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION,
                      rate_n, rate_d, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  set_multiview(wanted, layout);
  append_gpu(wanted);
  g_autoptr(GstCaps) chosen = gst_caps_intersect_full(wanted, downstream, GST_CAPS_INTERSECT_FIRST);
  if (gst_caps_is_empty(chosen)) return nullptr;
  chosen = gst_caps_fixate(chosen);
  GstVideoInfo info;
  if (gst_video_info_from_caps(&info, chosen)) {
    const GstVideoColorimetry asked_for = info.colorimetry;
    const bool has_headroom = has_limited_range(info);
    set_system_colorimetry(info);
    if (has_headroom) info.colorimetry = asked_for;
    GstCaps* exact = gst_video_info_to_caps(&info);
    if (is_in_gpu(chosen)) put_in_gpu(exact);
    gst_caps_take(&chosen, exact);
  }
  return g_steal_pointer(&chosen);
}

// The reason why choose_output_caps() has returned null, with advice for the user.
struct CapsMismatch {
  bool is_of_size_or_rate = false;  // true if another size or rate would be accepted
  std::string text;
};

CapsMismatch explain_mismatch(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height) {
  const char* name = family == PixelFamily::kI420  ? "I420 or NV12"
                     : family == PixelFamily::kRgb ? "RGB"
                                                   : "RGB or I420";
  g_autoptr(GstCaps) formats = caps_of_family(family);
  append_gpu(formats);
  g_autoptr(GstCaps) fits = gst_caps_intersect_full(formats, downstream, GST_CAPS_INTERSECT_FIRST);
  if (gst_caps_is_empty(fits)) {
    const bool in_gpu_only = is_in_gpu(downstream);
    return {false,
            format_text("The pictures of these cameras are %s video, but downstream accepts %s%s: put %s in between.",
                        name, accepted_values(downstream, {"format"}).c_str(), in_gpu_only ? " in GPU memory" : "",
                        in_gpu_only ? "glupload ! glcolorconvert" : "a videoconvert")};
  }
  gint rate_n = 0, rate_d = 1;
  request_rate(request, &rate_n, &rate_d);
  const auto allows = [&fits](auto... fields) {
    g_autoptr(GstStructure) only = gst_structure_new("video/x-raw", fields..., nullptr);
    for (guint i = 0; i < gst_caps_get_size(fits); i++)
      if (gst_structure_can_intersect(gst_caps_get_structure(fits, i), only)) return true;
    return false;
  };
  if (!allows("width", G_TYPE_INT, width, "height", G_TYPE_INT, height))
    return {true, format_text(
                      "The view's pictures have %dx%d pixels, but downstream accepts %s: leave the viewer's properties "
                      "width and height at 0 so that the size follows, or put a videoscale in between. Views of a "
                      "file (location) have the file's sizes.",
                      width, height, accepted_values(fits, {"width", "height"}).c_str())};
  if (!allows("framerate", GST_TYPE_FRACTION, rate_n, rate_d))
    return {true, format_text("Pictures come at %d/%d a second, but downstream accepts %s: leave the viewer's property "
                              "framerate at 0/1 so that the rate follows, or put a videorate in between.",
                              rate_n, rate_d, accepted_values(fits, {"framerate"}).c_str())};
  if (!allows("pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1))
    return {false, format_text("Pictures have square pixels, but downstream accepts %s: put a videoscale in between.",
                               accepted_values(fits, {"pixel-aspect-ratio"}).c_str())};
  if (is_in_gpu(downstream))
    return {
        false,
        format_text("Downstream accepts %s video of %dx%d pixels only in GPU memory, and OpenGL is not available: put "
                    "glupload ! glcolorconvert before that element and its caps. Without a display, GStreamer needs "
                    "GST_GL_PLATFORM=egl and GST_GL_WINDOW=egl-device.",
                    name, width, height)};
  g_autofree gchar* accepted = gst_caps_to_string(downstream);
  return {false, format_text("Downstream accepts no %s video of %dx%d pixels at %d/%d pictures a second, but %s: put a "
                             "videoconvert in between.",
                             name, width, height, rate_n, rate_d, accepted)};
}

}  // namespace

// Draws views directly into the textures of an output buffer, so that pictures that are rendered on the GPU need no
// download. A picture can contain several views, such as the two eyes of a stereo pair. Call draw() once for each view,
// and then finish() before anything else uses the buffer. The textures stay mapped until the destructor.
class GlRenderTarget {
 public:
  // Maps the textures of the buffer `picture`. `group` is the share group of the OpenGL contexts that hold the views;
  // the mapping fails if the textures belong to another group.
  GlRenderTarget(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  ~GlRenderTarget();
  GlRenderTarget(const GlRenderTarget&) = delete;
  GlRenderTarget& operator=(const GlRenderTarget&) = delete;

  // Returns false if the mapping failed. draw() must then not be called.
  explicit operator bool() const { return is_mapped_; }
  gl::ShareGroup group() const { return group_; }
  // Makes a view from `sum` (the answers of all nodes, added up) and writes it into the textures. (x, y) is the
  // position of the view's top-left pixel in the picture. Pixels outside the camera mesh get the colour `background`.
  // The GPU continues to draw after this call returns. Returns false and sets `why` to the reason on failure.
  bool draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why);
  // Waits until the GPU has drawn all views. Returns false and sets `why` if a view could not be drawn, for example
  // because the OpenGL context was lost.
  bool finish(std::string& why);

 private:
  void* insert_fence() const;

  const gl::ShareGroup group_;
  GstVideoFrame frame_;
  bool is_mapped_ = false;
  gl::GpuPicture picture_;
  std::vector<std::shared_ptr<gl::GpuSum>> undrained_;  // one entry for each unfinished draw(); keeps its sum alive
};

GlRenderTarget::GlRenderTarget(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group) : group_(group) {
  if (!has_planes_on_gpu(picture, info) || group_of_planes(picture) != group) return;
  is_mapped_ = gst_video_frame_map(&frame_, &info, picture, static_cast<GstMapFlags>(GST_MAP_READWRITE | GST_MAP_GL));
  if (!is_mapped_) return;
  if (family_of(info) == PixelFamily::kRgb) picture_.layout = rgb_layout(info);
  const guint planes = GST_VIDEO_INFO_N_PLANES(&info);
  picture_.is_interleaved = planes == 2;
  for (guint i = 0; i < planes; i++) picture_.textures[i] = *static_cast<const guint*>(frame_.data[i]);
}

GlRenderTarget::~GlRenderTarget() {
  std::string why;
  finish(why);
  if (is_mapped_) gst_video_frame_unmap(&frame_);
}

void* GlRenderTarget::insert_fence() const {
  void* fence = nullptr;
  const auto put = [](GstGLContext*, gpointer to) {
    *static_cast<void**>(to) = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    glFlush();
  };
  auto* const texture = reinterpret_cast<GstGLMemory*>(frame_.map[0].memory);
  gst_gl_context_thread_add(texture->mem.context, put, &fence);
  return fence;
}

bool GlRenderTarget::draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why) {
  gl::GpuPicture to = picture_;
  to.x = x;
  to.y = y;
  // One fence per renderer is enough, because a renderer executes its commands in order.
  const auto has_same_renderer = [&sum](const auto& begun) { return begun->has_same_renderer(sum.first_gpu_sum()); };
  if (std::ranges::none_of(undrained_, has_same_renderer)) to.fence = insert_fence();
  const Levels levels = has_limited_range(frame_.info) ? kVideoLevels : kFullLevels;
  std::shared_ptr<gl::GpuSum> next = sum.resolve_on_gpu(background, levels, to, why);
  if (!next) return false;
  undrained_.push_back(std::move(next));
  return true;
}

bool GlRenderTarget::finish(std::string& why) {
  bool is_there = true;
  while (!undrained_.empty()) {
    const std::shared_ptr<gl::GpuSum> latest = undrained_.back();
    is_there = latest->wait(why) && is_there;
    std::erase_if(undrained_, [&latest](const auto& begun) { return begun->has_same_renderer(*latest); });
  }
  return is_there;
}

PictureOutput::PictureOutput(GstAggregator* element) : element_(element), own_gpu_(GST_ELEMENT(element)) {}

PictureOutput::~PictureOutput() { stop(); }

void PictureOutput::start(bool partial, GstPad* request) {
  partial_ = partial;
  request_ = request;
  segment_ = {};
  info_ = {};
  negotiated_ = agreed_ = follows_ = refused_ = in_gpu_ = false;
  family_ = offered_ = PixelFamily::kNone;
  width_ = height_ = 0;
  last_rig_ = 0;
}

void PictureOutput::stop() {
  GlContextPtr context;
  ObjectLock lock(element_);
  context_.swap(context);
  lock.unlock();
  drop_pending();
  gst_clear_buffer(&last_picture_);
  pool_.clear();
  own_gpu_.stop();
}

// Accepts failures here. If downstream changes, the base class may negotiate between pictures. The failure is then
// handled at the next picture, because it must end only this view and not the shared stream of requests.
void PictureOutput::negotiate(bool follows) {
  follows_ = follows;
  // Does nothing while the size is unknown, because the base class would log a warning (1.22).
  agreed_ = width_ > 0 && GST_AGGREGATOR_CLASS(g_type_class_peek(GST_TYPE_AGGREGATOR))->negotiate(element_);
}

GstFlowReturn PictureOutput::update_src_caps(GstCaps* downstream, GstCaps** caps) {
  if (!partial_) {
    *caps = choose_output_caps(downstream, request_, family_, width_, height_, layout_);
    return *caps ? GST_FLOW_OK : GST_FLOW_NOT_NEGOTIATED;
  }
  *caps = unit_caps(LF_ANSWER_MEDIA_TYPE);
  if (gst_caps_can_intersect(*caps, downstream)) return GST_FLOW_OK;
  gst_clear_caps(caps);
  return GST_FLOW_NOT_NEGOTIATED;
}

bool PictureOutput::negotiated_src_caps(GstCaps* caps) {
  GstVideoInfo info = {};
  if (!partial_ && !gst_video_info_from_caps(&info, caps)) return false;
  const bool in_gpu = is_in_gpu(caps);
  if (!negotiated_ || in_gpu != in_gpu_ || !gst_video_info_is_equal(&info, &info_)) {
    gst_clear_buffer(&last_picture_);
    drop_pending();
  }
  info_ = info;
  in_gpu_ = in_gpu;
  negotiated_ = true;
  return true;
}

bool PictureOutput::decide_allocation(GstQuery* query) {
  if (!partial_) {
    GlContextPtr context;
    const bool decided = pool_.decide(query, &own_gpu_, &context);
    set_context(std::move(context));
    return decided;
  }
  while (gst_query_get_n_allocation_pools(query) > 0) gst_query_remove_nth_allocation_pool(query, 0);
  return true;  // answers have their own memory
}

GlContextPtr PictureOutput::context() const {
  const ObjectLock lock(element_);
  return context_;
}

void PictureOutput::drop_pending() {
  pending_.textures.reset();
  gst_clear_buffer(&pending_.buffer);
}

void PictureOutput::set_context(GlContextPtr context) {
  ObjectLock lock(element_);
  const bool is_new = context != context_;
  context_.swap(context);
  lock.unlock();
  if (!is_new) return;
  const auto tell = [](GstElement*, GstPad* pad, gpointer request) -> gboolean {
    if (pad != request) gst_pad_push_event(pad, gst_event_new_reconfigure());
    return TRUE;
  };
  gst_element_foreach_sink_pad(GST_ELEMENT(element_), tell, request_);
}

// Negotiates caps and memory for pictures of this kind. Returns GST_FLOW_CUSTOM_SUCCESS if this picture does not fit
// but later ones will, and GST_FLOW_NOT_NEGOTIATED after posting an error.
GstFlowReturn PictureOutput::negotiate_caps(PixelFamily family, int width, int height, ViewSetLayout layout) {
  family_ = family;
  if (family != PixelFamily::kNone) offered_ = family;
  layout_ = layout;
  width_ = width;
  height_ = height;
  gst_aggregator_negotiate(element_);
  if (agreed_) return GST_FLOW_OK;
  if (GST_PAD_IS_FLUSHING(GST_AGGREGATOR_SRC_PAD(element_))) return GST_FLOW_FLUSHING;
  if (!partial_) return refuse_picture();
  GST_ELEMENT_ERROR(element_, STREAM, FORMAT,
                    ("Answers (partial=true) are not video: link the source pad with the next lfcompositor of the "
                     "tree, or with elements that accept " LF_ANSWER_MEDIA_TYPE ", or set partial to false."),
                    (nullptr));
  refused_ = true;
  return GST_FLOW_NOT_NEGOTIATED;
}

GstFlowReturn PictureOutput::refuse_picture() {
  const SharedCaps downstream = share_caps(gst_pad_peer_query_caps(GST_AGGREGATOR_SRC_PAD(element_), nullptr));
  const CapsMismatch mismatch = explain_mismatch(downstream.get(), request_, family_, width_, height_);
  if (mismatch.is_of_size_or_rate && follows_) return GST_FLOW_CUSTOM_SUCCESS;
  GST_ELEMENT_ERROR(element_, STREAM, FORMAT, ("%s", mismatch.text.c_str()), (nullptr));
  refused_ = true;
  return GST_FLOW_NOT_NEGOTIATED;
}

GstFlowReturn PictureOutput::negotiate_picture(PixelFamily family, const ViewRequest& request) {
  const ViewSetPosition& place = request.place;
  const int width = place.columns * request.view.width, height = place.rows * request.view.height;
  const bool same = info_.width == width && info_.height == height && layout_ == place.layout &&
                    (family == PixelFamily::kNone || family_of(info_) == family);
  return same && agreed_ ? GST_FLOW_OK : negotiate_caps(family, width, height, place.layout);
}

// The region of one view in a picture, as pointers to one RGB plane, or to Y, Cb and Cr.
struct PictureOutput::Planes {
  Planes(const GstVideoFrame& frame, const ViewRequest& request) {
    const int x = request.place.column() * request.view.width, y = request.place.row() * request.view.height;
    const guint count = family_of(frame.info) == PixelFamily::kRgb ? 1 : 3;
    for (guint i = 0; i < count; i++) {
      const int halves = i > 0 ? 2 : 1;
      stride[i] = count == 1 ? GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0) : GST_VIDEO_FRAME_COMP_STRIDE(&frame, i);
      data[i] = static_cast<uint8_t*>(count == 1 ? GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)
                                                 : GST_VIDEO_FRAME_COMP_DATA(&frame, i)) +
                x / halves * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, i) + y / halves * stride[i];
    }
  }
  uint8_t* data[3] = {};
  ptrdiff_t stride[3] = {};
};

// Fills pixels that no camera contributed to from the previous picture, unless that was made with another rig.
void PictureOutput::conceal(const Assembly& assembly, const ViewRequest& request, const Planes& picture) {
  if (assembly.fragments() > 0 && assembly.rig_hash() != last_rig_) return;
  GstVideoFrame before;
  if (!last_picture_ || !gst_video_frame_map(&before, &info_, last_picture_, GST_MAP_READ)) return;
  ImageView view;
  view.family = family_of(info_);
  view.width = request.view.width;
  view.height = request.view.height;
  if (view.family == PixelFamily::kRgb) view.layout = rgb_layout(info_);
  const Planes planes(before, request);
  std::ranges::copy(planes.data, view.plane);
  std::ranges::copy(planes.stride, view.stride);
  assembly.picture().conceal(view, picture.data, picture.stride);
  gst_video_frame_unmap(&before);
}

bool PictureOutput::begin_pending(const ViewRequest& request) {
  drop_pending();
  GstBufferPool* pool = gst_aggregator_get_buffer_pool(element_);
  pending_ = {.buffer = pool_.take(pool),
              .first = first_of_set(request),
              .drawn = std::vector<bool>(static_cast<size_t>(request.place.count()))};
  gst_clear_object(&pool);
  return pending_.buffer;
}

// Draws the view on the GPU that holds its sum. The last view of a set waits for the GPU. Returns false if the view
// must be drawn on the CPU, because it is incomplete or has an overlay.
bool PictureOutput::draw_on_gpu(const Assembly& assembly, const ViewRequest& request, const Background& background) {
  const gl::ShareGroup group = assembly.picture().share_group();
  if (group == 0 || !assembly.complete() || (shown_ != WeightOverlayMode::kNone && rig_)) return false;
  std::shared_ptr<GlRenderTarget>& textures = pending_.textures;
  if (!textures || textures->group() != group) {
    leave_gpu();
    textures = std::make_shared<GlRenderTarget>(pending_.buffer, info_, group);
  }
  std::string why;
  bool drawn = *textures && textures->draw(assembly.picture(), background, request.place.column() * request.view.width,
                                           request.place.row() * request.view.height, why);
  const bool is_last = std::ranges::count(pending_.drawn, false) == 1;
  if (drawn && is_last && !textures->finish(why)) drawn = pending_.complete = false;
  if (!why.empty()) GST_WARNING_OBJECT(element_, "a picture can't be made on the GPU: %s", why.c_str());
  return drawn;
}

// Waits until the GPU has drawn all views into the picture. Call before any other access to the picture.
void PictureOutput::leave_gpu() {
  std::string why;
  if (pending_.textures && !pending_.textures->finish(why)) {
    GST_WARNING_OBJECT(element_, "the GPU has lost a picture: %s", why.c_str());
    pending_.complete = pending_.on_gpu = false;
  }
  pending_.textures.reset();
}

bool PictureOutput::draw_here(const Assembly& assembly, const ViewRequest& request, const Background& background) {
  GstVideoFrame frame;
  // Keeps the views that have already been drawn.
  const bool is_begun = std::ranges::find(pending_.drawn, true) != pending_.drawn.end();
  if (!gst_video_frame_map(&frame, &info_, pending_.buffer, is_begun ? GST_MAP_READWRITE : GST_MAP_WRITE)) return false;
  const Planes planes(frame, request);
  const RgbLayout layout = family_of(info_) == PixelFamily::kRgb ? rgb_layout(info_) : RgbLayout{};
  const Levels levels = has_limited_range(info_) ? kVideoLevels : kFullLevels;
  assembly.picture().resolve(background, layout, planes.data, planes.stride, levels);
  if (!assembly.complete() || assembly.picture().is_gone()) conceal(assembly, request, planes);
  if (shown_ != WeightOverlayMode::kNone && rig_) {
    WeightOverlay::Picture picture{.family = family_of(info_), .layout = layout, .levels = levels};
    std::ranges::copy(planes.data, picture.plane);
    std::ranges::copy(planes.stride, picture.stride);
    overlay_.draw(shown_, *rig_, request, assembly.seeing(), picture);
  }
  gst_video_frame_unmap(&frame);
  return true;
}

bool PictureOutput::draw(Assembly& assembly, const ViewRequest& request, const Background& background) {
  assembly.finish(family_of(info_), background != Background{});
  const bool on_gpu = draw_on_gpu(assembly, request, background);
  if (!on_gpu) leave_gpu();
  if (!on_gpu && !draw_here(assembly, request, background)) return false;
  pending_.drawn[static_cast<size_t>(request.place.index)] = true;
  pending_.complete = pending_.complete && assembly.complete();
  pending_.on_gpu = pending_.on_gpu && on_gpu;
  return true;
}

GstBuffer* PictureOutput::make_picture(Assembly& assembly, const ViewRequest& request, const Background& background,
                                       GstFlowReturn* flow, bool* dropped) {
  const bool had_begun = pending_.buffer;
  *flow = negotiate_picture(assembly.family(), request);
  if (*flow == GST_FLOW_CUSTOM_SUCCESS) {
    drop_pending();
    *dropped = true;
    *flow = GST_FLOW_OK;
  }
  if (*flow != GST_FLOW_OK || *dropped) return nullptr;
  const bool goes_on = is_drawing(request) && pending_.drawn.size() == static_cast<size_t>(request.place.count());
  *dropped = had_begun && !goes_on;
  // Skips an empty view, which would show only the previous picture. This helps an overloaded machine.
  if (last_picture_ && request.place.count() == 1 && assembly.is_empty()) {
    pending_.complete = pending_.on_gpu = false;
    return gst_buffer_copy(last_picture_);
  }
  if ((!goes_on && !begin_pending(request)) || !draw(assembly, request, background)) {
    drop_pending();
    *flow = GST_PAD_IS_FLUSHING(GST_AGGREGATOR_SRC_PAD(element_)) ? GST_FLOW_FLUSHING : no_memory(element_);
    return nullptr;
  }
  const bool whole = std::ranges::find(pending_.drawn, false) == pending_.drawn.end();
  if (!whole) return nullptr;
  pending_.textures.reset();
  return std::exchange(pending_.buffer, nullptr);
}

GstFlowReturn PictureOutput::negotiate_answers(const View& view) {
  if (agreed_) return GST_FLOW_OK;
  const GstFlowReturn flow = negotiate_caps(PixelFamily::kNone, view.width, view.height, ViewSetLayout::kMono);
  if (flow == GST_FLOW_OK) root_is_local_ = find_local_compositor(GST_AGGREGATOR_SRC_PAD(element_)).is_there;
  return flow;
}

GstBuffer* PictureOutput::make_answer(Assembly& assembly, const ViewRequest& request, guint node, CodecChoice codec,
                                      GstFlowReturn* flow) {
  *flow = negotiate_answers(request.view);
  if (*flow != GST_FLOW_OK) return nullptr;
  assembly.finish_partial();
  const View& view = request.view;
  wire::AnswerHeader header = wire::answer_to(request, {view.width, view.height}, assembly.rig_hash());
  header.family = assembly.family();
  header.actual_time = assembly.actual_time();
  header.node = node;
  header.cameras = header.blind = assembly.cameras();
  header.blind.remove(assembly.seeing());
  const Coding coding = choose_coding(codec, root_is_local_, request.quality);
  try {
    return wrap_answer(partial_answer(header, assembly.picture(), coding, memory_->take()), memory_);
  } catch (const Error& error) {
    GST_ELEMENT_ERROR(element_, STREAM, ENCODE, ("View %u: %s.", request.view_id, error.what()), (nullptr));
    *flow = GST_FLOW_ERROR;
    return nullptr;
  }
}

PictureOutput::OutputAction PictureOutput::replace_incomplete(const Assembly& assembly,
                                                              LfCompositorIncomplete incomplete, GstBuffer** picture) {
  const bool whole = partial_ || pending_.complete;
  if (!whole && incomplete == LF_COMPOSITOR_INCOMPLETE_REPEAT && last_picture_) {
    gst_buffer_unref(std::exchange(*picture, gst_buffer_copy(last_picture_)));
    return OutputAction::kRepeated;
  }
  if (!whole && incomplete == LF_COMPOSITOR_INCOMPLETE_DROP) {
    gst_clear_buffer(picture);
    return OutputAction::kDropped;
  }
  if (assembly.fragments() > 0) last_rig_ = assembly.rig_hash();
  return OutputAction::kPicture;
}

void PictureOutput::follow_segment(const GstSegment& requests) {
  if (requests.format != GST_FORMAT_TIME || gst_segment_is_equal(&requests, &segment_)) return;
  segment_ = requests;
  gst_aggregator_update_segment(element_, &requests);
}

GstFlowReturn PictureOutput::push(GstBuffer* picture, GstClockTime pts, bool keep) {
  if (GST_CLOCK_TIME_IS_VALID(pts)) {
    const ObjectLock lock(element_);
    GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(element_))->segment.position = pts;
  }
  if (keep) gst_buffer_replace(&last_picture_, picture);
  pushing_ = true;
  const GstFlowReturn flow = gst_aggregator_finish_buffer(element_, picture);
  pushing_ = false;
  return flow;
}

}  // namespace lf
