// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recordings.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <system_error>
#include <vector>

#include <gst/base/gsttypefindhelper.h>
#include <gst/video/video.h>

#include "base/text.h"
#include "base/worker_pool.h"
#include "calibration/light_detector.h"
#include "progress.h"
#include "rig/rig.h"
#include "rig/source_security.h"
#include "sample_reader.h"

namespace fs = std::filesystem;

namespace {

enum class FileKind { kFilm, kStill, kOther };

std::string beginning_of(const fs::path& path, size_t most) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(most, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(most));
  bytes.resize(static_cast<size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

bool has_second_jpeg(const fs::path& path) {
  constexpr size_t kMaxBytes = size_t{32} << 20;
  return beginning_of(path, kMaxBytes).find("\xff\xd9\xff\xd8") != std::string::npos;
}

FileKind kind_of(const fs::path& path) {
  constexpr size_t kEnough = size_t{1} << 18;
  const std::string bytes = beginning_of(path, kEnough);
  if (bytes.empty()) return FileKind::kOther;
  g_autoptr(GstCaps) caps =
      gst_type_find_helper_for_data(nullptr, reinterpret_cast<const guint8*>(bytes.data()), bytes.size(), nullptr);
  if (!caps) return FileKind::kOther;
  const std::string type = gst_caps_get_size(caps) > 0 ? gst_structure_get_name(gst_caps_get_structure(caps, 0)) : "";
  if (type == "image/jpeg") return has_second_jpeg(path) ? FileKind::kFilm : FileKind::kStill;
  if (type.starts_with("image/")) return FileKind::kStill;
  for (const char* film : {"video/", "application/x-yuv4mpeg", "application/ogg", "application/mxf",
                           "application/vnd.rn-realmedia", "multipart/x-mixed-replace"})
    if (type.starts_with(film)) return FileKind::kFilm;
  return FileKind::kOther;
}

struct RecordingFiles {
  std::vector<std::string> films, stills, others;  // paths in natural order
};

template <typename Belongs>
RecordingFiles files_in(const std::string& folder, Belongs belongs) {
  std::vector<std::string> paths;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && belongs(entry.path())) paths.push_back(entry.path().string());
  std::ranges::sort(paths, lf::natural_less);
  RecordingFiles found;
  for (const std::string& path : paths) {
    const FileKind kind = kind_of(path);
    (kind == FileKind::kFilm ? found.films : kind == FileKind::kStill ? found.stills : found.others).push_back(path);
  }
  return found;
}

RecordingFiles files_of(const std::string& folder, const lf::Camera& camera) {
  return files_in(folder, [&](const fs::path& path) { return path.stem() == camera.name; });
}

void require_one(const std::vector<std::string>& paths, const lf::Camera& camera, const char* what) {
  if (paths.size() > 1)
    throw lf::Error(paths[0] + " and " + paths[1] + " are both " + what + " of camera " + camera.name +
                    ", but each camera needs exactly one; remove the other from the folder");
}

}  // namespace

std::string find_recording(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera) {
  if (folder.empty()) {
    if (camera.source.empty())
      throw lf::Error("the camera has no source in the rig; give --recordings a folder that contains " + camera.name +
                      ".*");
    if (lf::is_uri(camera.source) && !camera.source.starts_with("file:"))
      throw lf::Error(lf::redacted_location(camera.source) +
                      " is a live camera, but this step reads recordings; record it with lf-rig record, and give "
                      "--recordings that folder");
    return rig.resolve(camera.source);
  }
  const RecordingFiles found = files_of(folder, camera);
  require_one(found.films, camera, "films");
  if (!found.films.empty()) return found.films[0];
  std::string seen;
  for (const std::string& path : found.stills) seen += (seen.empty() ? "; " : ", ") + path + " is a still";
  for (const std::string& path : found.others) seen += (seen.empty() ? "; " : ", ") + path + " is not a video";
  throw lf::Error(folder + " has no recording " + camera.name + ".*" + seen);
}

lf::Rig with_recordings(const std::string& folder, lf::Rig rig) {
  rig.directory = fs::absolute(folder).string();
  const auto name_of = [](const std::string& path) { return fs::path(path).filename().string(); };
  for (lf::Camera& camera : rig.cameras) {
    const RecordingFiles found = files_of(folder, camera);
    require_one(found.films, camera, "films");
    if (found.films.empty()) require_one(found.stills, camera, "stills");
    camera.source = found.films.empty() ? "" : name_of(found.films[0]);
    // A single file of unknown type is treated as a damaged video, so that the error of its reader names the file.
    if (found.films.empty() && found.stills.empty() && found.others.size() == 1)
      camera.source = name_of(found.others[0]);
    camera.image = found.stills.size() == 1 ? name_of(found.stills[0]) : "";
  }
  return rig;
}

std::vector<std::string> board_images(const std::string& folder, const lf::Camera& camera) {
  const fs::path own = fs::path(folder) / camera.name;
  if (fs::is_directory(own)) return files_in(own.string(), [](const fs::path&) { return true; }).stills;
  const std::vector<std::string> films = files_of(folder, camera).films;
  require_one(films, camera, "films");
  if (films.empty()) return {};
  return {"file://" + fs::absolute(films[0]).string()};
}

std::vector<std::string> board_cameras(const std::string& folder) {
  check_folder(folder);
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_directory() && !files_in(entry.path().string(), [](const fs::path&) { return true; }).stills.empty())
      names.insert(entry.path().filename().string());
  for (const std::string& film : files_in(folder, [](const fs::path&) { return true; }).films)
    names.insert(fs::path(film).stem().string());
  std::vector<std::string> sorted(names.begin(), names.end());
  std::ranges::sort(sorted, lf::natural_less);
  return sorted;
}

void check_folder(const std::string& folder) {
  if (!folder.empty() && !fs::is_directory(folder)) throw lf::Error(folder + ": is not a folder");
}

namespace {

// The default method of jpegdec is fast but inaccurate; it shifts positions by hundredths of a pixel.
void decode_exactly(GstBin*, GstBin*, GstElement* element, gpointer) {
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), "idct-method"))
    gst_util_set_object_arg(G_OBJECT(element), "idct-method", "islow");
}

class VideoReader : public lf::SampleReader {
 public:
  VideoReader(const VideoSource& source, VideoFormat format)
      : SampleReader(source.elements + " ! videoconvert ! video/x-raw,format=" +
                         (format == VideoFormat::kGrey ? "GRAY8" : "RGB") + " ! appsink name=sink " +
                         (source.waits ? "sync=false max-buffers=4" : "max-buffers=1 drop=true"),
                     source.name),
        name_(source.name) {}

  // Returns false at the end. Frames before an error are valid, so an error counts as the end.
  bool next(const std::function<bool(const VideoFrame&)>& use) {
    Sample sample;
    try {
      sample = SampleReader::next();
    } catch (const lf::Error&) {
      if (!any_) throw;
    }
    if (!sample && !any_)
      throw lf::Error(name_ + ": no video could be read; check that the file is complete and can be played");
    if (!sample) return false;
    GstVideoInfo info;
    GstVideoFrame frame;
    GstBuffer* buffer = gst_sample_get_buffer(sample.get());
    if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
        !gst_video_frame_map(&frame, &info, buffer, GST_MAP_READ))
      throw lf::Error(name_ + ": a frame cannot be read");
    const GstClockTime time =
        gst_segment_to_stream_time(gst_sample_get_segment(sample.get()), GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    bool more = true;
    if (GST_CLOCK_TIME_IS_VALID(time)) {
      const double seconds = static_cast<double>(time) / GST_SECOND, all = length();
      any_ = true;
      more = use({static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)),
                  GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0), info.width, info.height, seconds,
                  all > 0 ? std::min(1.0, seconds / all) : 0});
    }
    gst_video_frame_unmap(&frame);
    return more;
  }

  double length() const {
    gint64 length = 0;
    return gst_element_query_duration(pipeline(), GST_FORMAT_TIME, &length) && length > 0
               ? static_cast<double>(length) / GST_SECOND
               : 0;
  }

 private:
  const std::string name_;
  bool any_ = false;
};

std::unique_ptr<VideoReader> open_recording(const std::string& place, VideoFormat format) {
  std::error_code ignored;
  if (fs::exists(place, ignored) && !fs::is_regular_file(place, ignored))
    throw lf::Error(place + ": is not a regular file, so it cannot be read as a recording");
  g_autofree gchar* uri = lf::is_uri(place) ? g_strdup(place.c_str()) : gst_filename_to_uri(place.c_str(), nullptr);
  if (!uri) throw lf::Error(place + ": is not a path");
  auto reader = std::make_unique<VideoReader>(
      VideoSource{"uridecodebin name=source ! videoconvert ! videoflip video-direction=auto", place}, format);
  const auto source = reader->child("source");
  g_object_set(source.get(), "uri", uri, nullptr);
  g_signal_connect(source.get(), "deep-element-added", G_CALLBACK(decode_exactly), nullptr);
  reader->start();
  return reader;
}

}  // namespace

lf::Image VideoFrame::rgb() const {
  lf::Image image(lf::PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++) std::copy_n(samples + y * stride, 3 * width, image.pixel(0, y));
  return image;
}

void for_each_video_frame(const std::string& path_or_uri, VideoFormat format,
                          const std::function<bool(const VideoFrame&)>& use) {
  const auto reader = open_recording(path_or_uri, format);
  while (reader->next(use)) {
  }
}

void for_each_video_frame(const VideoSource& source, const std::function<bool(const VideoFrame&)>& use) {
  VideoReader reader(source, VideoFormat::kRgb);
  reader.start();
  while (reader.next(use)) {
  }
}

double video_duration(const std::string& path_or_uri) {
  try {
    const auto reader = open_recording(path_or_uri, VideoFormat::kGrey);
    double length = 0;
    // GStreamer knows the duration only after the first frame.
    reader->next([&](const VideoFrame&) {
      length = reader->length();
      return false;
    });
    return length;
  } catch (const lf::Error&) {
    return 0;
  }
}

namespace {

struct VideoScan {
  lf::LightDetections::Camera sights;
  lf::LightDetectorStats record;
  std::string trouble;
};

VideoScan watch(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera,
                const std::function<void(double)>& progress) {
  VideoScan watched;
  watched.sights = {camera.id, camera.width, camera.height, {}};
  try {
    lf::LightDetector detector(camera.width, camera.height);
    for_each_video_frame(find_recording(folder, rig, camera), VideoFormat::kGrey, [&](const VideoFrame& picture) {
      if (picture.width != camera.width || picture.height != camera.height)
        throw lf::Error("its frames have " + lf::size_text(picture.width, picture.height) +
                        " pixels, but the rig file states " + lf::size_text(camera.width, camera.height));
      // Timestamps that do not increase indicate a damaged recording.
      auto& frames = watched.sights.frames;
      if (frames.empty() || picture.time > frames.back().time)
        frames.push_back({picture.time, detector.detect(picture.samples, picture.stride)});
      progress(picture.progress);
      return true;
    });
    watched.record = detector.record();
  } catch (const lf::Error& e) {
    watched.trouble = std::string(": ") + e.what();
  }
  return watched;
}

}  // namespace

size_t LightRecordings::useful() const {
  return static_cast<size_t>(std::ranges::count_if(cameras, [](const Camera& c) { return c.trouble.empty(); }));
}

std::vector<std::string> LightRecordings::troubles(const lf::Rig& rig) const {
  std::vector<std::string> all;
  for (size_t i = 0; i < cameras.size(); i++)
    if (!cameras[i].trouble.empty()) all.push_back(rig.cameras[i].label() + cameras[i].trouble);
  return all;
}

void for_each_recording(const std::string& what, size_t count, int threads,
                        const std::function<void(size_t, const std::function<void(double)>&)>& read) {
  constexpr int kSteps = 100;
  Progress progress_bar(what, kSteps * count);
  std::mutex mutex;
  std::atomic<bool> failed = false;
  lf::WorkerPool().run(static_cast<unsigned>(threads), count, [&](size_t i) {
    if (failed) return;
    int done = 0;
    const auto progress = [&](double share) {
      const std::lock_guard lock(mutex);
      for (; done < static_cast<int>(share * kSteps); done++) progress_bar.step();
    };
    try {
      read(i, progress);
    } catch (...) {
      failed = true;
      throw;
    }
    progress(1);
  });
  progress_bar.finish();
}

LightRecordings detect_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads) {
  check_folder(folder);
  std::vector<VideoScan> all(rig.cameras.size());
  for_each_recording("searching for lights", all.size(), threads,
                     [&](size_t i, const auto& progress) { all[i] = watch(folder, rig, rig.cameras[i], progress); });
  LightRecordings result;
  result.sights.bar = bar;
  for (const VideoScan& watched : all) {
    LightRecordings::Camera& camera = result.cameras.emplace_back();
    camera.record = watched.record;
    camera.summary = lf::summarize_lights(watched.sights, watched.record);
    camera.trouble = !watched.trouble.empty() ? watched.trouble
                     : camera.summary.trouble ? " " + *camera.summary.trouble
                                              : "";
    result.sights.cameras.push_back(watched.sights);
  }
  result.findings = lf::compare_recordings(result.sights);
  return result;
}
