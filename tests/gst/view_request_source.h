// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "geometry/pose.h"
#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"
#include "view/navigator.h"
#include "view/view_path.h"
#include "wire/request_codec.h"

namespace lf::test {

inline constexpr GstClockTime kMs = GST_MSECOND;

// 2 x 3 cameras of 64 x 48 pixels with ids 10 to 15.
inline Rig test_rig() {
  Rig rig;
  rig.topology = {Topology::Type::kGrid, 2, 3, {}};
  for (uint32_t i = 0; i < 6; i++) {
    Camera camera;
    camera.id = 10 + i;
    camera.name = std::to_string(10 + i);
    camera.width = 64;
    camera.height = 48;
    camera.lens = Lens::pinhole(70, 31.5, 23.5);
    camera.pose = {{1 + 0.1 * (i % 3), 2 + 0.1 * (i / 3), 3}, quat_from_euler({30, -10, 0})};
    rig.cameras.push_back(camera);
  }
  return rig;
}

inline std::vector<NamedView> test_views(const std::vector<double>& times) {
  std::vector<NamedView> views;
  for (double time : times) {
    const int i = static_cast<int>(views.size());
    Viewpoint v;
    v.pose = {{0.5 * i, -0.25, 1}, quat_from_euler({5.0 * i, 1, 2})};
    v.focus_distance = 1 + i;
    views.push_back({"view_" + std::to_string(i), time, make_view(v, 32 + i, 24)});
  }
  return views;
}

struct Unit {
  ViewRequest request;
  std::vector<uint8_t> bytes;
  GstClockTime pts, duration;
};

// One lfviewrequest in a harness, with its own bus.
class Source {
 public:
  ~Source() {
    harness_.reset();
    gst_element_set_state(element(), GST_STATE_NULL);
  }
  GstElement* element() const { return element_.get(); }
  GstHarness* harness() const { return harness_.get(); }

  template <typename... Args>
  Source& set(const char* name, Args... args) {
    g_object_set(element(), name, args..., nullptr);
    return *this;
  }
  double get(const char* name) const { return test::get<double>(element(), name); }

  // For sources that are not live: needs num-buffers or a file, otherwise fills memory.
  void play() {
    harness_.reset(gst_harness_new_with_element(element(), nullptr, "src"));
    gst_harness_play(harness());
  }
  void play_live(GstClockTime clock_time = 0) {
    set("is-live", TRUE);
    harness_.reset(gst_harness_new_with_element(element(), nullptr, "src"));
    // the harness may have started it, because the element has an optional sink pad
    gst_element_set_state(element(), GST_STATE_NULL);
    gst_harness_use_testclock(harness());
    gst_harness_set_time(harness(), clock_time);
    gst_harness_play(harness());
  }

  Unit pull() {
    const BufferPtr buffer(gst_harness_pull(harness()));  // times out after a minute
    EXPECT_TRUE(buffer);
    if (!buffer) return {};
    Unit unit{{}, to_bytes(buffer.get()), GST_BUFFER_PTS(buffer.get()), GST_BUFFER_DURATION(buffer.get())};
    std::string reason;
    const auto request = wire::decode_request(unit.bytes, &reason);
    EXPECT_TRUE(request) << reason;
    unit.request = request.value_or(ViewRequest{});
    return unit;
  }
  // Live: advances the clock to the next request.
  Unit next_live() {
    pass_wait();
    return pull();
  }
  // Waits until the element waits for the clock, and advances the clock to the end of this wait.
  void pass_wait() {
    EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(harness(), 1, 30));
    EXPECT_TRUE(gst_harness_crank_single_clock_wait(harness()));
  }
  GstClockTime clock_time() const {
    g_autoptr(GstClock) clock = gst_element_get_clock(element());
    return gst_clock_get_time(clock);
  }
  bool wait_eos() { return reaches_eos(harness()); }
  bool send(GstEvent* event) { return gst_harness_push_upstream_event(harness(), event); }

  // Returns true if such a message was posted since the last call.
  bool has_message(GstMessageType type) {
    bool any = false;
    while (MessagePtr(gst_bus_pop_filtered(bus_.get(), type))) any = true;
    return any;
  }

  // Returns the first message's text, "" if there is none. GstBaseSrc posts a second error if a source fails to start.
  std::string pop_message(GstMessageType type) {
    const std::vector<std::string> texts = texts_on(bus_.get(), type);
    return texts.empty() ? "" : texts[0];
  }

 private:
  const ElementPtr element_ = make_element("lfviewrequest");
  const ElementBus bus_{element()};
  HarnessPtr harness_;
};

class FileSource : public Source {
 public:
  explicit FileSource(const std::vector<NamedView>& views) {
    save_views(views, folder_ / "views.json");
    set("location", (folder_ / "views.json").c_str());
  }

 private:
  TempDir folder_;
};

class RigSource : public Source {
 public:
  RigSource() {
    save_rig(test_rig(), folder_ / "rig.json");
    set("rig", (folder_ / "rig.json").c_str());
  }

 private:
  TempDir folder_;
};

inline void expect_near(const View& a, const View& b, const std::string& what = "") {
  EXPECT_EQ(a.width, b.width) << what;
  EXPECT_EQ(a.height, b.height) << what;
  EXPECT_NEAR(a.lens.fx(), b.lens.fx(), 1e-9) << what;
  EXPECT_LT(glm::length(a.pose.position - b.pose.position), 1e-12) << what;
  EXPECT_GT(std::abs(glm::dot(a.pose.orientation, b.pose.orientation)), 1 - 1e-14) << what;
  EXPECT_LT(glm::length(a.focus.plane.normal - b.focus.plane.normal), 1e-12) << what;
  EXPECT_NEAR(a.focus.plane.d, b.focus.plane.d, 1e-12) << what;
}

inline Viewpoint test_viewpoint() {
  Viewpoint v;
  v.pose = {{1, -2, 0.5}, quat_from_euler({35, -20, 10})};
  v.fov_y_deg = 40;
  v.focus_distance = 3;
  return v;
}

// Starts at test_viewpoint().
class TestSource : public Source {
 public:
  TestSource() {
    set("x", 1.0, "y", -2.0, "z", 0.5, "yaw", 35.0, "pitch", -20.0, "roll", 10.0, "fov", 40.0, "focus-distance", 3.0,
        "width", 320, "height", 200);
  }
};

}  // namespace lf::test
