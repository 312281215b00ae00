// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/video/navigation.h>
#include <gst/video/video.h>

#include "gst/lfviewsrc_fixture.h"
#include "node/renderer_selector.h"
#include "view/view_path.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

void press(GstElement* sink, const char* key) {
  const PadPtr pad = pad_of(sink, "sink");
  gst_pad_push_event(pad.get(), gst_navigation_event_new_key_press(key, GST_NAVIGATION_MODIFIER_NONE));
}

TEST_F(LfViewSrcTest, HasThePropertiesOfItsChildren) {
  const ElementPtr bin = make_element("lfviewsrc");
  size_t copies = 0;
  for (const char* name : {"view", "compositor"}) {
    const ElementPtr element = child_of(bin.get(), name);
    ASSERT_TRUE(element) << name;
    guint count = 0;
    g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
    for (guint i = 0; i < count; i++) {
      GParamSpec* of_child = specs[i];
      GParamSpec* own = g_object_class_find_property(G_OBJECT_GET_CLASS(bin.get()), of_child->name);
      const std::set<std::string> differ = {"name", "parent", "rig", "is-live"};
      if (!own || differ.contains(own->name)) continue;
      copies++;
      EXPECT_STREQ(g_param_spec_get_blurb(own), g_param_spec_get_blurb(of_child)) << own->name;
      EXPECT_STREQ(g_param_spec_get_nick(own), g_param_spec_get_nick(of_child)) << own->name;
      EXPECT_EQ(own->value_type, of_child->value_type) << own->name;
      constexpr int kMutable = GST_PARAM_MUTABLE_READY | GST_PARAM_MUTABLE_PAUSED | GST_PARAM_MUTABLE_PLAYING;
      EXPECT_EQ(own->flags & kMutable, of_child->flags & kMutable) << own->name;
      if (G_IS_PARAM_SPEC_BOXED(own)) continue;
      // The bin's default of "latency" differs from the class default.
      GValue at_first = G_VALUE_INIT;
      g_object_get_property(G_OBJECT(element.get()), own->name, &at_first);
      EXPECT_EQ(g_param_values_cmp(own, g_param_spec_get_default_value(own), &at_first), 0) << own->name;
      g_value_unset(&at_first);
    }
  }
  EXPECT_GT(copies, 30u);
  for (const char* name : {"x", "fov", "focus-distance", "width", "framerate", "location", "focus", "focus-near",
                           "stats", "post-messages", "latency", "num-buffers"})
    EXPECT_TRUE(g_object_class_find_property(G_OBJECT_GET_CLASS(bin.get()), name)) << name;
}

TEST_F(LfViewSrcTest, PropertiesAreForwardedToTheChildren) {
  const ElementPtr bin = make_element("lfviewsrc");
  std::string notified;
  g_signal_connect(bin.get(), "notify", G_CALLBACK(+[](GObject*, GParamSpec* spec, gpointer text) {
                     *static_cast<std::string*>(text) += std::string(spec->name) + " ";
                   }),
                   &notified);
  g_object_set(bin.get(), "x", 0.25, "width", 320, "framerate", 25, 2, "background", 0xff112233, nullptr);
  EXPECT_EQ(notified, "background framerate width x ");
  g_autofree gchar* rig = nullptr;
  gdouble x = 0;
  guint background = 0;
  gboolean live = FALSE;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "view::x", &x, "compositor::background", &background, "node::is-live",
                      &live, nullptr);
  EXPECT_EQ(x, 0.25);
  EXPECT_EQ(background, 0xff112233);
  EXPECT_TRUE(live);
  notified.clear();
  gst_child_proxy_set(GST_CHILD_PROXY(bin.get()), "view::yaw", 7.0, "compositor::max-missed", 9u, "node::cameras",
                      "0-2", nullptr);
  EXPECT_EQ(notified, "yaw max-missed ") << "once each";
  guint missed = test::get<guint>(bin.get(), "max-missed");
  EXPECT_EQ(missed, 9u);

  PadPtr pad(gst_element_request_pad_simple(bin.get(), "src_7"));
  ASSERT_TRUE(pad);
  EXPECT_STREQ(GST_PAD_NAME(pad.get()), "src_7");
  gint width = 0;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "view_7::x", &x, "view_7::width", &width, "compositor_7::max-missed",
                      &missed, nullptr);
  EXPECT_EQ(x, 0);
  EXPECT_EQ(width, 320);
  EXPECT_EQ(missed, 9u);
  g_object_set(bin.get(), "rig", array_.rig_path().c_str(), "is-live", FALSE, nullptr);
  for (const char* name : {"view::rig", "compositor::rig", "node::rig", "view_7::rig", "compositor_7::rig"}) {
    g_autofree gchar* path = nullptr;
    gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), name, &path, nullptr);
    EXPECT_EQ(path, array_.rig_path()) << name;
  }
  for (const char* name : {"view::is-live", "view_7::is-live", "node::is-live"}) {
    gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), name, &live, nullptr);
    EXPECT_FALSE(live) << name;
  }
  gst_util_set_object_arg(G_OBJECT(bin.get()), "renderer", "auto");
  gint renderer = 0;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "node::renderer", &renderer, nullptr);
  EXPECT_EQ(renderer, static_cast<gint>(RendererChoice::kAuto));
  gst_element_release_request_pad(bin.get(), pad.get());
  pad.reset();
  EXPECT_FALSE(pad_of(bin.get(), "src_7"));
}

TEST_F(LfViewSrcTest, EndsWithItsViews) {
  const PipelinePtr pipeline = launch("lfviewsrc rig=" + array_.rig_path() +
                                      " is-live=false num-buffers=20 name=v ! fakesink name=s sync=false");
  for (int i = 0; i < 2; i++) EXPECT_EQ(run(pipeline.get(), kTimeoutSeconds), "") << i;
}

// Compression would cost a tenth of the CPU time of a quilt.
TEST_F(LfViewSrcTest, RequestsForLocalCamerasAreNotCompressed) {
  const PipelinePtr pipeline = launch("lfviewsrc rig=" + array_.rig_path() +
                                      " is-live=false num-buffers=3 quality=90 name=v ! fakesink sync=false");
  const ElementPtr view = child_of(pipeline.get(), "view");
  std::atomic<int> qualities[101] = {};
  on_buffers(view.get(), "src",
             [&](GstBuffer* buffer) { qualities[wire::decode_request(to_bytes(buffer)).value().quality]++; });
  EXPECT_EQ(run(pipeline.get(), kTimeoutSeconds), "");
  EXPECT_GE(qualities[0], 3);
  EXPECT_EQ(qualities[90], 0);
}

// The camera looks away from the array, so only the marking colours the picture.
TEST_F(LfViewSrcTest, ShowsContributions) {
  const auto red_of = [&](const std::string& show) {
    const PipelinePtr pipeline =
        launch("lfviewsrc rig=" + array_.rig_path() +
               " is-live=false num-buffers=2 width=64 height=48 yaw=180 constrain-view=false " + show +
               " ! video/x-raw,format=RGB ! fakesink name=s sync=false");
    std::atomic<int> red = -1;  // first pixel of the latest picture
    on_buffers(child_of(pipeline.get(), "s").get(), "sink", [&](GstBuffer* buffer) { red = to_bytes(buffer)[0]; });
    EXPECT_EQ(run(pipeline.get(), kTimeoutSeconds), "");
    return red.load();
  };
  const int black = red_of("background=0xff000000");
  EXPECT_EQ(black, 0);
  EXPECT_EQ(red_of("show=contributions background=0xffffffff"), black);
  EXPECT_GT(red_of("show=picture background=0xffffffff"), 200);
  EXPECT_NEAR(red_of("show=coverage background=0xffffffff"), 96, 3) << "grey of missing weight";
}

TEST_F(LfViewSrcTest, NavigationMovesTheView) {
  play("width=64 height=48 constrain-view=false v.src ! videoconvert ! fakesink name=s sync=false",
       "v.src_0 ! queue ! fakesink name=t sync=false");
  ASSERT_TRUE(more("s"));
  ASSERT_TRUE(more("t"));
  const double x = get("v", "x"), x0 = get("view_0", "x");
  EXPECT_EQ(x, x0) << "both in the middle";
  std::atomic<int> notified = 0;
  g_signal_connect(child("v").get(), "notify::x",
                   G_CALLBACK(+[](GObject*, GParamSpec*, gpointer n) { ++*static_cast<std::atomic<int>*>(n); }),
                   &notified);
  press(child("s").get(), "d");
  EXPECT_GT(get("v", "x"), x);
  EXPECT_EQ(notified, 1);
  EXPECT_EQ(get("view_0", "x"), x0);
  const double flown = get("v", "x");
  EXPECT_TRUE(
      gst_element_send_event(child("v").get(), gst_navigation_event_new_key_press("a", GST_NAVIGATION_MODIFIER_NONE)));
  EXPECT_LT(get("v", "x"), flown) << "moved by the application";
  press(child("t").get(), "a");
  EXPECT_LT(get("view_0", "x"), x0);
}

TEST_F(LfViewSrcTest, SetIsOnePictureAndMovesTogether) {
  play("width=64 height=48 views=stereo v.src ! videoconvert ! fakesink name=s sync=false",
       "v.src_0 ! queue ! fakesink name=t sync=false");
  ASSERT_TRUE(more("s"));
  ASSERT_TRUE(more("t"));
  const auto caps = [&](const char* sink) { return caps_of(pad_of(child(sink).get(), "sink").get()); };
  EXPECT_THAT(caps("s"), HasSubstr("width=(int)128, height=(int)48"));
  EXPECT_THAT(caps("s"), HasSubstr("multiview-mode=(string)side-by-side"));
  EXPECT_THAT(caps("t"), HasSubstr("width=(int)128")) << "a new viewer gets the settings";
  const double x = get("v", "x");
  press(child("s").get(), "d");
  EXPECT_GT(get("v", "x"), x);
  ASSERT_TRUE(more("s"));

  gst_util_set_object_arg(G_OBJECT(child("v").get()), "views", "quilt");
  g_object_set(child("v").get(), "columns", 4, "rows", 3, nullptr);
  EXPECT_TRUE(eventually([&] { return caps("s").find("width=(int)256, height=(int)144") != std::string::npos; }));
  EXPECT_EQ(caps("s").find("multiview-mode=(string)side-by-side"), std::string::npos);
  ASSERT_TRUE(more("s"));
  EXPECT_EQ(get<guint>("to_cameras", "max-size-buffers"), 4u * 12) << "room for as many capture times";
  EXPECT_THAT(caps("t"), HasSubstr("width=(int)128"));
}

TEST_F(LfViewSrcTest, EyesOutsideTheArrayAreReported) {
  play("width=64 height=48 views=quilt columns=4 rows=2 eye-distance=20");
  ASSERT_TRUE(more("s", 1));
  EXPECT_THAT(warnings_of(pipeline_.get()), mentions("8 views", "view 0", "outside"));
}

// An application that writes a file must learn that it will get no pictures.
TEST_F(LfViewSrcTest, RefusalOfAllRequestsIsAnError) {
  const PipelinePtr pipeline =
      launch("lfviewsrc rig=" + array_.rig_path() +
             " is-live=false num-buffers=3 limits=limits,max-pixels=100 ! fakesink sync=false");
  EXPECT_THAT(run(pipeline.get(), kTimeoutSeconds), HasSubstr("no picture"));
}

TEST_F(LfViewSrcTest, ActionsSetTheView) {
  play("");
  ASSERT_TRUE(more("s"));
  const StructurePtr view(gst_structure_new("view", "x", G_TYPE_DOUBLE, 0.07, nullptr));
  EXPECT_TRUE(emit(child("v").get(), "set-view", view.get()));
  EXPECT_EQ(get("v", "x"), 0.07);
  EXPECT_TRUE(emit(child("v").get(), "focus-at", 10.0, 10.0));
  EXPECT_FALSE(emit(child("v").get(), "focus-at", double{NAN}, 10.0));
}

TEST_F(LfViewSrcTest, StartsAndStopsAtEveryStage) {
  play("", "v.src ! fakesink name=s  v.src_0 ! queue ! fakesink name=t");
  const ElementPtr v = child("v");
  for (int i = 0; i < 20; i++) {
    for (const GstState state :
         {GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL, GST_STATE_PLAYING}) {
      ASSERT_NE(gst_element_set_state(pipeline_.get(), state), GST_STATE_CHANGE_FAILURE) << error();
      ASSERT_NE(gst_element_get_state(pipeline_.get(), nullptr, nullptr, GST_CLOCK_TIME_NONE),
                GST_STATE_CHANGE_FAILURE);
      g_usleep(static_cast<gulong>(1000 * (i % 5)));
    }
  }
  EXPECT_TRUE(more("s"));
  EXPECT_TRUE(more("t"));
}

TEST_F(LfViewSrcTest, ErrorsNameTheProblem) {
  struct Case {
    std::string properties, words;
    const char* cameras = "";
  };
  const std::string rig = "rig=" + array_.rig_path();
  for (const Case& c :
       {Case{"", "rig: not set"}, Case{"rig=/nowhere/rig.json", "/nowhere/rig.json"},
        Case{rig + " nodes=here", "nodes: here:"}, Case{rig + " nodes=localhost:1:2 is-live=false", "is-live"},
        Case{rig + " nodes=nobody.invalid:1:2", "nobody.invalid"}, Case{rig, "cameras \"9\"", "9"},
        Case{rig + " location=none.json", "location: none.json:"},
        Case{rig + " location=" + array_.rig_path(), "\"lightfield-views\""}}) {
    pipeline_ = launch("lfviewsrc name=v " + c.properties + " ! fakesink");
    // gst_parse_launch() of GStreamer 1.22 leaks a reference to a child set in the launch line.
    if (c.cameras[0]) gst_child_proxy_set(GST_CHILD_PROXY(child("v").get()), "node::cameras", c.cameras, nullptr);
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.properties;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

TEST_F(LfViewSrcTest, NewRigIsAcceptedByAllElementsOrNone) {
  const ModifiedRig calibrated(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15, 12); });
  const ModifiedRig moved(array_.rig(), [](Rig& rig) { rig.cameras[1].source = "elsewhere.mkv"; });
  play("", "v.src ! fakesink name=s  v.src_0 ! fakesink name=t");
  ASSERT_TRUE(more("t"));
  const auto expect_rig = [&](const std::string& path) {
    for (const char* name : {"v", "view", "compositor", "node", "view_0", "compositor_0"})
      EXPECT_EQ(get<std::string>(name, "rig"), path) << name;
  };
  g_object_set(child("v").get(), "rig", calibrated.path().c_str(), nullptr);
  expect_rig(calibrated.path());
  EXPECT_TRUE(more("t"));
  g_object_set(child("v").get(), "rig", moved.path().c_str(), nullptr);
  expect_rig(calibrated.path());
  EXPECT_TRUE(more("s"));
}

TEST_F(LfViewSrcTest, UriNamesTheRig) {
  GError* error = nullptr;
  const ElementPtr bin(gst_element_make_from_uri(GST_URI_SRC, ("lf://" + array_.rig_path()).c_str(), nullptr, &error));
  ASSERT_TRUE(bin) << error->message;
  gst_object_ref_sink(bin.get());
  EXPECT_EQ(test::get<std::string>(bin.get(), "rig"), array_.rig_path());
  g_autofree gchar* uri = gst_uri_handler_get_uri(GST_URI_HANDLER(bin.get()));
  EXPECT_EQ(uri, "lf://" + array_.rig_path());
  EXPECT_FALSE(gst_uri_handler_set_uri(GST_URI_HANDLER(bin.get()), "lf://rig.json", &error));
  EXPECT_THAT(error->message, HasSubstr("lf:///path"));
  g_clear_error(&error);
}

// Players open URIs from untrusted sources, and elements may run any program.
TEST_F(LfViewSrcTest, UriDoesNotOpenLaunchDescriptions) {
  const ModifiedRig described(array_.rig(), [](Rig& rig) { rig.cameras[1].source = "videotestsrc ! identity"; });
  const ElementPtr bin(gst_element_make_from_uri(GST_URI_SRC, ("lf://" + described.path()).c_str(), nullptr, nullptr));
  gst_object_ref_sink(bin.get());
  const ElementBus bus(bin.get());
  EXPECT_EQ(gst_element_set_state(bin.get(), GST_STATE_READY), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(bus.errors(), ElementsAre(mentions("camera 1", "elements", "URI")));
  gst_element_set_state(bin.get(), GST_STATE_NULL);
  g_object_set(bin.get(), "rig", described.path().c_str(), nullptr);
  EXPECT_EQ(gst_element_set_state(bin.get(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  gst_element_set_state(bin.get(), GST_STATE_NULL);
}

// Sizes and rates negotiated with downstream, and metas that identify the view of a picture.
class LfViewSrcCapsTest : public LfViewSrcTest {
 protected:
  std::string view_source(const std::string& properties) const {
    return "lfviewsrc name=v rig=" + array_.rig_path() + " " + properties;
  }
  std::string film(const std::string& properties, const std::string& caps, const std::string& behind = "") {
    const PipelinePtr pipeline = launch(view_source("is-live=false num-buffers=3 " + properties) + " ! " + behind +
                                        caps + " ! fakesink name=s sync=false");
    std::string seen;
    const ElementPtr sink = child_of(pipeline.get(), "s");
    const PadPtr pad = pad_of(sink.get(), "sink");
    on_buffers(sink.get(), "sink", [&](GstBuffer*) { seen = caps_of(pad.get()); });
    const std::string error = run(pipeline.get(), kTimeoutSeconds);
    return error.empty() ? seen : error;
  }
  std::string caps_at(const std::string& sink) { return caps_of(pad_of(child(sink).get(), "sink").get()); }
  // Calls `see` with the meta of each picture that has one.
  static void on_metas(GstElement* pipeline, const std::function<void(const GstStructure*)>& see) {
    on_buffers(child_of(pipeline, "s").get(), "sink", [see](GstBuffer* buffer) {
      GstCustomMeta* meta = gst_buffer_get_custom_meta(buffer, "lightfield-view");
      if (meta) see(gst_custom_meta_get_structure(meta));
    });
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

TEST_F(LfViewSrcCapsTest, ExplicitPropertiesTakePrecedence) {
  EXPECT_THAT(film("width=80 framerate=10/1", "video/x-raw,height=40"), is_video(80, 40, "10/1"));
  EXPECT_THAT(film("width=80 height=60", "video/x-raw,width=96,height=64"),
              AllOf(HasSubstr("80x60"), HasSubstr("width=96,height=64"), mentions("height at 0")));
  EXPECT_THAT(film("framerate=10/1", "video/x-raw,framerate=25/1"),
              AllOf(HasSubstr("10/1"), HasSubstr("25/1"), HasSubstr("framerate at 0/1")));
}

TEST_F(LfViewSrcCapsTest, ErrorsNameTheRefusedFormat) {
  const bool is_rgb = film("", "video/x-raw").find("format=(string)I420") == std::string::npos;
  const std::string other = is_rgb ? "NV12" : "RGBA";
  EXPECT_THAT(film("", "video/x-raw,format=" + other + ",width=96,height=64,framerate=25/1"),
              AllOf(HasSubstr("accepts format=" + other), HasSubstr("videoconvert")));
}

TEST_F(LfViewSrcCapsTest, RunningPadOffersOnlyItsFormats) {
  pipeline_ = launch(view_source("") + " v.src ! fakesink name=s sync=false");
  count(child("s").get(), "s");
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  ASSERT_TRUE(more("s")) << error();
  const PadPtr compositor = pad_of(child("compositor").get(), "src");
  const CapsPtr offered(gst_pad_query_caps(compositor.get(), nullptr)),
      current(gst_pad_get_current_caps(compositor.get()));
  ASSERT_TRUE(current && gst_caps_can_intersect(offered.get(), current.get()));
  const bool is_rgb = !contains(caps_of(compositor.get()), "I420");
  g_autofree gchar* text = gst_caps_to_string(offered.get());
  EXPECT_THAT(text, Not(HasSubstr(is_rgb ? "NV12" : "RGBA"))) << "of the other family";
  EXPECT_THAT(text, Not(HasSubstr("lightfield-answer")));
}

// Warm-up requests find the surface before the first picture, even if depth hypotheses are rare.
TEST_F(LfViewSrcCapsTest, FirstPictureOfAFileIsFocused) {
  std::string shown[2];
  for (const int interval : {1, 5}) {
    const PipelinePtr pipeline =
        launch(view_source("is-live=false num-buffers=1 focus=surface width=128 height=96 depth-interval=") +
               std::to_string(interval) + " ! fakesink name=s sync=false");
    on_metas(pipeline.get(), [&](const GstStructure* meta) {
      const GValue* focus = gst_structure_get_value(meta, "focus");
      g_autofree gchar* written = focus ? gst_structure_to_string(gst_value_get_structure(focus)) : nullptr;
      shown[interval == 1 ? 0 : 1] = written ? written : "";
    });
    ASSERT_EQ(run(pipeline.get(), kTimeoutSeconds), "");
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
  const TempFile path(views_to_json({view}), ".json");
  const std::string properties = "location=" + path.path();
  EXPECT_THAT(film(properties, "video/x-raw,framerate=25/1"), is_video(40, 20, "25/1"));
  EXPECT_THAT(film(properties, "video/x-raw,width=96,height=64"), AllOf(HasSubstr("40x20"), HasSubstr("location")));
}

TEST_F(LfViewSrcCapsTest, CapsMayChangeWhilePlaying) {
  pipeline_ = launch(view_source("") +
                     " v.src ! capsfilter name=f caps=video/x-raw,width=96,height=64,framerate=30/1 ! "
                     "fakesink name=s sync=false  "
                     "v.src_0 ! capsfilter name=g caps=video/x-raw,width=48,height=48 ! fakesink name=t sync=false");
  for (const char* sink : {"s", "t"}) count(child(sink).get(), sink);
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  ASSERT_TRUE(more("s") && more("t")) << error();
  EXPECT_THAT(caps_at("s"), is_video(96, 64, "30/1"));
  EXPECT_THAT(caps_at("t"), is_video(48, 48, "15/1"));
  for (const auto& [width, rate] : {std::pair{64, "20/1"}, std::pair{128, "30/1"}, std::pair{32, "60/1"}}) {
    filter("f", "video/x-raw,width=" + std::to_string(width) + ",height=64,framerate=" + rate);
    EXPECT_TRUE(eventually([&] { return testing::Value(caps_at("s"), is_video(width, 64, rate)); }))
        << width << ": " << caps_at("s") << error();
    EXPECT_TRUE(more("s")) << error();
  }
  filter("f", "video/x-raw");
  EXPECT_TRUE(eventually([&] { return testing::Value(caps_at("s"), is_video(32, 24, "15/1")); }))
      << caps_at("s") << error();
  EXPECT_THAT(caps_at("t"), is_video(48, 48, "15/1")) << "caps are per viewer";
  EXPECT_TRUE(more("t"));
}

TEST_F(LfViewSrcCapsTest, PicturesIdentifyTheirView) {
  const std::string line = view_source("is-live=false num-buffers=2 focus=plane focus-distance=3") +
                           " ! queue ! videoconvert ! video/x-raw,format=BGRx ! queue ! fakesink name=s sync=false";
  const PipelinePtr pipeline = launch(line);
  std::vector<StructurePtr> metas;
  on_metas(pipeline.get(), [&](const GstStructure* meta) { metas.emplace_back(gst_structure_copy(meta)); });
  ASSERT_EQ(run(pipeline.get(), kTimeoutSeconds), "");
  ASSERT_EQ(metas.size(), 2u);
  const GstStructure* meta = metas[1].get();
  guint sequence = 0;
  EXPECT_TRUE(gst_structure_get_uint(meta, "sequence", &sequence));
  EXPECT_EQ(sequence, 1u);
  const GValue* position = gst_structure_get_value(meta, "position");
  ASSERT_TRUE(position && gst_value_array_get_size(position) == 3);
  const ElementPtr v = child_of(pipeline.get(), "v");
  for (guint i = 0; i < 3; i++) {
    constexpr const char* kAxes[] = {"x", "y", "z"};
    EXPECT_EQ(g_value_get_double(gst_value_array_get_value(position, i)), test::get<gdouble>(v.get(), kAxes[i])) << i;
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

TEST_F(LfViewSrcCapsTest, QuiltsIdentifyAllViews) {
  const PipelinePtr pipeline = launch(view_source("is-live=false num-buffers=1 views=row columns=3 eye-distance=0.01") +
                                      " ! fakesink name=s sync=false");
  std::vector<double> x;
  on_metas(pipeline.get(), [&](const GstStructure* meta) {
    const GValue* views = gst_structure_get_value(meta, "views");
    for (guint i = 0; views && i < gst_value_array_get_size(views); i++) {
      const GstStructure* one = gst_value_get_structure(gst_value_array_get_value(views, i));
      const GValue* position = gst_structure_get_value(one, "position");
      x.push_back(g_value_get_double(gst_value_array_get_value(position, 0)));
    }
  });
  ASSERT_EQ(run(pipeline.get(), kTimeoutSeconds), "");
  ASSERT_EQ(x.size(), 3u);
  EXPECT_NEAR(x[1] - x[0], 0.01, 1e-9);
  EXPECT_NEAR(x[2] - x[1], 0.01, 1e-9);
}

TEST_F(LfViewSrcCapsTest, PartialAnswersIntoAVideoFilterAreAnError) {
  EXPECT_THAT(film("partial=true", "videoconvert"), HasSubstr("partial=true"));
}

TEST_F(LfViewSrcCapsTest, SendsCommandsForSimpleCameras) {
  for (const char* access : {"warp", "pixels"}) {
    const PipelinePtr pipeline =
        launch(view_source("is-live=false num-buffers=2") + " node::access=" + access + " ! fakesink sync=false");
    EXPECT_EQ(run(pipeline.get(), kTimeoutSeconds), "") << access;
    EXPECT_EQ(stat(child_of(pipeline.get(), "compositor").get(), "complete"), 2u) << access;
  }
}

TEST_F(LfViewSrcCapsTest, ReasonForDarkPicturesIsCorrect) {
  const PipelinePtr pipeline =
      launch(view_source("is-live=false num-buffers=2 out-of-service=0-3") + " ! fakesink sync=false");
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  std::string warnings;
  constexpr auto kAny = GstMessageType(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
  while (const MessagePtr message{gst_bus_timed_pop_filtered(bus, GstClockTime(kTimeoutSeconds) * GST_SECOND, kAny)}) {
    if (GST_MESSAGE_TYPE(message.get()) != GST_MESSAGE_WARNING) break;
    warnings += text_of(message.get());
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(warnings, AllOf(HasSubstr("out of service"), Not(HasSubstr("outside the array"))));
}

TEST_F(LfViewSrcCapsTest, ActionSetsContinuousFocus) {
  const ElementPtr v = make_element("lfviewsrc");
  const auto set_view = [&](GstStructure* view) { return emit(v.get(), "set-view", StructurePtr(view).get()); };
  const auto follows = [&] { return test::get<gboolean>(v.get(), "focus-continuous"); };
  EXPECT_TRUE(set_view(gst_structure_new("view", "focus-continuous", G_TYPE_INT, 1, "x", G_TYPE_DOUBLE, 0.1, nullptr)));
  EXPECT_TRUE(follows());
  EXPECT_TRUE(set_view(gst_structure_new("view", "focus-continuous", G_TYPE_BOOLEAN, FALSE, nullptr)));
  EXPECT_FALSE(follows());
  EXPECT_FALSE(
      set_view(gst_structure_new("view", "focus-continuous", G_TYPE_INT, 1, "x", G_TYPE_STRING, "far", nullptr)));
  EXPECT_FALSE(follows()) << "all or nothing";
}

}  // namespace
}  // namespace lf::test
