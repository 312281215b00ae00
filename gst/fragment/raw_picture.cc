// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/raw_picture.h"

#include <array>
#include <atomic>
#include <cstring>
#include <utility>

#include "common/gl_share.h"
#include "common/gl_sync.h"
#include "common/gst_pointers.h"

namespace lf {
namespace {

std::shared_ptr<GstBuffer> share(GstBuffer* buffer) { return {buffer, gst_buffer_unref}; }

bool has_system_colorimetry(const GstVideoInfo& info) {
  // Full-range BT.601 without a known siting is JPEG, so its chroma is centred.
  const bool centred =
      info.chroma_site == GST_VIDEO_CHROMA_SITE_NONE || info.chroma_site == GST_VIDEO_CHROMA_SITE_UNKNOWN;
  return info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255 &&
         info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_BT601 && centred;
}

bool is_system_i420(const GstVideoInfo& info) {
  return GST_VIDEO_INFO_FORMAT(&info) == GST_VIDEO_FORMAT_I420 && has_system_colorimetry(info);
}

// Returns the matrix, the range and the chroma siting of a video format. Returns nothing if GStreamer does not know the
// colour matrix.
std::optional<YcbcrFormat> kind_of(const GstVideoInfo& info) {
  YcbcrFormat kind;
  if (!gst_video_color_matrix_get_Kr_Kb(info.colorimetry.matrix, &kind.kr, &kind.kb)) return std::nullopt;
  kind.full_range = info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255;
  if (info.chroma_site & GST_VIDEO_CHROMA_SITE_H_COSITED) kind.right = -0.5;
  if (info.chroma_site & GST_VIDEO_CHROMA_SITE_V_COSITED) kind.down = -0.5;
  return kind;
}

}  // namespace

bool FrameConverter::takes_samples_of(const GstVideoInfo& video, PixelFamily family) {
  if (family == PixelFamily::kRgb) return family_of(video) == family;
  const GstVideoFormat format = GST_VIDEO_INFO_FORMAT(&video);
  return (format == GST_VIDEO_FORMAT_I420 || format == GST_VIDEO_FORMAT_NV12) && has_system_colorimetry(video);
}

FrameConverter::FrameConverter(const GstVideoInfo& input, PixelFamily family) : input_(input), family_(family) {
  if (family == PixelFamily::kRgb ? family_of(input) == family : is_system_i420(input)) return;
  if (family == PixelFamily::kI420 && family_of(input) == PixelFamily::kI420) {
    if (GST_VIDEO_INFO_FORMAT(&input) != GST_VIDEO_FORMAT_I420) add_planar_step(input);
    const GstVideoInfo planar = steps_.empty() ? input : steps_.back().to;
    if (is_system_i420(planar)) return;
    add_ycbcr_step(planar);
  } else {
    add_step(input, family == PixelFamily::kRgb ? GST_VIDEO_FORMAT_RGB : GST_VIDEO_FORMAT_I420);
  }
}

void FrameConverter::add_step(const GstVideoInfo& from, GstVideoFormat format) {
  GstVideoInfo to;
  gst_video_info_set_format(&to, format, static_cast<guint>(from.width), static_cast<guint>(from.height));
  to.fps_n = from.fps_n;
  to.fps_d = from.fps_d;
  set_system_colorimetry(to);
  GstVideoInfo in = from, out = to;
  steps_.push_back({from, to, {gst_video_converter_new(&in, &out, nullptr), gst_video_converter_free}, {}});
}

// Uses our own conversion where possible, because GstVideoConverter 1.22 copies I420 to I420 without converting range
// and siting. The fallback, its conversion by way of RGB, makes video levels up to 3 of 255 too dark.
void FrameConverter::add_ycbcr_step(const GstVideoInfo& from) {
  GstVideoInfo to = from;
  set_system_colorimetry(to);
  const std::optional<YcbcrFormat> kind = kind_of(from);
  if (!kind) {
    add_step(from, GST_VIDEO_FORMAT_RGB);
    return add_step(steps_.back().to, GST_VIDEO_FORMAT_I420);
  }
  steps_.push_back({from, to, {nullptr, gst_video_converter_free}, YcbcrConversion(*kind)});
}

// Rearranges the planes here, because GstVideoConverter would resample the chroma.
void FrameConverter::add_planar_step(const GstVideoInfo& from) {
  GstVideoInfo to;
  gst_video_info_set_format(&to, GST_VIDEO_FORMAT_I420, static_cast<guint>(from.width),
                            static_cast<guint>(from.height));
  to.fps_n = from.fps_n;
  to.fps_d = from.fps_d;
  to.colorimetry = from.colorimetry;
  to.chroma_site = from.chroma_site;
  if (GST_VIDEO_INFO_FORMAT(&from) == GST_VIDEO_FORMAT_GRAY8) {  // no chroma, so siting and matrix do not matter
    const GstVideoColorRange range = from.colorimetry.range;
    set_system_colorimetry(to);
    if (range == GST_VIDEO_COLOR_RANGE_16_235) to.colorimetry.range = range;
  }
  steps_.push_back({from, to, {nullptr, gst_video_converter_free}, {}});
}

static void copy_rows(const uint8_t* from, gint from_stride, uint8_t* to, gint to_stride, int width, int height) {
  for (int y = 0; y < height; y++) std::memcpy(to + y * to_stride, from + y * from_stride, static_cast<size_t>(width));
}

static void lay_out_planar(const GstVideoFrame& in, GstVideoFrame& out) {
  const auto plane = [](const GstVideoFrame& frame, guint i) {
    return static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i));
  };
  const auto stride = [](const GstVideoFrame& frame, guint i) { return GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i); };
  copy_rows(plane(in, 0), stride(in, 0), plane(out, 0), stride(out, 0), in.info.width, in.info.height);
  const int width = GST_VIDEO_FRAME_COMP_WIDTH(&out, 1), height = GST_VIDEO_FRAME_COMP_HEIGHT(&out, 1);
  const bool grey = GST_VIDEO_FRAME_FORMAT(&in) == GST_VIDEO_FORMAT_GRAY8;
  for (int y = 0; y < height; y++) {
    uint8_t* u = plane(out, 1) + y * stride(out, 1);
    uint8_t* v = plane(out, 2) + y * stride(out, 2);
    if (grey) {
      std::memset(u, 128, static_cast<size_t>(width));
      std::memset(v, 128, static_cast<size_t>(width));
      continue;
    }
    const uint8_t* uv = plane(in, 1) + y * stride(in, 1);
    for (int x = 0; x < width; x++) {
      u[x] = uv[2 * x];
      v[x] = uv[2 * x + 1];
    }
  }
}

static void convert_ycbcr(const YcbcrConversion& conversion, const GstVideoFrame& in, GstVideoFrame& out) {
  ImageView from{.family = PixelFamily::kI420, .width = in.info.width, .height = in.info.height};
  uint8_t* to[3];
  ptrdiff_t stride[3];
  for (guint i = 0; i < 3; i++) {
    from.plane[i] = static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&in, i));
    from.stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&in, i);
    to[i] = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&out, i));
    stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&out, i);
  }
  conversion.convert(from, to, stride);
}

std::shared_ptr<GstBuffer> FrameConverter::run(const Step& step, GstBuffer* buffer) {
  std::shared_ptr<GstBuffer> result = share(gst_buffer_new_allocate(nullptr, step.to.size, nullptr));
  GstVideoFrame in, out;
  if (!gst_video_frame_map(&in, const_cast<GstVideoInfo*>(&step.from), buffer, GST_MAP_READ)) return nullptr;
  if (gst_video_frame_map(&out, const_cast<GstVideoInfo*>(&step.to), result.get(), GST_MAP_WRITE)) {
    if (step.converter)
      gst_video_converter_frame(step.converter.get(), &in, &out);
    else if (step.ycbcr)
      convert_ycbcr(*step.ycbcr, in, out);
    else
      lay_out_planar(in, out);
    gst_video_frame_unmap(&out);
  }
  gst_video_frame_unmap(&in);
  return result;
}

std::shared_ptr<RawPicture> FrameConverter::convert(GstBuffer* buffer, bool keep_original) const {
  const std::shared_ptr<GstBuffer> original = share(buffer);
  std::shared_ptr<GstBuffer> converted = original;
  for (const Step& step : steps_)
    if (converted) converted = run(step, converted.get());
  if (!converted) return nullptr;
  if (steps_.empty()) return std::make_shared<RawPicture>(original, input_);
  return std::make_shared<RawPicture>(converted, steps_.back().to,
                                      keep_original ? std::make_shared<RawPicture>(original, input_) : nullptr);
}

namespace {

struct MappedFrame {
  MappedFrame(const std::shared_ptr<GstBuffer>& buffer, const GstVideoInfo& info)
      : buffer(buffer), ok(gst_video_frame_map(&frame, const_cast<GstVideoInfo*>(&info), buffer.get(), GST_MAP_READ)) {
    if (!ok) return;
    view.family = family_of(info);
    view.width = GST_VIDEO_FRAME_WIDTH(&frame);
    view.height = GST_VIDEO_FRAME_HEIGHT(&frame);
    if (view.family == PixelFamily::kRgb) view.layout = rgb_layout(info);
    for (unsigned i = 0; i < GST_VIDEO_FRAME_N_PLANES(&frame); i++) {
      view.plane[i] = static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i));
      view.stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i);
    }
  }
  ~MappedFrame() {
    if (ok) gst_video_frame_unmap(&frame);
  }
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;

  const std::shared_ptr<GstBuffer> buffer;
  GstVideoFrame frame;
  const bool ok;
  ImageView view;
};

}  // namespace

std::shared_ptr<const ImageView> RawPicture::view(PixelFamily family, const Rect&) {
  if (!takes_work(family)) return map();
  const RawPicture& from = original_ ? *original_ : *this;
  const auto converted = FrameConverter(from.info_, family).convert(gst_buffer_ref(from.buffer_.get()));
  return converted ? converted->map() : nullptr;
}

std::shared_ptr<const ImageView> RawPicture::map() const {
  const auto mapped = std::make_shared<const MappedFrame>(buffer_, info_);
  return mapped->ok ? std::shared_ptr<const ImageView>(mapped, &mapped->view) : nullptr;
}

// A picture in GPU textures, with its conversions. Each conversion runs only once, when it is needed.
class GpuPicture::Textures : public GpuImage {
 public:
  static std::unique_ptr<Textures> make(GpuPicture& picture) {
    std::unique_ptr<Textures> textures(new Textures(picture));
    return textures->find() ? std::move(textures) : nullptr;
  }
  gl::ShareGroup group() const { return group_; }
  const ImageView& image() const { return image_; }

  Texture plane(int index) const override { return planes_[static_cast<size_t>(index)]; }
  void wait() const override {
    gst_gl_sync_meta_wait(gst_buffer_get_gl_sync_meta(written_.get()), gst_gl_context_get_current());
  }
  ImageView fetch() const override {
    const std::lock_guard lock(mutex_);
    is_fetched_ = true;
    if (!here_) here_ = picture_.view(image_.family, {});
    return here_ ? *here_ : ImageView{};
  }
  bool is_fetched() const override { return is_fetched_; }

 private:
  explicit Textures(GpuPicture& picture) : picture_(picture), group_(group_of_planes(picture.buffer_.get())) {}

  bool find() {
    const GstVideoInfo& info = picture_.info_;
    GstBuffer* const buffer = picture_.buffer_.get();
    GstGLContext* const context = wait_for_gl_writer(buffer);
    // Maps the buffer, which uploads data that the CPU has written. The textures stay valid and unchanged during the
    // lifetime of the buffer.
    GstVideoFrame frame;
    if (!gst_video_frame_map(&frame, const_cast<GstVideoInfo*>(&info), buffer,
                             static_cast<GstMapFlags>(GST_MAP_READ | GST_MAP_GL)))
      return false;
    const bool is_rgb = family_of(info) == PixelFamily::kRgb, is_interleaved = GST_VIDEO_INFO_N_PLANES(&info) == 2;
    const auto name = [&frame](guint plane) { return *static_cast<const guint*>(frame.data[plane]); };
    for (int i = 0; i < (is_rgb ? 1 : 3); i++)
      planes_[static_cast<size_t>(i)] = {name(static_cast<guint>(is_interleaved ? std::min(i, 1) : i)),
                                         is_interleaved && i == 2 ? 1 : 0};
    gst_video_frame_unmap(&frame);
    written_.reset(gst_buffer_new());
    gst_gl_sync_meta_set_sync_point(gst_buffer_add_gl_sync_meta(context, written_.get()), context);
    image_ = {.family = family_of(info), .width = info.width, .height = info.height, .on_gpu = {this}};
    if (is_rgb) image_.layout = rgb_layout(info);
    return true;
  }

  GpuPicture& picture_;
  const gl::ShareGroup group_;
  std::array<Texture, 3> planes_ = {};
  BufferPtr written_;  // needed only for the sync point after the writes to the textures
  ImageView image_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const ImageView> here_;
  mutable std::atomic<bool> is_fetched_ = false;
};

GpuPicture::GpuPicture(GstBuffer* buffer, const GstVideoInfo& info) : buffer_(buffer, gst_buffer_unref), info_(info) {}

GpuPicture::~GpuPicture() = default;

std::shared_ptr<const ImageView> GpuPicture::view(PixelFamily family, const Rect& region) {
  const std::lock_guard lock(mutex_);
  if (!converted_) wait_for_gl_writer(buffer_.get());
  if (!converted_ || converted_->takes_work(family))
    converted_ = FrameConverter(info_, family).convert(gst_buffer_ref(buffer_.get()));
  return converted_ ? converted_->view(family, region) : nullptr;
}

const ImageView* GpuPicture::view_on_gpu(PixelFamily family, gl::ShareGroup group) {
  if (!FrameConverter::takes_samples_of(info_, family) || !has_planes_on_gpu(buffer_.get(), info_)) return nullptr;
  const std::lock_guard lock(mutex_);
  if (!textures_ && group_of_planes(buffer_.get()) == group) textures_ = Textures::make(*this);
  if (!textures_ || textures_->group() != group) return nullptr;
  return &textures_->image();
}

}  // namespace lf
