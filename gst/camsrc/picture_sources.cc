// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/picture_sources.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gst/base/gstpushsrc.h>
#include <gst/video/video.h>

#include "base/file.h"
#include "base/schedule.h"
#include "common/common.h"
#include "common/wall_clock.h"
#include "image/image_file.h"
#include "jpeg/header.h"
#include "scene/scene.h"

namespace {

using Bytes = std::vector<uint8_t>;

Bytes read_picture_file(const std::string& path) {
  const std::string bytes = lf::read_file(path);
  return {bytes.begin(), bytes.end()};
}

// The pictures in a file of concatenated JPEG images. The file is searched only as far as necessary.
class JpegStream {
 public:
  explicit JpegStream(const std::string& path) : path_(path), file_(path, std::ios::binary) {}

  std::optional<Bytes> read(guint64 index) {
    while (begins_.size() <= index && find_next()) {
    }
    if (index >= begins_.size()) return std::nullopt;
    return bytes_at(begins_[index], ends_[index] - begins_[index]);
  }
  // Nothing until the end of the file has been read.
  std::optional<guint64> count() const { return is_complete_ ? std::optional<guint64>(begins_.size()) : std::nullopt; }

 private:
  Bytes bytes_at(uint64_t place, size_t size) {
    Bytes bytes(size);
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(place));
    file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
    bytes.resize(static_cast<size_t>(file_.gcount()));
    return bytes;
  }

  static size_t find_start(const Bytes& bytes, size_t from) {
    constexpr uint8_t kStart[] = {0xff, 0xd8, 0xff};
    return static_cast<size_t>(
        std::search(bytes.begin() + static_cast<ptrdiff_t>(from), bytes.end(), kStart, kStart + sizeof kStart) -
        bytes.begin());
  }

  // A picture without an end marker extends to the next start marker.
  bool find_next() {
    if (is_complete_) return false;
    constexpr size_t kLeast = 1 << 18, kMost = 1 << 26;
    const uint64_t from = ends_.empty() ? 0 : ends_.back();
    for (size_t size = std::max(kLeast, likely_size_);; size *= 2) {
      const Bytes bytes = bytes_at(from, size);
      const bool is_rest = bytes.size() < size;
      const size_t begin = find_start(bytes, 0);
      if (begin == bytes.size() && is_rest) break;
      std::optional<size_t> length;
      if (begin < bytes.size()) length = lf::jpeg_end(std::span(bytes).subspan(begin));
      if (!length && !is_rest && size < kMost) continue;
      if (!length) length = find_start(bytes, std::min(begin + 3, bytes.size())) - begin;
      begins_.push_back(from + begin);
      ends_.push_back(from + begin + *length);
      likely_size_ = 2 * *length;
      return true;
    }
    is_complete_ = true;
    return false;
  }

  std::string path_;
  std::ifstream file_;
  std::vector<uint64_t> begins_, ends_;
  size_t likely_size_ = 0;
  bool is_complete_ = false;
};

class Pictures {
 public:
  explicit Pictures(const lf::CameraSource& source) : source_(source) {
    if (source.kind == lf::CameraSource::Kind::kJpegStream) stream_.emplace(source.location);
  }

  bool is_still() const { return source_.kind == lf::CameraSource::Kind::kStill; }
  std::optional<guint64> count() const {
    if (stream_) return stream_->count();
    return is_still() ? 1 : static_cast<guint64>(source_.count);
  }
  std::optional<Bytes> read(guint64 index) {
    if (stream_) return stream_->read(index);
    if (index >= *count()) return std::nullopt;
    return read_picture_file(file_of(index));
  }
  std::string name_of(guint64 index) const {
    if (is_still()) return "";
    return stream_ ? "picture " + std::to_string(index) + ": " : file_of(index) + ": ";
  }

 private:
  std::string file_of(guint64 index) const {
    return is_still() ? source_.location : lf::sequence_file(source_, static_cast<int>(index));
  }

  lf::CameraSource source_;
  std::optional<JpegStream> stream_;
};

// Thrown for a picture that cannot be decoded. The stream continues without this picture.
class BadPicture : public lf::Error {
 public:
  using Error::Error;
};

}  // namespace

G_DECLARE_FINAL_TYPE(LfPictureSrc, lf_picture_src, LF, PICTURE_SRC, GstPushSrc)

struct _LfPictureSrc {
  GstPushSrc parent;
  Pictures* pictures;
  lf::PictureSourceOptions* options;
  // Used by the streaming thread only:
  guint64 next;
  guint64 consecutive_bad;
  bool has_warned, has_looked_at_exif;
  GstVideoInfo info;
};

G_DEFINE_TYPE(LfPictureSrc, lf_picture_src, GST_TYPE_PUSH_SRC)

static GstStaticPadTemplate picture_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ RGB, I420 }") "; image/jpeg"));

static lf::Schedule schedule_of(LfPictureSrc* self) { return {self->options->fps_n, self->options->fps_d}; }

static gboolean lf_picture_src_negotiate(GstBaseSrc*) { return TRUE; }

static gboolean lf_picture_src_start(GstBaseSrc* base) {
  LfPictureSrc* self = LF_PICTURE_SRC(base);
  self->next = self->consecutive_bad = 0;
  self->has_warned = self->has_looked_at_exif = false;
  gst_video_info_init(&self->info);
  return TRUE;
}

static gboolean lf_picture_src_is_seekable(GstBaseSrc*) { return TRUE; }

static gboolean lf_picture_src_do_seek(GstBaseSrc* base, GstSegment* segment) {
  LfPictureSrc* self = LF_PICTURE_SRC(base);
  if (segment->rate <= 0) return FALSE;
  self->next = schedule_of(self).index_at(segment->position);
  const std::optional<guint64> count = self->pictures->count();
  if (!self->options->loop && count) self->next = std::min(self->next, *count - 1);
  self->consecutive_bad = 0;
  segment->start = segment->time = segment->position = schedule_of(self).instant(self->next);
  return TRUE;
}

static gboolean lf_picture_src_query(GstBaseSrc* base, GstQuery* query) {
  LfPictureSrc* self = LF_PICTURE_SRC(base);
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (GST_QUERY_TYPE(query) != GST_QUERY_DURATION)
    return GST_BASE_SRC_CLASS(lf_picture_src_parent_class)->query(base, query);
  gst_query_parse_duration(query, &format, nullptr);
  const std::optional<guint64> count = self->pictures->count();
  if (format != GST_FORMAT_TIME || !count || self->options->loop) return FALSE;
  gst_query_set_duration(query, format, static_cast<gint64>(schedule_of(self).instant(*count)));
  return TRUE;
}

// Warns that the EXIF orientation is ignored. The process warns only once, because an array may have hundreds of
// cameras.
static void warn_orientation(LfPictureSrc* self, std::span<const uint8_t> bytes, const std::string& name) {
  if (self->has_looked_at_exif) return;
  self->has_looked_at_exif = true;
  constexpr uint64_t kQuiet = 10'000'000'000;
  static std::atomic<uint64_t> last_logged = 0;
  const std::string notice = lf::orientation_notice(lf::exif_orientation(bytes));
  if (notice.empty()) return;
  const uint64_t now = lf::now_ns(), before = last_logged.exchange(now);
  if (before != 0 && now - before < kQuiet) return;
  GST_ELEMENT_WARNING(self, STREAM, FORMAT, ("%s%s", name.c_str(), notice.c_str()),
                      ("other cameras with such pictures are not named"));
}

// `format`: GST_VIDEO_FORMAT_ENCODED for JPEG.
static bool set_caps(LfPictureSrc* self, GstVideoFormat format, int width, int height) {
  const GstVideoInfo& before = self->info;
  if (GST_VIDEO_INFO_FORMAT(&before) == format && before.width == width && before.height == height) return true;
  gst_video_info_set_format(&self->info, format, static_cast<guint>(width), static_cast<guint>(height));
  self->info.fps_n = self->options->fps_n;
  self->info.fps_d = self->options->fps_d;
  lf::set_system_colorimetry(self->info);
  g_autoptr(GstCaps) caps =
      format == GST_VIDEO_FORMAT_ENCODED
          ? gst_caps_new_simple("image/jpeg", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate",
                                GST_TYPE_FRACTION, self->info.fps_n, self->info.fps_d, nullptr)
          : gst_video_info_to_caps(&self->info);
  return gst_base_src_set_caps(GST_BASE_SRC(self), caps);
}

static GstBuffer* buffer_of(const lf::Image& image, const GstVideoInfo& info) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr);
  GstVideoFrame frame;
  if (!buffer || !gst_video_frame_map(&frame, &info, buffer, GST_MAP_WRITE)) {
    gst_clear_buffer(&buffer);
    throw lf::Error("no memory for a frame");
  }
  const lf::ImageView view = image.view();
  for (guint plane = 0; plane < GST_VIDEO_FRAME_N_PLANES(&frame); plane++) {
    auto* row = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, plane));
    const int height = GST_VIDEO_FRAME_COMP_HEIGHT(&frame, plane);
    for (int y = 0; y < height; y++, row += GST_VIDEO_FRAME_PLANE_STRIDE(&frame, plane))
      std::memcpy(row, view.plane[plane] + y * view.stride[plane], static_cast<size_t>(view.stride[plane]));
  }
  gst_video_frame_unmap(&frame);
  return buffer;
}

// Passes JPEG on without decoding. The decoder downstream finds any damage in the compressed data.
static GstFlowReturn make_coded(LfPictureSrc* self, const Bytes& bytes, GstBuffer** out) {
  std::string reason;
  bool unsupported = false;
  const auto header = lf::jpeg::parse_header(bytes, &reason, &unsupported);
  if (!header && unsupported) throw lf::Error(reason);
  if (!header) throw BadPicture("damaged JPEG: " + reason);
  if (!set_caps(self, GST_VIDEO_FORMAT_ENCODED, header->width, header->height)) return GST_FLOW_NOT_NEGOTIATED;
  *out = gst_buffer_new_memdup(bytes.data(), bytes.size());
  return GST_FLOW_OK;
}

// Sets the caps that the header of the picture states. Returns false if downstream refuses them or the size is not the
// size of the camera. This check comes before decoding, because a small file may claim a huge size. The decoder reports
// damaged headers.
static bool set_claimed_caps(LfPictureSrc* self, const Bytes& bytes) {
  const auto set = [self](GstVideoFormat format, int width, int height) {
    return set_caps(self, format, width, height) && width == self->options->width && height == self->options->height;
  };
  if (lf::detect_image_coding(bytes) == lf::ImageCoding::kJpeg) {
    const auto header = lf::jpeg::parse_header(bytes, nullptr);
    return !header || set(GST_VIDEO_FORMAT_I420, header->width, header->height);
  }
  constexpr size_t kWidthAt = 16, kHeightAt = 20;
  if (bytes.size() < kHeightAt + 4) return true;
  const guint32 width = GST_READ_UINT32_BE(&bytes[kWidthAt]), height = GST_READ_UINT32_BE(&bytes[kHeightAt]);
  if (width < 1 || height < 1 || width > lf::kMaxImageSize || height > lf::kMaxImageSize) return true;
  return set(GST_VIDEO_FORMAT_RGB, static_cast<int>(width), static_cast<int>(height));
}

static GstFlowReturn make_raw(LfPictureSrc* self, const Bytes& bytes, GstBuffer** out) {
  if (!set_claimed_caps(self, bytes)) return GST_FLOW_NOT_NEGOTIATED;
  lf::Image image;
  try {
    image = lf::decode_still(bytes, lf::PixelFamily::kI420);
  } catch (const lf::Error& error) {
    throw BadPicture(error.what());
  }
  const bool rgb = image.family() == lf::PixelFamily::kRgb;
  if (!set_caps(self, rgb ? GST_VIDEO_FORMAT_RGB : GST_VIDEO_FORMAT_I420, image.width(), image.height()))
    return GST_FLOW_NOT_NEGOTIATED;
  *out = buffer_of(image, self->info);
  return GST_FLOW_OK;
}

// Returns EOS after the last picture.
static GstFlowReturn make_picture(LfPictureSrc* self, guint64 index, GstBuffer** out) {
  std::optional<Bytes> bytes;
  try {
    bytes = self->pictures->read(index);
  } catch (const lf::Error& error) {
    throw BadPicture(error.what());
  }
  if (!bytes) return GST_FLOW_EOS;
  warn_orientation(self, *bytes, self->pictures->name_of(index));
  const bool coded = !self->options->decode && lf::detect_image_coding(*bytes) == lf::ImageCoding::kJpeg;
  return coded ? make_coded(self, *bytes, out) : make_raw(self, *bytes, out);
}

// Counts a bad picture and warns. Returns false, after posting an error, if all pictures are bad.
static bool skip_bad_picture(LfPictureSrc* self, guint64 index, const char* reason) {
  const std::optional<guint64> count = self->pictures->count();
  if (self->options->damaged) ++*self->options->damaged;
  self->consecutive_bad++;
  self->next++;
  if (count && self->consecutive_bad >= *count) {
    GST_ELEMENT_ERROR(self, STREAM, DECODE, ("%s%s", self->pictures->name_of(index).c_str(), reason),
                      ("none of %" G_GUINT64_FORMAT " pictures can be shown", *count));
    return false;
  }
  if (!self->has_warned)
    GST_ELEMENT_WARNING(self, STREAM, DECODE,
                        ("%s%s: the frame is skipped", self->pictures->name_of(index).c_str(), reason),
                        ("further damaged pictures are counted in stats"));
  self->has_warned = true;
  return true;
}

static GstFlowReturn make_frame(LfPictureSrc* self, GstBuffer** out) {
  const lf::Schedule schedule = schedule_of(self);
  for (;;) {
    std::optional<guint64> count = self->pictures->count();
    const guint64 index = self->options->loop && count && *count > 0 ? self->next % *count : self->next;
    try {
      const GstFlowReturn flow = make_picture(self, index, out);
      count = self->pictures->count();
      // Looks again, because the length of a JPEG stream is determined only at the end.
      if (flow == GST_FLOW_EOS && self->options->loop && count && *count > 0) continue;
      if (flow != GST_FLOW_OK) return flow;
      break;
    } catch (const BadPicture& bad) {
      if (!skip_bad_picture(self, index, bad.what())) return GST_FLOW_ERROR;
    }
  }
  GST_BUFFER_PTS(*out) = schedule.instant(self->next);
  GST_BUFFER_DURATION(*out) = schedule.instant(self->next + 1) - schedule.instant(self->next);
  self->next++;
  self->consecutive_bad = 0;
  return GST_FLOW_OK;
}

static GstFlowReturn lf_picture_src_create(GstPushSrc* push, GstBuffer** out) {
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return make_frame(LF_PICTURE_SRC(push), out); });
}

static void lf_picture_src_finalize(GObject* object) {
  delete LF_PICTURE_SRC(object)->pictures;
  delete LF_PICTURE_SRC(object)->options;
  G_OBJECT_CLASS(lf_picture_src_parent_class)->finalize(object);
}

static void lf_picture_src_class_init(LfPictureSrcClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = lf_picture_src_finalize;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &picture_template);
  gst_element_class_set_static_metadata(element_class, "Light field picture source", "Source/Video",
                                        "Stills, image sequences and JPEG streams from files", "gst-lightfield");
  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  base_class->negotiate = lf_picture_src_negotiate;
  base_class->start = lf_picture_src_start;
  base_class->is_seekable = lf_picture_src_is_seekable;
  base_class->do_seek = lf::callback<lf_picture_src_do_seek>;
  base_class->query = lf::callback<lf_picture_src_query>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_picture_src_create;
}

static void lf_picture_src_init(LfPictureSrc* self) { gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME); }

namespace lf {

GstElement* new_picture_source(const CameraSource& source, const PictureSourceOptions& options) {
  auto* self = LF_PICTURE_SRC(g_object_new(lf_picture_src_get_type(), nullptr));
  self->pictures = new Pictures(source);
  self->options = new PictureSourceOptions(options);
  return GST_ELEMENT(self);
}

bool is_picture_source(gpointer object) { return LF_IS_PICTURE_SRC(object); }

}  // namespace lf

G_DECLARE_FINAL_TYPE(LfSceneSrc, lf_scene_src, LF, SCENE_SRC, GstPushSrc)

struct _LfSceneSrc {
  GstPushSrc parent;
  lf::SceneCamera* camera;
  double time_offset;
  GstVideoInfo info;
  guint64 next;
  GstClockTimeDiff wall_offset;
};

G_DEFINE_TYPE(LfSceneSrc, lf_scene_src, GST_TYPE_PUSH_SRC)

static GstStaticPadTemplate scene_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("RGB")));

static GstCaps* lf_scene_src_get_caps(GstBaseSrc* base, GstCaps* filter) {
  return lf::filter_caps(gst_video_info_to_caps(&LF_SCENE_SRC(base)->info), filter);
}

static gboolean lf_scene_src_start(GstBaseSrc* base) {
  LF_SCENE_SRC(base)->next = 0;
  return TRUE;
}

static gboolean lf_scene_src_is_seekable(GstBaseSrc* base) { return !gst_base_src_is_live(base); }

static gboolean lf_scene_src_do_seek(GstBaseSrc* base, GstSegment* segment) {
  LfSceneSrc* self = LF_SCENE_SRC(base);
  if (segment->rate <= 0) return FALSE;
  self->next = lf::Schedule(self->info.fps_n, self->info.fps_d).first_from(segment->position);
  return TRUE;
}

// The maximum latency is unlimited, because late frames are skipped.
static gboolean lf_scene_src_query(GstBaseSrc* base, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY || !gst_base_src_is_live(base))
    return GST_BASE_SRC_CLASS(lf_scene_src_parent_class)->query(base, query);
  const GstVideoInfo& info = LF_SCENE_SRC(base)->info;
  gst_query_set_latency(query, TRUE, lf::Schedule(info.fps_n, info.fps_d).instant(1), GST_CLOCK_TIME_NONE);
  return TRUE;
}

// Advances to the next frame that has not ended yet. Returns the time of day of running time 0, or 0 if there is no
// clock.
static GstClockTime catch_up(LfSceneSrc* self, const lf::Schedule& schedule) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return 0;
  const GstClockTimeDiff offset = lf::wall_offset(clock);
  const GstClockTime now = gst_clock_get_time(clock) + offset;
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self)) + offset;
  if (std::exchange(self->wall_offset, offset) != offset) self->next = 0;
  self->next = std::max<guint64>(self->next, schedule.index_at(std::max(now, base_time)) + 1);
  return base_time;
}

static GstFlowReturn film(LfSceneSrc* self, GstBuffer** out) {
  const GstVideoInfo& info = self->info;
  const lf::Schedule schedule(info.fps_n, info.fps_d);
  const GstClockTime base_time = gst_base_src_is_live(GST_BASE_SRC(self)) ? catch_up(self, schedule) : 0;
  const GstClockTime stamp = schedule.instant(self->next);
  const GstClockTime end = schedule.instant(self->next + 1);
  ++self->next;

  const double time = static_cast<double>(stamp) / GST_SECOND + self->time_offset;
  *out = buffer_of(lf::render_scene(*self->camera, time), info);
  GST_BUFFER_PTS(*out) = stamp - base_time;
  GST_BUFFER_DURATION(*out) = end - stamp;
  return GST_FLOW_OK;
}

static GstFlowReturn lf_scene_src_create(GstPushSrc* push, GstBuffer** out) {
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return film(LF_SCENE_SRC(push), out); });
}

static void lf_scene_src_finalize(GObject* object) {
  delete LF_SCENE_SRC(object)->camera;
  G_OBJECT_CLASS(lf_scene_src_parent_class)->finalize(object);
}

static void lf_scene_src_class_init(LfSceneSrcClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = lf_scene_src_finalize;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &scene_template);
  gst_element_class_set_static_metadata(element_class, "Light field scene source", "Source/Video",
                                        "Films the built-in scene with one camera", "gst-lightfield");
  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  base_class->get_caps = lf::callback<lf_scene_src_get_caps>;
  base_class->start = lf::callback<lf_scene_src_start>;
  base_class->is_seekable = lf::callback<lf_scene_src_is_seekable>;
  base_class->do_seek = lf::callback<lf_scene_src_do_seek>;
  base_class->query = lf::callback<lf_scene_src_query>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_scene_src_create;
}

static void lf_scene_src_init(LfSceneSrc* self) { gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME); }

namespace lf {

GstElement* new_scene_source(const Camera& camera, int fps_n, int fps_d, bool live) {
  auto* self = LF_SCENE_SRC(g_object_new(lf_scene_src_get_type(), nullptr));
  self->camera = new SceneCamera{camera.width, camera.height, camera.lens, camera.pose};
  self->time_offset = camera.time_offset;
  gst_video_info_set_format(&self->info, GST_VIDEO_FORMAT_RGB, camera.width, camera.height);
  self->info.fps_n = fps_n;
  self->info.fps_d = fps_d;
  gst_base_src_set_live(GST_BASE_SRC(self), live);
  return GST_ELEMENT(self);
}

}  // namespace lf
