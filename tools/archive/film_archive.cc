// SPDX-License-Identifier: LGPL-2.1-or-later
#include "archive/film_archive.h"

#include <gst/app/gstappsink.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "base/error.h"
#include "base/file.h"
#include "posted_error.h"
#include "recording/camera_file.h"

namespace lf::archive {
namespace {

namespace fs = std::filesystem;

constexpr int kKeyFrames = 30;  // at least one of so many frames is a key frame: what a seek decodes at most
constexpr guint64 kMostBytes = 8 << 20;             // that wait for the disk
constexpr gint64 kPatience = 600 * G_USEC_PER_SEC;  // for the disk, at the end
constexpr GstClockTime kTicks = 30'000;             // what times in both files are rounded by together, see CameraFile

// Behind the demuxer: pictures as they are, in the conventions of Image.
const std::string kAsImage = " ! videoconvert ! video/x-raw,format=I420,colorimetry=1:4:0:0,chroma-site=jpeg ! ";
const std::string kDecodedJpeg = "demux.video_0 ! jpegdec idct-method=islow" + kAsImage;
const std::string kDecoded = "demux.video_0 ! decodebin" + kAsImage;
const std::string kSink = "appsink name=sink sync=false max-buffers=4";

using Element = std::unique_ptr<GstElement, decltype(&gst_object_unref)>;
using Sample = std::unique_ptr<GstSample, decltype(&gst_sample_unref)>;

GstClockTime time_of(GstSample* sample) {
  return gst_segment_to_stream_time(gst_sample_get_segment(sample), GST_FORMAT_TIME,
                                    GST_BUFFER_PTS(gst_sample_get_buffer(sample)));
}

// A pipeline that reads a film, while it lives.
class Reading {
 public:
  // `line` goes on behind a demuxer named "demux"; the appsink of its frames is named "sink".
  Reading(const std::string& film, const std::string& line) : film_(film) {
    GError* error = nullptr;
    pipeline_.reset(gst_parse_launch(("filesrc name=file ! matroskademux name=demux " + line).c_str(), &error));
    if (error) {
      const std::string reason = error->message;
      g_error_free(error);
      throw Error(film + ": " + reason);
    }
    const Element file(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "file"), gst_object_unref);
    g_object_set(file.get(), "location", film.c_str(), nullptr);
    sink_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "sink"));
    text_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "text"));
    gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
  }
  ~Reading() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Reading(const Reading&) = delete;

  // The next sample; null at the end. Throws Error for what went wrong.
  Sample next() {
    for (;;) {
      Sample sample(gst_app_sink_try_pull_sample(GST_APP_SINK(sink_.get()), GST_SECOND / 5), gst_sample_unref);
      if (sample) return sample;
      if (const std::string reason = posted_error(pipeline_.get(), 0, ""); !reason.empty())
        throw Error(film_ + ": " + reason);
      if (gst_app_sink_is_eos(GST_APP_SINK(sink_.get()))) return sample;
    }
  }
  // What the appsink "text" behind the queue "texts" got first; null where the film has nothing for it.
  Sample text() {
    const Element queue(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "texts"), gst_object_unref);
    GstPad* pad = gst_element_get_static_pad(queue.get(), "sink");
    const bool has_text = gst_pad_is_linked(pad);
    gst_object_unref(pad);
    return Sample(has_text ? gst_app_sink_try_pull_sample(GST_APP_SINK(text_.get()), 5 * GST_SECOND) : nullptr,
                  gst_sample_unref);
  }

 private:
  const std::string film_;
  Element pipeline_{nullptr, gst_object_unref}, sink_{nullptr, gst_object_unref}, text_{nullptr, gst_object_unref};
};

// What a film has, without a look at its pictures.
struct Contents {
  bool is_jpeg = false;
  size_t frames = 0;
  GstClockTime end = 0;  // of the last frame
  std::string begins;    // what its text track says, "" without one
};

std::string text_of(const Sample& sample) {
  GstMapInfo map;
  GstBuffer* buffer = gst_sample_get_buffer(sample.get());
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) return "";
  std::string text(reinterpret_cast<const char*>(map.data), map.size);
  gst_buffer_unmap(buffer, &map);
  return text;
}

Contents contents_of(const std::string& film) {
  Contents contents;
  Reading reading(film, "demux.video_0 ! appsink name=sink sync=false max-buffers=16 "
                        "demux.subtitle_0 ! queue name=texts ! appsink name=text sync=false async=false");
  while (const Sample sample = reading.next()) {
    const GstBuffer* frame = gst_sample_get_buffer(sample.get());
    const GstClockTime time = time_of(sample.get());
    if (contents.frames++ == 0)
      contents.is_jpeg =
          gst_structure_has_name(gst_caps_get_structure(gst_sample_get_caps(sample.get()), 0), "image/jpeg");
    contents.end = std::max(contents.end, GST_BUFFER_DURATION_IS_VALID(frame) ? time + GST_BUFFER_DURATION(frame) : time);
  }
  if (contents.frames == 0) throw Error(film + ": has no pictures");
  if (const Sample text = reading.text()) contents.begins = text_of(text);
  return contents;
}

std::string problem_of(const CameraFile& file, const std::string& otherwise) {
  const std::optional<CameraFile::Problem> problem = file.problem();
  return problem ? problem->text : otherwise;
}

// Writes pictures of the decoded film into `file`, H.264; returns how many.
size_t encode(const std::string& film, const Contents& contents, int quantizer, CameraFile& file,
              const std::string& out, const std::function<void(double)>& told) {
  Reading reading(film, kDecodedJpeg + "x264enc pass=qual quantizer=" + std::to_string(quantizer) +
                            " key-int-max=" + std::to_string(kKeyFrames) +
                            " bframes=0 threads=1 ! video/x-h264,profile=main,stream-format=byte-stream,alignment=au ! " +
                            kSink);
  size_t frames = 0;
  while (const Sample sample = reading.next()) {
    GstBuffer* frame = gst_sample_get_buffer(sample.get());
    while (file.is_behind(gst_buffer_get_size(frame)) && !file.problem()) g_usleep(2000);
    if (file.add(frame, gst_sample_get_caps(sample.get()), time_of(sample.get()), contents.begins) !=
        CameraFile::Added::kTaken)
      throw Error(problem_of(file, out + ": can't be written"));
    told(static_cast<double>(++frames) / static_cast<double>(contents.frames));
  }
  file.end(contents.end);
  file.close(g_get_monotonic_time() + kPatience);
  if (file.problem()) throw Error(problem_of(file, ""));
  return frames;
}

class Picture {
 public:
  Picture(const Sample& sample, const std::string& film) {
    GstVideoInfo info;
    if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
        !gst_video_frame_map(&frame_, &info, gst_sample_get_buffer(sample.get()), GST_MAP_READ))
      throw Error(film + ": a picture can't be read");
  }
  ~Picture() { gst_video_frame_unmap(&frame_); }
  Picture(const Picture&) = delete;

  int width() const { return GST_VIDEO_FRAME_WIDTH(&frame_); }
  int height() const { return GST_VIDEO_FRAME_HEIGHT(&frame_); }
  const uint8_t* luma(int y) const {
    return static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame_, 0)) +
           static_cast<ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, 0);
  }

 private:
  GstVideoFrame frame_;
};

// Sum of squared differences of luma.
double squares_between(const Picture& a, const Picture& b) {
  uint64_t sum = 0;
  for (int y = 0; y < a.height(); y++) {
    const uint8_t *one = a.luma(y), *other = b.luma(y);
    for (int x = 0; x < a.width(); x++) sum += static_cast<uint64_t>((one[x] - other[x]) * (one[x] - other[x]));
  }
  return static_cast<double>(sum);
}

// Of all pictures, which must be as many, at the same times.
void compare(const std::string& film, const std::string& out, ArchivedFilm& archived,
             const std::function<void(double)>& told) {
  Reading before(film, kDecodedJpeg + kSink), after(out, kDecoded + kSink);
  for (uint64_t i = 0;; i++) {
    const Sample a = before.next(), b = after.next();
    if (!a && !b && i == archived.frames) return;
    const std::string place = out + ": picture " + std::to_string(i);
    if (!a || !b) throw Error(place + " is missing");
    const auto apart = static_cast<int64_t>(time_of(a.get()) - time_of(b.get()));
    if (std::abs(apart) > static_cast<int64_t>(kTicks)) throw Error(place + " has another time");
    const Picture one(a, film), other(b, out);
    if (one.width() != other.width() || one.height() != other.height()) throw Error(place + " has another size");
    archived.squares += squares_between(one, other);
    archived.pixels += static_cast<uint64_t>(one.width()) * static_cast<uint64_t>(one.height());
    told(static_cast<double>(i + 1) / static_cast<double>(archived.frames));
  }
}

}  // namespace

double ArchivedFilm::psnr() const {
  return squares > 0 ? 10 * std::log10(255 * 255 * static_cast<double>(pixels) / squares) : INFINITY;
}

ArchivedFilm archive_film(const Camera& camera, const std::string& film, const std::string& out, int quantizer,
                          const std::function<void(double)>& told) {
  constexpr double kEncoding = 0.7;  // of the time
  const Contents contents = contents_of(film);
  ArchivedFilm archived{.bytes_before = fs::file_size(film)};
  if (!contents.is_jpeg) {
    copy_file(film, out);
    archived.is_copy = true;
    archived.frames = contents.frames;
  } else {
    CameraFile file(camera, out, kMostBytes);
    archived.frames = encode(film, contents, quantizer, file, out, [&](double share) { told(kEncoding * share); });
    archived.unreadable = contents.frames - archived.frames;
    if (archived.frames == 0) throw Error(film + ": none of its pictures can be read");
    compare(film, out, archived, [&](double share) { told(kEncoding + (1 - kEncoding) * share); });
  }
  archived.bytes_after = fs::file_size(out);
  told(1);
  return archived;
}

}  // namespace lf::archive
