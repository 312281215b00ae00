// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/common.h"

#include <map>
#include <mutex>

#include <sys/stat.h>

#include "base/text.h"
#include "rig/rig_json.h"

namespace lf {
namespace {

// Identifies a version of a file. The modification time alone is not sufficient, because the clocks of file systems
// have steps of some milliseconds.
struct FileVersion {
  ino_t inode = 0;
  off_t size = 0;
  time_t seconds = 0;
  long nanoseconds = 0;
  bool operator==(const FileVersion&) const = default;
};

FileVersion version_of(const std::string& path) {
  struct stat s {};
  if (stat(path.c_str(), &s) != 0) return {};  // load_rig() reports a missing file
  return {s.st_ino, s.st_size, s.st_mtim.tv_sec, s.st_mtim.tv_nsec};
}

}  // namespace

std::shared_ptr<const Rig> shared_rig(const std::string& path) {
  struct Entry {
    std::weak_ptr<const Rig> rig;
    FileVersion version;
  };
  static std::mutex mutex;
  static std::map<std::string, Entry> cache;

  const FileVersion version = version_of(path);
  std::lock_guard lock(mutex);
  Entry& entry = cache[path];
  std::shared_ptr<const Rig> rig = entry.rig.lock();
  if (!rig || entry.version != version) {
    rig = std::make_shared<const Rig>(load_rig(path));
    entry = {rig, version};
  }
  return rig;
}

bool is_running(GstElement* element) {
  const ObjectLock lock(element);
  return GST_STATE(element) >= GST_STATE_PAUSED;
}

std::shared_ptr<const Rig> reload_rig(GstElement* element, const gchar* path) {
  try {
    if (!path) throw Error("no rig file given");
    return shared_rig(path);
  } catch (const Error& error) {
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS, ("%s; the current rig stays in use", error.what()), (nullptr));
    return nullptr;
  }
}

GstCaps* unit_caps(const gchar* media_type) {
  return gst_caps_new_simple(media_type, "parsed", G_TYPE_BOOLEAN, TRUE, nullptr);
}

void accept_unit_caps(GstPad* sink) { GST_PAD_SET_ACCEPT_INTERSECT(sink); }

GstCaps* filter_caps(GstCaps* caps, GstCaps* filter) {
  if (!filter) return caps;
  GstCaps* filtered = gst_caps_intersect_full(filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(caps);
  return filtered;
}

// The caller owns the caps.
static GstCaps* capture_time_reference() {
  static GstStaticCaps caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  return gst_static_caps_get(&caps);
}

GstReferenceTimestampMeta* find_capture_time(GstBuffer* buffer) {
  g_autoptr(GstCaps) reference = capture_time_reference();
  return gst_buffer_get_reference_timestamp_meta(buffer, reference);
}

void add_capture_time(GstBuffer* buffer, GstClockTime time, GstClockTime duration) {
  g_autoptr(GstCaps) reference = capture_time_reference();
  gst_buffer_add_reference_timestamp_meta(buffer, reference, time, duration);
}

bool is_reverse_seek(GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK) return false;
  gdouble rate = 1;
  gst_event_parse_seek(event, &rate, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr);
  return rate <= 0;
}

std::optional<GstClockTime> live_latency(GstPad* sink) {
  g_autoptr(GstQuery) query = gst_query_new_latency();
  gboolean live = FALSE;
  GstClockTime latency = 0;
  if (gst_pad_peer_query(sink, query)) gst_query_parse_latency(query, &live, &latency, nullptr);
  return live ? std::optional(latency) : std::nullopt;
}

PixelFamily family_of(const GstVideoInfo& info) {
  switch (GST_VIDEO_INFO_FORMAT(&info)) {
    case GST_VIDEO_FORMAT_I420:
    case GST_VIDEO_FORMAT_NV12:
    case GST_VIDEO_FORMAT_GRAY8: return PixelFamily::kI420;
    default: break;
  }
  return GST_VIDEO_INFO_IS_RGB(&info) ? PixelFamily::kRgb : PixelFamily::kNone;
}

RgbLayout rgb_layout(const GstVideoInfo& info) {
  const auto offset = [&info](int component) {
    return static_cast<int>(GST_VIDEO_INFO_COMP_POFFSET(&info, component));
  };
  return {GST_VIDEO_INFO_COMP_PSTRIDE(&info, 0), offset(0), offset(1), offset(2)};
}

void set_system_colorimetry(GstVideoInfo& info) {
  if (family_of(info) != PixelFamily::kI420) return;
  gst_video_colorimetry_from_string(&info.colorimetry, "1:4:0:0");
  info.chroma_site = GST_VIDEO_CHROMA_SITE_JPEG;
}

bool has_limited_range(const GstVideoInfo& info) {
  return family_of(info) == PixelFamily::kI420 && info.colorimetry.range == GST_VIDEO_COLOR_RANGE_16_235;
}

}  // namespace lf
