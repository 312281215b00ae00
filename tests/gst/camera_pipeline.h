// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "../gst/common/common.h"
#include "gst/camera_files.h"
#include "support/test.h"

namespace lf::test {

inline constexpr int kFrames = CameraFiles::kFrames;
inline constexpr GstClockTime kPeriod = GST_SECOND / CameraFiles::kRate;

struct Frame {
  GstClockTime running_time;
  GstClockTime capture_time;  // GST_CLOCK_TIME_NONE: no meta
  int level;                  // first non-padding component, or luma, of the top-left pixel
  std::vector<uint8_t> first_row;
};

// A pipeline lfcamsrc ! [middle !] fakesink that records buffers and events at the sink.
class CameraPipeline {
 public:
  explicit CameraPipeline(const std::string& properties, const std::string& middle = "") {
    const std::string line = "lfcamsrc name=camera " + properties + " ! " + (middle.empty() ? "" : middle + " ! ") +
                             "fakesink name=sink sync=false enable-last-sample=false";
    pipeline_ = launch(line);
    camera_ = child_of(pipeline(), "camera");
    pad_ = pad_of(child_of(pipeline(), "sink").get(), "sink");
    constexpr auto kData =
        GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_BOTH | GST_PAD_PROBE_TYPE_EVENT_FLUSH);
    gst_pad_add_probe(pad(), kData, on_data, this, nullptr);
  }
  ~CameraPipeline() { set_state(GST_STATE_NULL); }
  CameraPipeline(const CameraPipeline&) = delete;

  GstStateChangeReturn set_state(GstState state) { return gst_element_set_state(pipeline(), state); }
  bool reach(GstState state) {
    set_state(state);
    const GstStateChangeReturn result = gst_element_get_state(pipeline(), nullptr, nullptr, 10 * GST_SECOND);
    return result == GST_STATE_CHANGE_SUCCESS || result == GST_STATE_CHANGE_NO_PREROLL;
  }
  // Returns "EOS", the text of the first error, or "timeout". Earlier warnings are in `warnings`.
  std::string wait(GstClockTime timeout = 20 * GST_SECOND) {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline());
    const gint64 end = g_get_monotonic_time() + static_cast<gint64>(timeout / GST_USECOND);
    for (;;) {
      const gint64 left = std::max<gint64>(0, end - g_get_monotonic_time());
      constexpr auto kAny = GstMessageType(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
      const MessagePtr message(gst_bus_timed_pop_filtered(bus, static_cast<GstClockTime>(left) * GST_USECOND, kAny));
      if (!message) return "timeout";
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS) return "EOS";
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) return text_of(message.get());
      warnings += text_of(message.get());
    }
  }
  std::string play() {
    set_state(GST_STATE_PLAYING);
    const std::string text = wait();
    set_state(GST_STATE_NULL);
    return text;
  }

  GstElement* pipeline() { return pipeline_.get(); }
  GstElement* camera() { return camera_.get(); }
  GstPad* pad() { return pad_.get(); }
  // Read these members only in state NULL, or while no data flows.
  std::vector<Frame> frames;
  std::vector<std::string> items;  // event names, or "buffer"
  std::string warnings;            // concatenated texts
  GstVideoInfo info{};
  guint camera_index = G_MAXUINT;
  guint64 rig_hash = 0;

 private:
  static GstPadProbeReturn on_data(GstPad* pad, GstPadProbeInfo* probe, gpointer data) {
    auto* self = static_cast<CameraPipeline*>(data);
    if (probe->type & GST_PAD_PROBE_TYPE_BUFFER) {
      self->items.push_back("buffer");
      self->take_frame(GST_PAD_PROBE_INFO_BUFFER(probe), pad);
      return GST_PAD_PROBE_OK;
    }
    if (!(probe->type & GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM)) return GST_PAD_PROBE_OK;
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(probe);
    self->items.push_back(gst_event_has_name(event, LF_CAMERA_EVENT) ? LF_CAMERA_EVENT : GST_EVENT_TYPE_NAME(event));
    if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      gst_video_info_from_caps(&self->info, caps);
    } else if (gst_event_has_name(event, LF_CAMERA_EVENT)) {
      EXPECT_TRUE(gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_STICKY);
      gst_structure_get(gst_event_get_structure(event), "camera", G_TYPE_UINT, &self->camera_index, "rig-hash",
                        G_TYPE_UINT64, &self->rig_hash, nullptr);
    }
    return GST_PAD_PROBE_OK;
  }

  void take_frame(GstBuffer* buffer, GstPad* pad) {
    const EventPtr event(gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0));
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event.get(), &segment);
    Frame frame{};
    frame.running_time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    const CapsPtr reference(gst_caps_from_string(LF_CAPTURE_TIME_CAPS));
    const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference.get());
    frame.capture_time = meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
    GstVideoFrame picture;
    ASSERT_TRUE(gst_video_frame_map(&picture, &info, buffer, GST_MAP_READ));
    frame.level = *static_cast<uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(&picture, 0));
    auto* row = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&picture, 0));
    frame.first_row.assign(row, row + GST_VIDEO_INFO_COMP_PSTRIDE(&info, 0) * info.width);
    gst_video_frame_unmap(&picture);
    frames.push_back(frame);
  }

  PipelinePtr pipeline_;
  ElementPtr camera_;
  PadPtr pad_;
};

class CamSrcTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { files = new CameraFiles; }
  static void TearDownTestSuite() {
    delete files;
    files = nullptr;
  }
  static std::string rig_with(const std::function<void(Camera&)>& edit) { return files->save("rig.json", 1, edit); }
  static std::string rig_with_source(const std::string& source) {
    return rig_with([&](Camera& camera) { camera.source = source; });
  }
  static inline CameraFiles* files = nullptr;
};

}  // namespace lf::test
