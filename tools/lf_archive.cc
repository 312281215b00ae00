// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-archive: transcodes the films of a recording to H.264.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "base/file.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "command_line.h"
#include "progress.h"
#include "recording/camera_file.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "sample_reader.h"
#include "terminal.h"

namespace fs = std::filesystem;

namespace lf::archive {
namespace {

struct ArchivedFilm {
  uint64_t frames = 0;
  uint64_t unreadable = 0;  // frames that cannot be decoded and are left out
  uint64_t bytes_before = 0, bytes_after = 0;
  bool is_copy = false;  // true if the film is not Motion JPEG and was copied unchanged
  double squares = 0;    // sum of squared luma differences between both films
  uint64_t pixels = 0;

  // Returns the PSNR of luma in dB; infinite if both films are equal.
  double psnr() const;
};

double ArchivedFilm::psnr() const {
  return squares > 0 ? 10 * std::log10(255 * 255 * static_cast<double>(pixels) / squares) : INFINITY;
}

// interval of key frames, in frames; a seek decodes at most this many
constexpr int kKeyFrames = 30;
constexpr guint64 kMaxBytes = 8 << 20;
constexpr gint64 kPatience = 600 * G_USEC_PER_SEC;  // maximum time to write the remaining data at the end, microseconds
// maximum rounding of times in both files together, nanoseconds; see CameraFile
constexpr GstClockTime kTicks = 30'000;

const std::string kAsImage = " ! videoconvert ! video/x-raw,format=I420,colorimetry=1:4:0:0,chroma-site=jpeg ! ";
const std::string kDecodedJpeg = "demux.video_0 ! jpegdec idct-method=islow" + kAsImage;
const std::string kDecoded = "demux.video_0 ! decodebin" + kAsImage;
const std::string kSink = "appsink name=sink sync=false max-buffers=4";

using Sample = SampleReader::Sample;

GstClockTime time_of(GstSample* sample) {
  return gst_segment_to_stream_time(gst_sample_get_segment(sample), GST_FORMAT_TIME,
                                    GST_BUFFER_PTS(gst_sample_get_buffer(sample)));
}

// Reads a film. `line` is a launch line that continues after a demuxer named "demux" and contains the appsink "sink".
class Reading : public SampleReader {
 public:
  Reading(const std::string& film, const std::string& line)
      : SampleReader("filesrc name=file ! matroskademux name=demux " + line, film) {
    g_object_set(child("file").get(), "location", film.c_str(), nullptr);
    start();
  }
};

// Returns the first sample of the text track, from the appsink "text" behind the queue "texts". Returns null if the
// film has no text track.
Sample first_text(const Reading& reading) {
  g_autoptr(GstPad) pad = gst_element_get_static_pad(reading.child("texts").get(), "sink");
  if (!gst_pad_is_linked(pad)) return nullptr;
  return Sample(gst_app_sink_try_pull_sample(GST_APP_SINK(reading.child("text").get()), 5 * GST_SECOND));
}

struct Contents {
  bool is_jpeg = false;
  size_t frames = 0;
  GstClockTime end = 0;
  std::string begins;
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
  Reading reading(film,
                  "demux.video_0 ! appsink name=sink sync=false max-buffers=16 "
                  "demux.subtitle_0 ! queue name=texts ! appsink name=text sync=false async=false");
  while (const Sample sample = reading.next()) {
    const GstBuffer* frame = gst_sample_get_buffer(sample.get());
    const GstClockTime time = time_of(sample.get());
    if (contents.frames++ == 0)
      contents.is_jpeg =
          gst_structure_has_name(gst_caps_get_structure(gst_sample_get_caps(sample.get()), 0), "image/jpeg");
    contents.end =
        std::max(contents.end, GST_BUFFER_DURATION_IS_VALID(frame) ? time + GST_BUFFER_DURATION(frame) : time);
  }
  if (contents.frames == 0) throw Error(film + ": contains no video frames, so there is nothing to archive");
  if (const Sample text = first_text(reading)) contents.begins = text_of(text);
  return contents;
}

std::string problem_of(const CameraFile& file, const std::string& otherwise) {
  const std::optional<CameraFile::Problem> problem = file.problem();
  return problem ? problem->text : otherwise;
}

size_t encode(const std::string& film, const Contents& contents, int quantizer, CameraFile& file,
              const std::string& out, const std::function<void(double)>& on_progress) {
  Reading reading(
      film, kDecodedJpeg + "x264enc pass=qual quantizer=" + std::to_string(quantizer) +
                " key-int-max=" + std::to_string(kKeyFrames) +
                " bframes=0 threads=1 ! video/x-h264,profile=main,stream-format=byte-stream,alignment=au ! " + kSink);
  size_t frames = 0;
  while (const Sample sample = reading.next()) {
    GstBuffer* frame = gst_sample_get_buffer(sample.get());
    while (file.is_behind(gst_buffer_get_size(frame)) && !file.problem()) g_usleep(2000);
    if (file.add(frame, gst_sample_get_caps(sample.get()), time_of(sample.get()), contents.begins) !=
        CameraFile::AddResult::kTaken)
      throw Error(problem_of(file, out + ": can't be written"));
    on_progress(static_cast<double>(++frames) / static_cast<double>(contents.frames));
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
      throw Error(film + ": a decoded frame cannot be read");
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

double squares_between(const Picture& a, const Picture& b) {
  uint64_t sum = 0;
  for (int y = 0; y < a.height(); y++) {
    const uint8_t *one = a.luma(y), *other = b.luma(y);
    for (int x = 0; x < a.width(); x++) sum += static_cast<uint64_t>((one[x] - other[x]) * (one[x] - other[x]));
  }
  return static_cast<double>(sum);
}

void compare(const std::string& film, const std::string& out, ArchivedFilm& archived,
             const std::function<void(double)>& on_progress) {
  Reading before(film, kDecodedJpeg + kSink), after(out, kDecoded + kSink);
  for (uint64_t i = 0;; i++) {
    const Sample a = before.next(), b = after.next();
    if (!a && !b && i == archived.frames) return;
    const std::string place = out + ": picture " + std::to_string(i);
    if (!a || !b) throw Error(place + " is missing in the archived film");
    const auto apart = static_cast<int64_t>(time_of(a.get()) - time_of(b.get()));
    if (std::abs(apart) > static_cast<int64_t>(kTicks))
      throw Error(place + " has a different time than in the original film");
    const Picture one(a, film), other(b, out);
    if (one.width() != other.width() || one.height() != other.height())
      throw Error(place + " has a different size than in the original film");
    archived.squares += squares_between(one, other);
    archived.pixels += static_cast<uint64_t>(one.width()) * static_cast<uint64_t>(one.height());
    on_progress(static_cast<double>(i + 1) / static_cast<double>(archived.frames));
  }
}

// Archives a camera's Matroska film as `out`. Motion JPEG is transcoded to H.264 of constant quality (`quantizer` of
// x264: 1 is best, 51 is worst), with a key frame every kKeyFrames frames or less. Frame times, end time and the time
// of day of the start are preserved. Films in other formats are copied unchanged. Then decodes both films and compares
// their frames.
//
// `on_progress` receives the progress (0 to 1) on the calling thread. Requires gst_init(). Throws Error that names the
// file if a file cannot be read or written, an element is missing, or a frame of `out` is missing or has another time.
ArchivedFilm archive_film(const Camera& camera, const std::string& film, const std::string& out, int quantizer,
                          const std::function<void(double)>& on_progress) {
  constexpr double kEncoding = 0.7;
  const Contents contents = contents_of(film);
  ArchivedFilm archived{.bytes_before = fs::file_size(film)};
  if (!contents.is_jpeg) {
    copy_file(film, out);
    archived.is_copy = true;
    archived.frames = contents.frames;
  } else {
    CameraFile file(camera, out, kMaxBytes);
    archived.frames =
        encode(film, contents, quantizer, file, out, [&](double share) { on_progress(kEncoding * share); });
    archived.unreadable = contents.frames - archived.frames;
    if (archived.frames == 0) throw Error(film + ": none of its frames can be decoded");
    compare(film, out, archived, [&](double share) { on_progress(kEncoding + (1 - kEncoding) * share); });
  }
  archived.bytes_after = fs::file_size(out);
  on_progress(1);
  return archived;
}

}  // namespace
}  // namespace lf::archive

namespace {

using lf::archive::ArchivedFilm;

struct Options {
  std::string recording, out;
  int quantizer = 18;
};

std::string rig_path(const std::string& recording) {
  return fs::is_directory(recording) ? (fs::path(recording) / "rig.json").string() : recording;
}

std::string film_of(const lf::Rig& rig, const lf::Camera& camera) {
  const std::string film = rig.resolve(camera.source);
  if (!fs::is_regular_file(film))
    throw lf::Error("camera " + std::to_string(camera.id) + ": its source is not an existing file" +
                    (camera.source.empty() ? "" : " (" + film + ")") + "; only recordings can be archived");
  return film;
}

double megabytes(uint64_t bytes) { return static_cast<double>(bytes) / 1e6; }

std::vector<ArchivedFilm> archive_films(const lf::Rig& rig, const std::vector<std::string>& films,
                                        const lf::Rig& archived, const std::string& folder, int quantizer) {
  std::vector<ArchivedFilm> results(films.size());
  Progress bar("archiving", 0);
  std::mutex mutex;
  double done = 0;
  const unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  lf::WorkerPool::shared()->run(threads, films.size(), [&](size_t i) {
    double last = 0;
    results[i] =
        lf::archive::archive_film(rig.cameras[i], films[i], (fs::path(folder) / archived.cameras[i].source).string(),
                                  quantizer, [&](double share) {
                                    const std::lock_guard lock(mutex);
                                    done += share - last;
                                    last = share;
                                    bar.reach(done / static_cast<double>(films.size()));
                                  });
  });
  return results;
}

void print(const lf::Rig& rig, const std::vector<ArchivedFilm>& films, const std::string& out) {
  ArchivedFilm all;
  double worst = INFINITY;
  for (size_t i = 0; i < films.size(); i++) {
    const ArchivedFilm& film = films[i];
    terminal::print("%s: %llu frames, %.3f -> %.3f MB, ", rig.cameras[i].label().c_str(),
                    static_cast<unsigned long long>(film.frames), megabytes(film.bytes_before),
                    megabytes(film.bytes_after));
    if (film.is_copy)
      terminal::print("copied unchanged (not Motion JPEG)\n");
    else
      terminal::print("%.2f dB\n", film.psnr());
    if (film.unreadable > 0)
      terminal::print("  %llu frames could not be decoded and are left out\n",
                      static_cast<unsigned long long>(film.unreadable));
    all.bytes_before += film.bytes_before;
    all.bytes_after += film.bytes_after;
    all.squares += film.squares;
    all.pixels += film.pixels;
    if (!film.is_copy) worst = std::min(worst, film.psnr());
  }
  terminal::print("%s: %.2f MB -> %.2f MB, %.2f times smaller", out.c_str(), megabytes(all.bytes_before),
                  megabytes(all.bytes_after),
                  static_cast<double>(all.bytes_before) / static_cast<double>(all.bytes_after));
  if (all.pixels > 0) terminal::print(", %.2f dB of luma (the worst camera %.2f)", all.psnr(), worst);
  terminal::print("\n");
}

// The rig file is written last, so that an incomplete folder does not look like a recording.
void run(const Options& options) {
  gst_init(nullptr, nullptr);
  const std::string path = rig_path(options.recording), out = (fs::path(options.out) / "rig.json").string();
  const lf::Rig rig = lf::load_rig(path);
  if (fs::exists(out))
    throw lf::Error(out + ": contains a recording already; choose another folder, or remove the recording first");
  std::vector<std::string> films;
  for (const lf::Camera& camera : rig.cameras) films.push_back(film_of(rig, camera));
  lf::AtomicFolderUpdate update(options.out);
  lf::Rig archived = rig;
  lf::rebase_paths(archived, fs::weakly_canonical(options.out).string());
  for (lf::Camera& camera : archived.cameras) camera.source = "camera" + std::to_string(camera.id) + ".mkv";
  const std::vector<ArchivedFilm> results = archive_films(rig, films, archived, update.staging(), options.quantizer);
  update.commit();
  lf::save_rig_like(path, archived, out);
  print(rig, results, options.out);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Transcodes a recording from Motion JPEG to H.264 to save disk space. All frames keep their times, so the result "
      "plays like the original recording. Prints the file sizes and the PSNR of luma.",
      "lf-archive");
  app.add_option("RECORDING", o.recording,
                 "Folder or rig file of a recording. A rig file with Matroska films as sources works, too")
      ->required()
      ->check(cli::ExistingPath);
  app.add_option("--out", o.out, "Folder to write. It must not contain a recording yet")
      ->required()
      ->type_name("FOLDER");
  app.add_option("--quantizer", o.quantizer,
                 "Quantizer of x264, which sets a constant quality. Smaller values give better quality and larger "
                 "files; an increase of 6 about halves the file size")
      ->check(cli::Range(1, 51));
  return cli::run_tool(app, argc, argv, [&] { run(o); });
}
