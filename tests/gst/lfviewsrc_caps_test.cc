// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Sizes and rates that follow downstream caps, and metas that say which view a picture shows.
#include <gmock/gmock.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include "gst/lfviewsrc_fixture.h"
#include "view/views_json.h"

namespace lf::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class LfViewSrcCapsTest : public LfViewSrcTest {
 protected:
  std::string view_source(const std::string& properties) const {
    return "lfviewsrc name=v rig=" + array_.rig_path() + " " + properties;
  }
  // Three pictures of a film: the error, or the caps of the pictures.
  std::string film(const std::string& properties, const std::string& caps, const std::string& behind = "") {
    const ElementPtr pipeline = launch(view_source("is-live=false num-buffers=3 " + properties) + " ! " + behind +
                                       caps + " ! fakesink name=s sync=false");
    if (!pipeline) return "no pipeline";
    std::string seen;
    const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
    const PadPtr pad(gst_element_get_static_pad(sink.get(), "sink"));
    const auto note = [](GstPad* of, GstPadProbeInfo*, gpointer text) {
      *static_cast<std::string*>(text) = caps_of(of);
      return GST_PAD_PROBE_OK;
    };
    gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, note, &seen, nullptr);
    const std::string error = run(pipeline.get(), kPatience);
    return error.empty() ? seen : error;
  }
  std::string caps_at(const std::string& sink) {
    const PadPtr pad(gst_element_get_static_pad(child(sink).get(), "sink"));
    return caps_of(pad.get());
  }
  void filter(const std::string& name, const std::string& caps) {
    gst_util_set_object_arg(G_OBJECT(child(name).get()), "caps", caps.c_str());
  }
};

auto is_video(int width, int height, const std::string& rate) {
  return AllOf(HasSubstr("width=(int)" + std::to_string(width)), HasSubstr("height=(int)" + std::to_string(height)),
               HasSubstr("framerate=(fraction)" + rate));
}

TEST_F(LfViewSrcCapsTest, SizeAndRateFollowDownstream) {
  EXPECT_THAT(film("", "video/x-raw,width=96,height=64,framerate=25/1"), is_video(96, 64, "25/1"));
  EXPECT_THAT(film("", "video/x-raw,width=64"), is_video(64, 48, "15/1"));
  EXPECT_THAT(film("", "video/x-raw"), is_video(ArrayFixture::kWidth, ArrayFixture::kHeight, "15/1"));
  EXPECT_THAT(film("views=row columns=3", "video/x-raw,width=96,height=32"), is_video(96, 32, "15/1"));
  EXPECT_THAT(film("", "video/x-raw,format=BGRx,width=96,height=64", "videoconvert ! "), is_video(96, 64, "15/1"));
}

TEST_F(LfViewSrcCapsTest, PropertiesThatAreSetCount) {
  EXPECT_THAT(film("width=80 framerate=10/1", "video/x-raw,height=40"), is_video(80, 40, "10/1"));
  EXPECT_THAT(film("width=80 height=60", "video/x-raw,width=96,height=64"),
              AllOf(HasSubstr("80x60"), HasSubstr("width=96,height=64"), HasSubstr("width and height at 0")));
  EXPECT_THAT(film("framerate=10/1", "video/x-raw,framerate=25/1"),
              AllOf(HasSubstr("10/1"), HasSubstr("25/1"), HasSubstr("framerate at 0/1")));
}

TEST_F(LfViewSrcCapsTest, ErrorsNameTheFormatThatIsRefused) {
  const bool is_rgb = film("", "video/x-raw").find("format=(string)I420") == std::string::npos;
  const std::string other = is_rgb ? "NV12" : "RGBA";
  EXPECT_THAT(film("", "video/x-raw,format=" + other + ",width=96,height=64,framerate=25/1"),
              AllOf(HasSubstr("accepts format=" + other), HasSubstr("videoconvert")));
}

TEST_F(LfViewSrcCapsTest, APadThatRunsOffersWhatItHas) {
  pipeline_ = launch(view_source("") + " v.src ! fakesink name=s sync=false");
  ASSERT_TRUE(pipeline_);
  count(child("s").get(), "s");
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  ASSERT_TRUE(more("s")) << error();
  const PadPtr compositor(gst_element_get_static_pad(child("compositor").get(), "src"));
  const CapsPtr offered(gst_pad_query_caps(compositor.get(), nullptr)),
      current(gst_pad_get_current_caps(compositor.get()));
  ASSERT_TRUE(current && gst_caps_can_intersect(offered.get(), current.get()));
  const bool is_rgb =
      std::string(gst_structure_get_string(gst_caps_get_structure(current.get(), 0), "format")) != "I420";
  g_autofree gchar* text = gst_caps_to_string(offered.get());
  EXPECT_THAT(text, testing::Not(HasSubstr(is_rgb ? "NV12" : "RGBA"))) << "of the other family";
  EXPECT_THAT(text, testing::Not(HasSubstr("lightfield-answer")));
}

// Rehearsals find the surface before the first picture, however seldom pictures have trials.
TEST_F(LfViewSrcCapsTest, TheFirstPictureOfAFilmIsOnItsSurface) {
  std::string shown[2];
  for (const int interval : {1, 5}) {
    const ElementPtr pipeline =
        launch(view_source("is-live=false num-buffers=1 focus=surface width=128 height=96 trial-interval=") +
               std::to_string(interval) + " ! fakesink name=s sync=false");
    ASSERT_TRUE(pipeline);
    const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
    const PadPtr pad(gst_element_get_static_pad(sink.get(), "sink"));
    const auto note = [](GstPad*, GstPadProbeInfo* info, gpointer text) {
      GstCustomMeta* meta = gst_buffer_get_custom_meta(GST_PAD_PROBE_INFO_BUFFER(info), "lightfield-view");
      const GValue* focus = meta ? gst_structure_get_value(gst_custom_meta_get_structure(meta), "focus") : nullptr;
      g_autofree gchar* written = focus ? gst_structure_to_string(gst_value_get_structure(focus)) : nullptr;
      *static_cast<std::string*>(text) = written ? written : "";
      return GST_PAD_PROBE_OK;
    };
    gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, note, &shown[interval == 1 ? 0 : 1], nullptr);
    ASSERT_EQ(run(pipeline.get(), kPatience), "");
  }
  EXPECT_THAT(shown[0], HasSubstr("surface"));
  EXPECT_EQ(shown[0], shown[1]);
}

TEST_F(LfViewSrcCapsTest, ViewsOfAFileKeepTheirSizes) {
  NamedView view;
  view.name = "one";
  view.view = array_.request(0, 0).view;
  view.view.width = 40;
  view.view.height = 20;
  const TempFile path(
      [&] {
        const std::string text = views_to_json({view});
        return std::vector<uint8_t>(text.begin(), text.end());
      }(),
      ".json");
  const std::string properties = "location=" + path.path();
  EXPECT_THAT(film(properties, "video/x-raw,framerate=25/1"), is_video(40, 20, "25/1"));
  EXPECT_THAT(film(properties, "video/x-raw,width=96,height=64"), AllOf(HasSubstr("40x20"), HasSubstr("location")));
}

TEST_F(LfViewSrcCapsTest, CapsMayChangeWhilePlaying) {
  pipeline_ = launch(view_source("") +
                     " v.src ! capsfilter name=f caps=video/x-raw,width=96,height=64,framerate=30/1 ! "
                     "fakesink name=s sync=false  "
                     "v.src_0 ! capsfilter name=g caps=video/x-raw,width=48,height=48 ! fakesink name=t sync=false");
  ASSERT_TRUE(pipeline_);
  for (const char* sink : {"s", "t"}) count(child(sink).get(), sink);
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  ASSERT_TRUE(more("s") && more("t")) << error();
  EXPECT_THAT(caps_at("s"), is_video(96, 64, "30/1"));
  EXPECT_THAT(caps_at("t"), is_video(48, 48, "15/1"));
  for (const auto& [width, rate] : {std::pair{64, "20/1"}, std::pair{128, "30/1"}, std::pair{32, "60/1"}}) {
    filter("f", "video/x-raw,width=" + std::to_string(width) + ",height=64,framerate=" + rate);
    EXPECT_TRUE(comes([&] { return testing::Value(caps_at("s"), is_video(width, 64, rate)); }))
        << width << ": " << caps_at("s") << error();
    EXPECT_TRUE(more("s")) << error();
  }
  filter("f", "video/x-raw");
  EXPECT_TRUE(comes([&] { return testing::Value(caps_at("s"), is_video(32, 24, "15/1")); })) << caps_at("s") << error();
  EXPECT_THAT(caps_at("t"), is_video(48, 48, "15/1")) << "another viewer's caps are its own";
  EXPECT_TRUE(more("t"));
}

TEST_F(LfViewSrcCapsTest, APictureSaysWhichViewItShows) {
  const std::string line = view_source("is-live=false num-buffers=2 focus=plane focus-distance=3") +
                           " ! queue ! videoconvert ! video/x-raw,format=BGRx ! queue ! fakesink name=s sync=false";
  const ElementPtr pipeline = launch(line);
  ASSERT_TRUE(pipeline);
  std::vector<StructurePtr> metas;
  const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
  const PadPtr pad(gst_element_get_static_pad(sink.get(), "sink"));
  const auto note = [](GstPad*, GstPadProbeInfo* info, gpointer all) {
    if (GstCustomMeta* meta = gst_buffer_get_custom_meta(GST_PAD_PROBE_INFO_BUFFER(info), "lightfield-view"))
      static_cast<std::vector<StructurePtr>*>(all)->emplace_back(
          gst_structure_copy(gst_custom_meta_get_structure(meta)));
    return GST_PAD_PROBE_OK;
  };
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, note, &metas, nullptr);
  ASSERT_EQ(run(pipeline.get(), kPatience), "");
  ASSERT_EQ(metas.size(), 2u);
  const GstStructure* meta = metas[1].get();
  guint sequence = 0;
  EXPECT_TRUE(gst_structure_get_uint(meta, "sequence", &sequence));
  EXPECT_EQ(sequence, 1u);
  const GValue* position = gst_structure_get_value(meta, "position");
  ASSERT_TRUE(position && gst_value_array_get_size(position) == 3);
  const ElementPtr v(gst_bin_get_by_name(GST_BIN(pipeline.get()), "v"));
  for (guint i = 0; i < 3; i++) {
    constexpr const char* kAxes[] = {"x", "y", "z"};
    gdouble at = 0;
    g_object_get(v.get(), kAxes[i], &at, nullptr);
    EXPECT_EQ(g_value_get_double(gst_value_array_get_value(position, i)), at) << kAxes[i];
  }
  ASSERT_EQ(gst_value_array_get_size(gst_structure_get_value(meta, "orientation")), 4u);
  GstStructure *lens = nullptr, *focus = nullptr;
  gboolean complete = FALSE;
  gdouble coverage = 0, distance = 0;
  ASSERT_TRUE(gst_structure_get(meta, "lens", GST_TYPE_STRUCTURE, &lens, "focus", GST_TYPE_STRUCTURE, &focus,
                                "complete", G_TYPE_BOOLEAN, &complete, "coverage", G_TYPE_DOUBLE, &coverage, nullptr))
      << gst_structure_to_string(meta);
  gint width = 0, height = 0;
  EXPECT_TRUE(gst_structure_get(lens, "width", G_TYPE_INT, &width, "height", G_TYPE_INT, &height, nullptr));
  EXPECT_EQ(width, ArrayFixture::kWidth);
  EXPECT_EQ(height, ArrayFixture::kHeight);
  EXPECT_STREQ(gst_structure_get_string(lens, "model"), "SIMPLE_PINHOLE");
  EXPECT_STREQ(gst_structure_get_string(focus, "mode"), "plane");
  EXPECT_TRUE(gst_structure_get_double(focus, "distance", &distance));
  EXPECT_NEAR(distance, 3, 1e-9);
  EXPECT_TRUE(complete);
  EXPECT_GT(coverage, 0);
  EXPECT_EQ(gst_value_array_get_size(gst_structure_get_value(meta, "missing-cameras")), 0u);
  EXPECT_EQ(gst_value_array_get_size(gst_structure_get_value(meta, "missing-nodes")), 0u);
  gst_structure_free(lens);
  gst_structure_free(focus);
}

TEST_F(LfViewSrcCapsTest, AQuiltNamesAllOfItsViews) {
  const ElementPtr pipeline = launch(view_source("is-live=false num-buffers=1 views=row columns=3 eye-distance=0.01") +
                                     " ! fakesink name=s sync=false");
  ASSERT_TRUE(pipeline);
  std::vector<double> x;
  const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
  const PadPtr pad(gst_element_get_static_pad(sink.get(), "sink"));
  const auto note = [](GstPad*, GstPadProbeInfo* info, gpointer all) {
    GstCustomMeta* meta = gst_buffer_get_custom_meta(GST_PAD_PROBE_INFO_BUFFER(info), "lightfield-view");
    const GValue* views = meta ? gst_structure_get_value(gst_custom_meta_get_structure(meta), "views") : nullptr;
    for (guint i = 0; views && i < gst_value_array_get_size(views); i++) {
      const GstStructure* one = gst_value_get_structure(gst_value_array_get_value(views, i));
      const GValue* position = gst_structure_get_value(one, "position");
      static_cast<std::vector<double>*>(all)->push_back(g_value_get_double(gst_value_array_get_value(position, 0)));
    }
    return GST_PAD_PROBE_OK;
  };
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, note, &x, nullptr);
  ASSERT_EQ(run(pipeline.get(), kPatience), "");
  ASSERT_EQ(x.size(), 3u);
  EXPECT_NEAR(x[1] - x[0], 0.01, 1e-9);
  EXPECT_NEAR(x[2] - x[1], 0.01, 1e-9);
}

// Partial answers are no video: who expects some is told.
TEST_F(LfViewSrcCapsTest, PartialAnswersIntoAFilterOfVideoAreAnError) {
  EXPECT_THAT(film("partial=true", "videoconvert"), HasSubstr("partial=true"));
}

TEST_F(LfViewSrcCapsTest, TheViewSendsTheCommandsThatItsCamerasNeed) {
  for (const char* access : {"warp", "pixels"}) {
    const ElementPtr pipeline =
        launch(view_source("is-live=false num-buffers=2") + " node::access=" + access + " ! fakesink sync=false");
    ASSERT_TRUE(pipeline);
    EXPECT_EQ(run(pipeline.get(), kPatience), "") << access;
    const ElementPtr compositor(gst_bin_get_by_name(GST_BIN(pipeline.get()), "compositor"));
    EXPECT_EQ(stat(compositor.get(), "complete"), 2u) << access;
  }
}

TEST_F(LfViewSrcCapsTest, TheReasonForDarkPicturesIsTheRightOne) {
  const ElementPtr pipeline =
      launch(view_source("is-live=false num-buffers=2 out-of-service=0-3") + " ! fakesink sync=false");
  ASSERT_TRUE(pipeline);
  GstBus* bus = gst_element_get_bus(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  std::string warnings;
  for (bool ended = false; !ended;) {
    constexpr auto kAny = GstMessageType(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
    GstMessage* message = gst_bus_timed_pop_filtered(bus, static_cast<GstClockTime>(kPatience) * GST_SECOND, kAny);
    ended = !message || GST_MESSAGE_TYPE(message) != GST_MESSAGE_WARNING;
    if (!ended) {
      g_autoptr(GError) warning = nullptr;
      gst_message_parse_warning(message, &warning, nullptr);
      warnings += warning->message;
    }
    if (message) gst_message_unref(message);
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  gst_object_unref(bus);
  EXPECT_THAT(warnings, AllOf(HasSubstr("out of service"), testing::Not(HasSubstr("outside of the array"))));
}

TEST_F(LfViewSrcCapsTest, TheActionSetsContinuousFocus) {
  const ElementPtr v = make("lfviewsrc");
  const auto set_view = [&](GstStructure* view) {
    gboolean done = FALSE;
    g_signal_emit_by_name(v.get(), "set-view", view, &done);
    gst_structure_free(view);
    return done;
  };
  gboolean follows = FALSE;
  EXPECT_TRUE(set_view(gst_structure_new("view", "focus-continuous", G_TYPE_INT, 1, "x", G_TYPE_DOUBLE, 0.1, nullptr)));
  g_object_get(v.get(), "focus-continuous", &follows, nullptr);
  EXPECT_TRUE(follows);
  EXPECT_TRUE(set_view(gst_structure_new("view", "focus-continuous", G_TYPE_BOOLEAN, FALSE, nullptr)));
  g_object_get(v.get(), "focus-continuous", &follows, nullptr);
  EXPECT_FALSE(follows);
  EXPECT_FALSE(
      set_view(gst_structure_new("view", "focus-continuous", G_TYPE_INT, 1, "x", G_TYPE_STRING, "far", nullptr)));
  g_object_get(v.get(), "focus-continuous", &follows, nullptr);
  EXPECT_FALSE(follows) << "all or nothing";
}

}  // namespace
}  // namespace lf::test
