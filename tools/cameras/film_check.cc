// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lf_rig.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>

#include <gst/gst.h>

#include "base/text.h"
#include "common/codecs.h"
#include "image/image_file.h"
#include "rig/camera_source.h"
#include "rig/film_length.h"
#include "rig/source_security.h"

namespace lf::cameras {
namespace {

constexpr uintmax_t kMaxBytes = uintmax_t{1} << 30;  // a disk reads this in about ten seconds

struct FrameCounter {
  std::mutex mutex;
  GstPad* pad = nullptr;  // the first video pad; only compared
  size_t frames = 0;
  bool skips = false;  // the file needs an element that may do more than read the file
  GstClockTime first = GST_CLOCK_TIME_NONE, last = 0;

  bool take(GstPad* candidate) {
    g_autoptr(GstCaps) caps = gst_pad_get_current_caps(candidate);
    if (!caps) return false;
    const char* name = gst_structure_get_name(gst_caps_get_structure(caps, 0));
    const bool video = g_str_has_prefix(name, "video/") || g_str_has_prefix(name, "image/");
    const std::lock_guard lock(mutex);
    if (!video || pad) return false;
    pad = candidate;
    return true;
  }

  static GstPadProbeReturn count(GstPad*, GstPadProbeInfo* info, gpointer data) {
    auto* self = static_cast<FrameCounter*>(data);
    const std::lock_guard lock(self->mutex);
    self->frames++;
    const GstClockTime time = GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info));
    if (!GST_CLOCK_TIME_IS_VALID(time)) return GST_PAD_PROBE_OK;
    self->first = std::min(self->first, time);
    self->last = std::max(self->last, time);
    return GST_PAD_PROBE_OK;
  }
};

// A playlist must not open connections. Returns a GstAutoplugSelectResult, which has no public header.
int select_element(GstElement*, GstPad*, GstCaps*, GstElementFactory* factory, gpointer data) {
  constexpr int kTry = 0, kSkip = 2;
  if (is_trusted_element(GST_OBJECT_NAME(factory))) return kTry;
  auto* counter = static_cast<FrameCounter*>(data);
  const std::lock_guard lock(counter->mutex);
  counter->skips = true;
  return kSkip;
}

void on_pad(GstElement* parser, GstPad* pad, gpointer data) {
  GstElement* sink = gst_element_factory_make("fakesink", nullptr);
  if (!sink) return;
  g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
  GstObject* pipeline = gst_object_get_parent(GST_OBJECT(parser));
  gst_bin_add(GST_BIN(pipeline), sink);
  gst_object_unref(pipeline);
  g_autoptr(GstPad) in = gst_element_get_static_pad(sink, "sink");
  if (static_cast<FrameCounter*>(data)->take(pad))
    gst_pad_add_probe(in, GST_PAD_PROBE_TYPE_BUFFER, FrameCounter::count, data, nullptr);
  gst_element_sync_state_with_parent(sink);
  gst_pad_link(pad, in);
}

// Measures the length of the first video stream of a file: reads the whole file with GStreamer, without decoding.
// `timed` is true for a file with timestamps, and false for a series of JPEG images. Returns nullopt if GStreamer finds
// no frames. The result has zero frames if the file needs an element that is not allowed (rig/source_security.h).
std::optional<FilmLength> demuxed_length(const std::string& path, bool timed) {
  gst_init(nullptr, nullptr);
  GstElement* source = gst_element_factory_make("filesrc", nullptr);
  // parsebin does not split a file into JPEG images.
  const char* const name = timed ? "parsebin" : "jpegparse";
  GstElement* parser = gst_element_factory_make(name, nullptr);
  if (!source || !parser) throw Error(std::string("elements filesrc and ") + name + " are not installed");
  g_autoptr(GstElement) pipeline = GST_ELEMENT(gst_object_ref_sink(gst_pipeline_new(nullptr)));
  gst_bin_add_many(GST_BIN(pipeline), source, parser, nullptr);
  gst_element_link(source, parser);
  g_object_set(source, "location", path.c_str(), nullptr);
  FrameCounter counter;
  if (timed) {
    g_signal_connect(parser, "pad-added", G_CALLBACK(on_pad), &counter);
    g_signal_connect(parser, "autoplug-select", G_CALLBACK(select_element), &counter);
  } else {
    g_autoptr(GstPad) pad = gst_element_get_static_pad(parser, "src");
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, FrameCounter::count, &counter, nullptr);
    on_pad(parser, pad, &counter);
  }
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  constexpr GstClockTime kPatience = 120 * GST_SECOND;
  g_autoptr(GstMessage) message =
      gst_bus_timed_pop_filtered(bus, kPatience, GstMessageType(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  const bool failed = !message || GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR;
  gst_element_set_state(pipeline, GST_STATE_NULL);
  if (counter.frames == 0) return counter.skips ? std::optional<FilmLength>(FilmLength{}) : std::nullopt;
  FilmLength length{.frames = counter.frames, .is_cut_off = failed};
  const auto frames = static_cast<double>(counter.frames);
  if (timed && counter.frames > 1 && counter.last > counter.first)
    length.seconds = static_cast<double>(counter.last - counter.first) / GST_SECOND * frames / (frames - 1);
  return length;
}

}  // namespace

std::vector<RigFinding> check_still_decoders(const Rig& rig) {
  gst_init(nullptr, nullptr);
  std::vector<RigFinding> findings;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    CameraSource source;
    try {
      source = find_camera_source(rig, camera);
      if (source.kind != CameraSource::Kind::kStill || source.codec != CameraSource::Codec::kOther) continue;
      load_image_size(source.location);
    } catch (const Error&) {
      continue;  // check_rig() reports missing files and files that are no images
    }
    if (const std::string problem = still_decoding_problem(source.location); !problem.empty())
      findings.push_back(
          {RigFinding::Severity::kError, "cameras[" + std::to_string(i) + "]." +
                                             (camera.source.empty() ? "image: " : "source: ") + source.location + ": " +
                                             problem + " (lf-render can read it, but lfviewsrc and lf-serve cannot)"});
  }
  return findings;
}

std::vector<RigFinding> check_films(const Rig& rig) {
  using Kind = CameraSource::Kind;
  std::vector<Film> films;
  std::vector<RigFinding> findings;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    if (rig.cameras[i].source.empty()) continue;
    CameraSource source;
    try {
      source = find_camera_source(rig, rig.cameras[i]);
    } catch (const Error&) {
      continue;  // check_rig() reports the missing file
    }
    const std::string place = "cameras[" + std::to_string(i) + "].source: " + redacted_location(source.location);
    std::optional<FilmLength> length;
    if (source.kind == Kind::kSequence) {
      length = {.frames = static_cast<size_t>(source.count)};
    } else if (source.kind == Kind::kMatroska) {
      length = matroska_length(source.location);
    } else if (source.kind == Kind::kFile || source.kind == Kind::kJpegStream) {
      std::error_code ignored;
      if (std::filesystem::file_size(source.location, ignored) > kMaxBytes) continue;
      length = demuxed_length(source.location, source.kind == Kind::kFile);
    } else {
      continue;
    }
    if (length && length->frames > 0)
      films.push_back({place, *length});
    else if (!length)
      findings.push_back(
          {RigFinding::Severity::kWarning, place + " has no video frames: copy or record the film again"});
  }
  const std::vector<RigFinding> others = compare_film_lengths(films);
  findings.insert(findings.end(), others.begin(), others.end());
  return findings;
}

}  // namespace lf::cameras
