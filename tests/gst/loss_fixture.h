// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/camera_files.h"

namespace lf::test {

// A fake capture device that fails on command: failing://0 to failing://63, live grey pictures of 64x48 in I420 at 30
// frames/s. Replaces v4l2:// cameras with loose cables.
struct FailingDevice {
  std::atomic<bool> broken = false;     // error with the next frame, or when opened
  std::atomic<bool> ends = false;       // EOS with the next frame
  std::atomic<bool> stalls = false;     // no more frames and no error
  std::atomic<int> frames_at_most = 0;  // frames each time the device is opened, before an error; 0: unlimited
  std::atomic<int> opened = 0;
};

inline FailingDevice& failing_device(size_t id) {
  static std::array<FailingDevice, 64> devices;
  return devices.at(id);
}

inline void reset_failing_devices() {
  for (size_t id = 0; id < 64; id++) {
    FailingDevice& device = failing_device(id);
    device.broken = device.ends = device.stalls = false;
    device.frames_at_most = device.opened = 0;
  }
}

// Call once, after gst_init().
void register_failing_camera();

class BusLog {
 public:
  explicit BusLog(GstElement* pipeline) : pipeline_(pipeline), bus_(gst_element_get_bus(pipeline)) {
    gst_bus_set_sync_handler(bus_.get(), on_message, this, nullptr);
  }
  ~BusLog() { gst_bus_set_sync_handler(bus_.get(), nullptr, nullptr, nullptr); }
  BusLog(const BusLog&) = delete;

  int lost(guint camera) const { return copy(lost_)[camera]; }
  int found(guint camera) const { return copy(found_)[camera]; }
  std::string reason(guint camera) const { return copy(reasons_)[camera]; }
  std::vector<std::string> warnings() const { return copy(warnings_); }
  // Returns the warnings about losses: slow machines cause other warnings.
  std::vector<std::string> losses() const {
    std::vector<std::string> texts = warnings();
    std::erase_if(texts, [](const std::string& text) { return !contains(text, "out of service"); });
    return texts;
  }
  std::vector<std::string> errors() const { return copy(errors_); }
  bool has_ended() const { return ended_; }
  // How often all cameras were reported lost, and the latest reason.
  int no_camera_count() const { return no_camera_count_; }
  std::string no_camera_reason() const { return copy(no_camera_reason_); }
  size_t out_of_service() const { return out_of_service_; }

 private:
  template <typename T>
  T copy(const T& value) const {
    std::lock_guard lock(mutex_);
    return value;
  }
  static GstBusSyncReply on_message(GstBus*, GstMessage* message, gpointer data) {
    auto* self = static_cast<BusLog*>(data);
    std::lock_guard lock(self->mutex_);
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING) self->warnings_.push_back(text_of(message));
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) self->errors_.push_back(text_of(message));
    const GstStructure* structure =
        GST_MESSAGE_TYPE(message) == GST_MESSAGE_ELEMENT ? gst_message_get_structure(message) : nullptr;
    guint camera = 0;
    if (structure && gst_structure_get_uint(structure, "camera", &camera)) {
      if (gst_structure_has_name(structure, "lightfield-camera-lost")) {
        self->lost_[camera]++;
        self->reasons_[camera] = gst_structure_get_string(structure, "reason");
      }
      if (gst_structure_has_name(structure, "lightfield-camera-found")) self->found_[camera]++;
    }
    if (structure && gst_structure_has_name(structure, "lightfield-all-cameras-lost")) {
      self->no_camera_reason_ = gst_structure_get_string(structure, "reason");
      self->no_camera_count_++;
    }
    if (structure && gst_structure_has_name(structure, "lightfield-out-of-service"))
      self->out_of_service_ = gst_value_array_get_size(gst_structure_get_value(structure, "cameras"));
    // Applications recalculate the latency.
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_LATENCY)
      gst_element_call_async(
          self->pipeline_, [](GstElement* bin, gpointer) { gst_bin_recalculate_latency(GST_BIN(bin)); }, nullptr,
          nullptr);
    self->ended_ = self->ended_ || GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS;
    gst_message_unref(message);
    return GST_BUS_DROP;
  }

  GstElement* pipeline_;
  const BusPtr bus_;
  mutable std::mutex mutex_;
  std::map<guint, int> lost_, found_;
  std::map<guint, std::string> reasons_;
  std::vector<std::string> warnings_, errors_;
  std::string no_camera_reason_;
  std::atomic<int> no_camera_count_ = 0;
  std::atomic<size_t> out_of_service_ = 0;
  std::atomic<bool> ended_ = false;
};

// Stats of a camera: an entry of `cameras` in a node's stats, or (without an id) all of lfcamsrc's stats.
struct CameraStats {
  std::string state, reason;
  uint64_t losses = 0, retries = 0, dropped = 0;
};
inline CameraStats camera_stats(GstElement* element, int id = -1) {
  const StructurePtr all = stats_of(element);
  const GstStructure* one = all.get();
  if (id >= 0) {
    const auto inner = [](const GstStructure* outer, const std::string& name) {
      const GValue* value = gst_structure_get_value(outer, name.c_str());
      return value ? gst_value_get_structure(value) : nullptr;
    };
    one = inner(all.get(), "cameras");
    if (one) one = inner(one, "camera-" + std::to_string(id));
  }
  CameraStats stats;
  if (!one) {
    ADD_FAILURE() << "no stats of camera " << id;
    return stats;
  }
  stats.state = gst_structure_get_string(one, "state");
  stats.reason = gst_structure_get_string(one, "reason");
  EXPECT_TRUE(gst_structure_get_uint64(one, "losses", &stats.losses));
  EXPECT_TRUE(gst_structure_get_uint64(one, "retries", &stats.retries));
  EXPECT_TRUE(gst_structure_get_uint64(one, "dropped", &stats.dropped));
  return stats;
}

struct OwnPipeline {
  PipelinePtr pipeline;
};

class WatchedPipeline : OwnPipeline, public BusLog {
 public:
  explicit WatchedPipeline(const std::string& line, GstState state = GST_STATE_PLAYING)
      : OwnPipeline{launch(line)}, BusLog(get()) {
    if (state != GST_STATE_NULL) set_state(state);
  }
  ~WatchedPipeline() { set_state(GST_STATE_NULL); }

  GstElement* get() const { return pipeline.get(); }
  ElementPtr child(const std::string& name) const { return child_of(get(), name); }
  CameraStats camera(int id) const { return camera_stats(child("n").get(), id); }
  GstStateChangeReturn set_state(GstState state) const { return gst_element_set_state(get(), state); }
  void stop() const {
    set_state(GST_STATE_NULL);
    EXPECT_EQ(errors(), std::vector<std::string>());
  }
};

class LossTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    register_failing_camera();
    files = new CameraFiles;
  }
  static void TearDownTestSuite() {
    delete files;
    files = nullptr;
  }
  void SetUp() override { reset_failing_devices(); }

  // Saves a rig of `count` cameras; `source` returns the source of each camera.
  static std::string rig(int count, const std::function<std::string(guint)>& source) {
    return files->save("loss.json", count, [&](Camera& camera) { camera.source = source(camera.id); });
  }
  // Untrusted rigs must not use this URI scheme.
  static std::string devices(int count) {
    return rig(count, [](guint id) { return "failing://" + std::to_string(id); });
  }
  // Returns a launch line with a live node and `viewers` viewers.
  static std::string line(const std::string& rig, int viewers = 1, const std::string& node = "is-live=true loop=true") {
    std::string text =
        "funnel name=f ! tee name=r  r. ! queue leaky=downstream ! n.request lfcameranode name=n trusted=true rig=" +
        rig + " " + node + " ! tee name=t";
    for (int i = 0; i < viewers; i++) {
      const std::string n = std::to_string(i);
      text += " lfviewrequest rig=" + rig + " view-id=" + n +
              " is-live=true framerate=15/1 width=64 height=48 capture-delay=200000000 ! f."
              " r. ! queue leaky=downstream ! c" +
              n + ".request  t. ! queue leaky=downstream ! c" + n + ".sink_0  lfcompositor latency=150000000 name=c" +
              n + " rig=" + rig + " view-id=" + n + " ! fakesink name=s" + n + " sync=false async=false";
    }
    return text;
  }
  static inline CameraFiles* files = nullptr;
};

// Counts the pictures of a sink and measures the longest interval between two.
class Pictures {
 public:
  explicit Pictures(const WatchedPipeline& pipeline, const char* sink = "s0")
      : pad_(pad_of(pipeline.child(sink).get(), "sink")) {
    probe_ = gst_pad_add_probe(
        pad_.get(), GST_PAD_PROBE_TYPE_BUFFER,
        [](GstPad*, GstPadProbeInfo*, gpointer data) {
          auto* self = static_cast<Pictures*>(data);
          const gint64 now = g_get_monotonic_time();
          if (self->count_++ > 0 && now - self->last_ > self->pause_) self->pause_ = now - self->last_;
          self->last_ = now;
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
  }
  ~Pictures() { gst_pad_remove_probe(pad_.get(), probe_); }
  Pictures(const Pictures&) = delete;

  int count() const { return count_; }
  bool has_more(int more) const {
    return eventually([&, then = count()] { return count() > then + more; });
  }
  int longest_pause() const { return static_cast<int>(pause_ / 1000); }
  void forget_pause() { pause_ = 0; }

 private:
  const PadPtr pad_;
  gulong probe_;
  std::atomic<int> count_ = 0;
  std::atomic<gint64> last_ = 0, pause_ = 0;
};

}  // namespace lf::test
