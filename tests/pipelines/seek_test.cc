// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pictures after a seek are bit-identical to playback from the start.
#include <gst/app/gstappsink.h>

#include "gst/gst_test.h"
#include "support/photographs.h"
#include "support/run_program.h"
#include "view/navigator.h"

namespace lf::test {
namespace seek_test {

constexpr int kFrames = 20, kRate = 10;
constexpr GstClockTime kPeriod = GST_SECOND / kRate;
constexpr GstClockTime kPatience = 20 * GST_SECOND;

struct Picture {
  GstClockTime time = GST_CLOCK_TIME_NONE;  // stream time
  std::vector<uint8_t> bytes;
  bool operator==(const Picture&) const = default;
};

Picture picture_of(GstSample* sample) {
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  const GstSegment* segment = gst_sample_get_segment(sample);
  return {gst_segment_to_stream_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer)), to_bytes(buffer)};
}

// Plays a path through an array of cameras that read files.
class Player {
 public:
  explicit Player(const std::string& line, const char* sink = "s") : pipeline_(launch(line)) {
    watch(sink);
    bus_.reset(gst_element_get_bus(pipeline_.get()));
  }
  void watch(const char* sink) { sink_ = child_of(pipeline_.get(), sink); }
  void set_state(GstState state) { gst_element_set_state(pipeline_.get(), state); }

  std::optional<Picture> preroll() {
    g_autoptr(GstSample) sample = gst_app_sink_try_pull_preroll(GST_APP_SINK(sink_.get()), kPatience);
    return sample ? std::optional(picture_of(sample)) : std::nullopt;
  }
  std::vector<Picture> rest(size_t most = SIZE_MAX) {
    set_state(GST_STATE_PLAYING);
    std::vector<Picture> pictures;
    while (pictures.size() < most) {
      g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink_.get()), kPatience);
      if (!sample) break;
      pictures.push_back(picture_of(sample));
    }
    return pictures;
  }
  bool seek(GstClockTime start, int more_flags = 0, GstClockTime stop = GST_CLOCK_TIME_NONE, double rate = 1) {
    return gst_element_seek(pipeline_.get(), rate, GST_FORMAT_TIME, GstSeekFlags(GST_SEEK_FLAG_FLUSH | more_flags),
                            GST_SEEK_TYPE_SET, static_cast<gint64>(start), GST_SEEK_TYPE_SET,
                            static_cast<gint64>(stop));
  }
  bool seek_on(GstClockTime start) {
    return gst_element_seek(pipeline_.get(), 1, GST_FORMAT_TIME, GST_SEEK_FLAG_SEGMENT, GST_SEEK_TYPE_SET,
                            static_cast<gint64>(start), GST_SEEK_TYPE_NONE, -1);
  }
  bool is_eos() const { return gst_app_sink_is_eos(GST_APP_SINK(sink_.get())); }
  bool waits_for(GstMessageType type, int seconds = 20) {
    return MessagePtr(gst_bus_timed_pop_filtered(bus_.get(), seconds * GST_SECOND, type)) != nullptr;
  }
  GstElement* pipeline() const { return pipeline_.get(); }

 private:
  PipelinePtr pipeline_;
  ElementPtr sink_;
  BusPtr bus_;
};

// The parameter selects the cameras' source.
class SeekTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    static std::map<std::string, TempDir> films;  // by kind
    const std::string kind = GetParam();
    const bool exists = films.contains(kind);
    const TempDir& dir = films[kind];
    rig_ = dir / "scene/rig.json";
    views_ = dir / "views.json";
    if (exists) return;
    const std::string arguments = "--out scene --grid 2x2 --width 48 --height 36 --framerate " + std::to_string(kRate) +
                                  " --frames " + std::to_string(kFrames) + (kind == "sequence" ? " --format png" : "");
    expect_outcome(run_program("lf-scene", arguments, dir.path()), 0);
    if (kind == "scene" || kind == "stills") {
      Rig rig = load_rig(rig_);
      for (Camera& camera : rig.cameras) {
        camera.source.clear();
        if (kind == "scene") camera.image.clear();
      }
      save_rig(rig, rig_);
    }
    std::vector<View> views;
    Viewpoint v = default_viewpoint(load_rig(rig_));
    for (int i = 0; i < kFrames; i++, v.pose.position.x += 1e-3) views.push_back(make_view(v, 48, 36));
    save_views(path_of(views, 1.0 / kRate), views_);
  }
  std::string line(int nodes = 1) const {
    std::string text = "lfviewrequest framerate=" + std::to_string(kRate) + "/1 location=" + views_ +
                       " ! tee name=r  r. ! queue ! c.request" +
                       "  lfcompositor name=c ! videoconvert ! appsink name=s sync=false";
    for (int i = 0; i < nodes; i++) {
      const std::string n = std::to_string(i);
      const std::string cameras = nodes == 1 ? "" : " cameras=" + n + (i + 1 == nodes ? "-3" : "");
      text += "  r. ! queue ! n" + n + ".request  lfcameranode name=n" + n + " node=" + n + " rig=" + rig_ + cameras +
              " ! queue ! c.sink_" + n;
    }
    return text;
  }

  std::string rig_, views_;
};

TEST_P(SeekTest, PicturesAfterASeekEqualAStraightRun) {
  for (const int nodes : {1, 3}) {
    const std::vector<Picture> truth = Player(line(nodes)).rest();
    ASSERT_EQ(truth.size(), size_t{kFrames});
    for (int i = 0; i < kFrames; i++) ASSERT_EQ(truth[static_cast<size_t>(i)].time, i * kPeriod);
    const auto expect_from = [&](Player& player, size_t first, const char* what) {
      const std::optional<Picture> shown = player.preroll();
      ASSERT_TRUE(shown) << what;
      EXPECT_EQ(*shown, truth[first]) << what;
      EXPECT_TRUE(player.rest() == std::vector(truth.begin() + static_cast<ptrdiff_t>(first), truth.end())) << what;
      EXPECT_TRUE(player.is_eos()) << what;
      player.set_state(GST_STATE_PAUSED);
    };
    Player player(line(nodes));
    player.set_state(GST_STATE_PAUSED);
    ASSERT_TRUE(player.preroll());
    ASSERT_TRUE(player.seek(12 * kPeriod));
    expect_from(player, 12, "forwards");
    ASSERT_TRUE(player.seek(3 * kPeriod));
    expect_from(player, 3, "back, after the end");
    ASSERT_TRUE(player.seek(15 * kPeriod));
    ASSERT_TRUE(player.seek(0));
    expect_from(player, 0, "one seek right after the other");
    ASSERT_TRUE(player.seek(5 * kPeriod - 1, GST_SEEK_FLAG_ACCURATE));
    expect_from(player, 5, "accurate");
    ASSERT_TRUE(player.seek(0));
    player.rest(4);
    ASSERT_TRUE(player.seek(10 * kPeriod));
    expect_from(player, 10, "while playing");
  }
}

// The cameras loop and accept a seek at any position.
TEST_P(SeekTest, BinSeeksLikeItsElements) {
  const std::string loop = std::string(GetParam()) == "sequence" ? "false" : "true";  // too short at its rate
  const std::string bin = "lfviewsrc name=v node::loop=" + loop +
                          " focus=plane is-live=false framerate=" + std::to_string(kRate) + "/1 rig=" + rig_ +
                          " location=" + views_ + " ! videoconvert ! appsink name=s sync=false";
  const std::vector<Picture> truth = Player(line()).rest();
  // The pipeline sends a seek to each sink.
  for (const std::string more : {"", " v.depth_src ! fakesink sync=false"}) {
    Player player(bin + more);
    EXPECT_TRUE(player.rest() == truth) << more;
    for (const size_t from : {12, 3}) {
      player.set_state(GST_STATE_PAUSED);
      ASSERT_TRUE(player.seek(from * kPeriod));
      EXPECT_TRUE(player.rest() == std::vector(truth.begin() + static_cast<ptrdiff_t>(from), truth.end()))
          << from << more;
      EXPECT_TRUE(player.is_eos());
    }
  }
}

TEST_P(SeekTest, StopPositionEndsTheStream) {
  const std::vector<Picture> truth = Player(line()).rest();
  Player player(line());
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.preroll());
  ASSERT_TRUE(player.seek(4 * kPeriod, 0, 9 * kPeriod));
  EXPECT_TRUE(player.rest() == std::vector(truth.begin() + 4, truth.begin() + 9));
  EXPECT_TRUE(player.is_eos());
}

// Players loop without a gap: a SEGMENT_DONE message replaces EOS, and a non-flushing seek continues.
TEST_P(SeekTest, SegmentSeeksContinue) {
  const std::vector<Picture> truth = Player(line()).rest();
  Player player(line());
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.preroll());
  ASSERT_TRUE(player.seek(6 * kPeriod, GST_SEEK_FLAG_SEGMENT));
  for (int round = 0; round < 3; round++) {
    const size_t first = round == 0 ? 6 : 2;
    EXPECT_TRUE(player.rest(kFrames - first) == std::vector(truth.begin() + static_cast<ptrdiff_t>(first), truth.end()))
        << round;
    EXPECT_FALSE(player.is_eos());
    EXPECT_TRUE(player.waits_for(GST_MESSAGE_SEGMENT_DONE)) << round;
    ASSERT_TRUE(player.seek_on(2 * kPeriod));
  }
}

// A focal surface depends on earlier pictures: a seek restarts the search, so that a second run from the start is
// identical.
TEST_P(SeekTest, FocalSurfaceIsTheSameAfterASeek) {
  const auto set_rig = [this](const Player& player) {
    const ElementPtr compositor = child_of(player.pipeline(), "c");
    g_object_set(compositor.get(), "rig", rig_.c_str(), nullptr);
  };
  Player player(line());
  set_rig(player);
  const std::vector<Picture> truth = player.rest();
  ASSERT_EQ(truth.size(), size_t{kFrames});
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.seek(0));
  EXPECT_TRUE(player.rest() == truth) << "after the end";
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.seek(11 * kPeriod));
  EXPECT_EQ(player.rest().size(), size_t{kFrames - 11});
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.seek(0));
  EXPECT_TRUE(player.rest() == truth) << "after another seek";
}

TEST_P(SeekTest, ImpossibleSeeksAreRefused) {
  Player player(line());
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.preroll());
  EXPECT_FALSE(player.seek(4 * kPeriod, 0, 9 * kPeriod, -1)) << "backwards";
  EXPECT_EQ(player.rest().size(), size_t{kFrames}) << "without a change";
}

TEST_P(SeekTest, ReportsDurationAndPosition) {
  Player player(line());
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.preroll());
  gint64 duration = 0, position = -1;
  EXPECT_TRUE(gst_element_query_duration(player.pipeline(), GST_FORMAT_TIME, &duration));
  EXPECT_EQ(duration, gint64{kFrames * kPeriod});
  ASSERT_TRUE(player.seek(7 * kPeriod));
  ASSERT_TRUE(player.preroll());
  EXPECT_TRUE(gst_element_query_position(player.pipeline(), GST_FORMAT_TIME, &position));
  EXPECT_EQ(position, gint64{7 * kPeriod});
}

INSTANTIATE_TEST_SUITE_P(Sources, SeekTest, testing::Values("film", "sequence", "stills", "scene"),
                         [](const auto& info) { return std::string(info.param); });

class LostCameraSeekTest : public SeekTest {};

TEST_P(LostCameraSeekTest, OtherCamerasSeek) {
  Rig rig = load_rig(rig_);
  rig.cameras[1].width += 2;  // its frames have another size
  rig_ += ".other";
  save_rig(rig, rig_);
  Player player(line());
  player.set_state(GST_STATE_PAUSED);
  const std::optional<Picture> first = player.preroll();
  ASSERT_TRUE(first);
  EXPECT_TRUE(player.waits_for(GST_MESSAGE_WARNING));
  for (const int frame : {12, 3, 0}) {
    ASSERT_TRUE(player.seek(static_cast<GstClockTime>(frame) * kPeriod));
    const std::optional<Picture> shown = player.preroll();
    ASSERT_TRUE(shown) << frame;
    EXPECT_EQ(shown->time, static_cast<GstClockTime>(frame) * kPeriod);
  }
  EXPECT_EQ(player.rest().size(), size_t{kFrames});
  EXPECT_TRUE(player.is_eos());
}

INSTANTIATE_TEST_SUITE_P(Sources, LostCameraSeekTest, testing::Values("film", "sequence", "stills"),
                         [](const auto& info) { return std::string(info.param); });

// All viewers of a funnel seek together: each flush drops the data of every viewer.
class ViewersInAFunnelSeekTest : public SeekTest {
 protected:
  std::string viewers() const {
    std::string text =
        "funnel name=f ! tee name=r  r. ! queue max-size-time=0 ! n.request  lfcameranode name=n rig=" + rig_ +
        " ! tee name=t";
    for (const std::string id : {"0", "1", "2"})
      text += "  lfviewrequest framerate=" + std::to_string(kRate) + "/1 view-id=" + id + " location=" + views_ +
              " ! f.  r. ! queue max-size-time=0 ! c" + id + ".request  t. ! queue max-size-time=0 ! c" + id +
              ".sink_0  lfcompositor name=c" + id + " view-id=" + id + " ! videoconvert ! appsink name=s" + id +
              " sync=false";
    return text;
  }
};

TEST_P(ViewersInAFunnelSeekTest, NoViewerLosesARequest) {
  const std::vector<Picture> truth = Player(line()).rest();
  ASSERT_EQ(truth.size(), size_t{kFrames});
  Player player(viewers(), "s0");
  for (const char* stage : {"before the first picture", "paused", "while playing", "after the end"}) {
    for (const size_t from : {12, 3}) {
      SCOPED_TRACE(std::string(stage) + ", from " + std::to_string(from));
      player.set_state(GST_STATE_PAUSED);
      if (stage[0] != 'b') {
        ASSERT_EQ(gst_element_get_state(player.pipeline(), nullptr, nullptr, kPatience), GST_STATE_CHANGE_SUCCESS);
      }
      if (stage[0] == 'w') player.rest(4);
      if (stage[0] == 'a') player.rest();
      ASSERT_TRUE(player.seek(from * kPeriod));
      for (const char* sink : {"s0", "s1", "s2"}) {
        player.watch(sink);
        EXPECT_TRUE(player.rest() == std::vector(truth.begin() + static_cast<ptrdiff_t>(from), truth.end())) << sink;
        EXPECT_TRUE(player.is_eos()) << sink;
      }
      player.set_state(GST_STATE_NULL);
      player.watch("s0");
    }
  }
}

// Still cameras only: file sources have one playback position for all viewers.
INSTANTIATE_TEST_SUITE_P(Sources, ViewersInAFunnelSeekTest, testing::Values("stills"),
                         [](const auto& info) { return std::string(info.param); });

class PauseTest : public SeekTest {};

// Each request waits for the focal surface of the previous one, for any length of the pause.
TEST_P(PauseTest, PicturesDoNotDependOnTheLengthOfAPause) {
  const std::string with_rig =
      line().replace(line().find("lfcompositor name=c"), 19, "lfcompositor name=c rig=" + rig_);
  const std::vector<Picture> truth = Player(with_rig).rest();
  ASSERT_EQ(truth.size(), size_t{kFrames});
  Player player(with_rig);
  player.set_state(GST_STATE_PAUSED);
  ASSERT_TRUE(player.preroll());
  g_usleep(6500000);
  EXPECT_TRUE(player.rest() == truth);
}

INSTANTIATE_TEST_SUITE_P(Sources, PauseTest, testing::Values("film"));

// Recorded answers do not follow a seek, although the requests would.
TEST(SeekRefused, IfAnswersComeFromElsewhere) {
  const PipelinePtr pipeline = launch(
      "lfviewrequest num-buffers=3 ! c.request  appsrc caps=application/x-lightfield-answer ! c.sink_0  "
      "lfcompositor name=c ! fakesink async=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  EXPECT_FALSE(gst_element_seek_simple(pipeline.get(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SECOND));
}

}  // namespace seek_test
}  // namespace lf::test
