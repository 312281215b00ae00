// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pictures and camera frames in GPU memory: with the array's elements alone, and combined with GStreamer's glupload and
// gldownload.
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <gst/app/gstappsink.h>
#include <gst/gl/egl/gstgldisplay_egl.h>
#include <gst/gl/gl.h>

#include "gst/gst_test.h"
#include "support/photographs.h"
#include "support/process.h"

namespace lf::test {
namespace {

int largest_difference(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  if (a.size() != b.size()) return 256;
  int most = 0;
  for (size_t i = 0; i < a.size(); i++) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

// Expects equally many pictures with a maximum difference of one level.
void expect_alike(const std::vector<std::vector<uint8_t>>& a, const std::vector<std::vector<uint8_t>>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); i++) EXPECT_LE(largest_difference(a[i], b[i]), 1) << i;
}

// Detects the white ball of videotestsrc.
bool shows_something(const std::vector<uint8_t>& rgba) {
  size_t white = 0;
  for (size_t i = 0; i + 3 < rgba.size(); i += 4) white += rgba[i] > 200 && rgba[i + 1] > 200 && rgba[i + 2] > 200;
  return white > 50;
}

// GStreamer 1.22 does not support Mesa's surfaceless display, so the test passes the display to GStreamer.
class GlMemory : public testing::Test {
 protected:
  void SetUp() override {
    // Hides that Mesa renders in software: on a software renderer sums would not stay in GPU memory, because that is
    // slower than downloading.
    g_setenv("force_gl_renderer", "a GPU", TRUE);
    display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    ASSERT_NE(display_, EGL_NO_DISPLAY);
    ASSERT_TRUE(eglInitialize(display_, nullptr, nullptr));
    save_array("rig.json", "");
    std::vector<View> views;
    for (int i = 0; i < kPictures; i++) views.push_back(view_from({0.01 + 0.001 * i, 0.01, 0}, 128, 96, 25, 2.2));
    save_views(path_of(views, 0.1), dir_ / "views.json");
  }

  // Saves a rig of four cameras with this source; "": the built-in scene.
  void save_array(const std::string& name, const std::string& source) {
    Rig rig = scene_rig(2, 2, 96, 72);
    for (Camera& camera : rig.cameras) {
      camera.image.clear();
      if (!source.empty()) camera.source = source;
    }
    save_rig(rig, dir_ / name);
  }

  void share_display(GstElement* pipeline) {
    g_autoptr(GstContext) context = gst_context_new(GST_GL_DISPLAY_CONTEXT_TYPE, TRUE);
    g_autoptr(GstGLDisplay) shared = GST_GL_DISPLAY(gst_gl_display_egl_new_with_egl_display(display_));
    gst_context_set_gl_display(context, shared);
    gst_element_set_context(pipeline, context);
  }

  // Returns the pictures at the appsink `out` and expects the error `error`.
  std::vector<std::vector<uint8_t>> pictures(const std::string& line, const std::string& error = "") {
    SCOPED_TRACE(line);
    std::vector<std::vector<uint8_t>> all;
    const PipelinePtr pipeline = launch(line + " ! appsink name=out sync=false");
    share_display(pipeline.get());
    watch(GST_BIN(pipeline.get()));
    const ElementPtr sink = child_of(pipeline.get(), "out");
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
    std::string came;
    const gint64 end = g_get_monotonic_time() + 20 * G_TIME_SPAN_SECOND;
    while (came.empty() && !gst_app_sink_is_eos(GST_APP_SINK(sink.get())) && g_get_monotonic_time() < end) {
      g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), GST_SECOND / 20);
      if (sample) all.push_back(to_bytes(gst_sample_get_buffer(sample)));
      if (const auto errors = texts_on(bus, GST_MESSAGE_ERROR); !errors.empty()) came = errors[0];
    }
    EXPECT_EQ(came, error);
    made_in_it_ = sum_of(GST_BIN(pipeline.get()), "lfcompositor", "gpu-pictures");
    together_ = sum_of(GST_BIN(pipeline.get()), "lffragment", "together");
    gpu_frames_ = sum_of(GST_BIN(pipeline.get()), "lffragment", "gpu-frames");
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    return all;
  }

  static guint64 sum_of(GstBin* pipeline, const char* kind, const char* name) {
    guint64 all = 0;
    GstIterator* elements = gst_bin_iterate_all_by_element_factory_name(pipeline, kind);
    GValue item = G_VALUE_INIT;
    while (gst_iterator_next(elements, &item) == GST_ITERATOR_OK) {
      all += stat(GST_ELEMENT(g_value_get_object(&item)), name);
      g_value_reset(&item);
    }
    g_value_unset(&item);
    gst_iterator_free(elements);
    return all;
  }

  static std::string renderer_of(GstBin* pipeline) {
    std::string renderer;
    GstIterator* nodes = gst_bin_iterate_all_by_element_factory_name(pipeline, "lffragment");
    const auto ask = [](const GValue* item, gpointer out) {
      *static_cast<std::string*>(out) = gst_structure_get_string(stats_of(g_value_get_object(item)).get(), "renderer");
    };
    gst_iterator_foreach(nodes, ask, &renderer);
    gst_iterator_free(nodes);
    return renderer;
  }

  // Returns true if GStreamer is set to OpenGL ES, which cannot download RGB.
  static bool is_of_es() {
    const char* const api = g_getenv("GST_GL_API");
    return api && g_str_equal(api, "gles2");
  }

  // Counts buffers at the element `look`, in total and in GPU memory.
  void watch(GstBin* pipeline) {
    came_ = in_gpu_ = 0;
    const ElementPtr element(gst_bin_get_by_name(pipeline, "look"));
    if (!element) return;
    on_buffers(element.get(), "sink", [this](GstBuffer* buffer) {
      came_++;
      in_gpu_ += gst_is_gl_memory(gst_buffer_peek_memory(buffer, 0));
    });
  }
  // Returns the pictures of four cameras with the caps filters `in` before the node and `out` after the compositor.
  // `node`: additional node properties.
  std::vector<std::vector<uint8_t>> array(const std::string& in, const std::string& out, const std::string& error = "",
                                          const std::string& node = "") {
    const std::string rig = " rig=" + dir_ / "rig.json";
    std::string line = "lfviewrequest location=" + dir_ / "views.json" +
                       " ! tee name=r r. ! queue ! c.request lfcompositor name=c focus=plane r. ! queue ! n.request "
                       "lffragment name=n" +
                       node + rig + " ! c.sink_0";
    for (const std::string camera : {"0", "1", "2", "3"})
      line += " lfcamsrc" + rig + " camera=" + camera + in + " ! n.sink_" + camera;
    return pictures(line + " c. ! " + out, error);
  }

  static constexpr int kPictures = 8;
  const TempDir dir_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  int came_ = 0, in_gpu_ = 0;
  guint64 made_in_it_ = 0;  // pictures that compositors made in GPU memory
  guint64 together_ = 0;    // answers rendered in a pass with other answers
  guint64 gpu_frames_ = 0;  // camera frames rendered from GPU memory
};

// Pictures are written directly to memory that downstream proposes, without a copy. Elements that accept only GPU
// memory link directly.
TEST_F(GlMemory, HoldsPictures) {
  const struct {
    std::string of_cameras, of_pictures;
  } formats[] = {{"RGB", "RGBA"}, {"I420", "I420"}, {"I420", "NV12"}};
  for (const auto& format : formats) {
    SCOPED_TRACE(format.of_pictures);
    const std::string in = " ! videoconvert ! video/x-raw,format=" + format.of_cameras,
                      out = ",format=" + format.of_pictures, back = " ! gldownload ! video/x-raw" + out;
    const auto plain = array(in, "video/x-raw" + out);
    ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
    for (const std::string& to_gpu : {"video/x-raw" + out + " ! glupload name=look",
                                      "video/x-raw(memory:GLMemory)" + out + " ! identity name=look"}) {
      EXPECT_TRUE(plain == array(in, to_gpu + back));
      EXPECT_EQ(came_, kPictures);
      EXPECT_EQ(in_gpu_, kPictures);
    }
  }
}

// A viewer with several views per picture, followed by a passthrough filter.
TEST_F(GlMemory, HoldsPicturesOfLfviewsrc) {
  save_array("rig.json", "videotestsrc pattern=ball num-buffers=90 ! video/x-raw,format=RGBA,width=96,height=72");
  const std::string line = "lfviewsrc is-live=false num-buffers=4 focus=plane rig=" + dir_ / "rig.json" +
                           " width=96 height=72 views=row columns=3 eye-distance=0.01 ! ",
                    back = " ! gldownload ! video/x-raw,format=RGBA";
  const auto plain = pictures(line + "video/x-raw,format=RGBA");
  ASSERT_EQ(plain.size(), 4u);
  EXPECT_TRUE(shows_something(plain[0]));
  for (const std::string to_gpu :
       {"glupload name=look", "video/x-raw(memory:GLMemory),format=RGBA ! identity name=look",
        "identity name=look ! gleffects effect=identity"}) {
    EXPECT_TRUE(plain == pictures(line + to_gpu + back)) << to_gpu;
    EXPECT_EQ(in_gpu_, 4) << to_gpu;
  }
  // Also with the GPU renderer: views rendered before the memory of the picture is negotiated stay beside the rest.
  const std::string by_gpu = "lfviewsrc is-live=false num-buffers=24 focus=plane renderer=gl rig=" + dir_ / "rig.json" +
                             " width=96 height=72 views=row columns=3 eye-distance=0.01 ! ",
                    here = "video/x-raw,format=RGBA", there = "video/x-raw(memory:GLMemory),format=RGBA";
  const auto drawn = pictures(by_gpu + here), stayed = pictures(by_gpu + there + back);
  ASSERT_EQ(drawn.size(), 24u);
  expect_alike(stayed, drawn);
  EXPECT_GE(made_in_it_, 16u);
}

// Live, waiting views of a set are rendered in one pass with unchanged pictures. Pictures wait for all of their views,
// even on a slow machine.
TEST_F(GlMemory, SetsAreDrawnTogether) {
  const std::string cameras =
                        "videotestsrc pattern=smpte100 num-buffers=30 ! video/x-raw,format=RGBA,width=96,height=72",
                    of_set =
                        " focus=plane renderer=gl width=96 height=72 views=quilt columns=4 rows=3 "
                        "eye-distance=0.002 rig=" +
                        dir_ / "rig.json" +
                        " ! video/x-raw(memory:GLMemory),format=RGBA ! gldownload ! video/x-raw,format=RGBA";
  save_array("rig.json", cameras);
  const auto alone = pictures("lfviewsrc is-live=false num-buffers=6" + of_set);
  ASSERT_EQ(alone.size(), 6u);
  EXPECT_TRUE(shows_something(alone.back())) << "its white bar";
  EXPECT_GT(made_in_it_, 0u);
  EXPECT_EQ(together_, 0u);
  save_array("rig.json", cameras + " ! imagefreeze is-live=true");
  const auto live = pictures("lfviewsrc is-live=true num-buffers=8 framerate=2/1 latency=3000000000" + of_set);
  ASSERT_EQ(live.size(), 8u);
  EXPECT_TRUE(live.back() == alone.back());
  EXPECT_GT(made_in_it_, 0u);
  EXPECT_GE(together_, 2 * 11u);
}

// Sums stay in GPU memory up to the picture. The first picture is made before negotiation ends.
TEST_F(GlMemory, HoldsSums) {
  const struct {
    std::string of_cameras, of_pictures;
  } formats[] = {{"RGB", "RGBA"}, {"RGB", "RGB"}, {"RGB", "xBGR"}, {"I420", "I420"}, {"I420", "NV12"}};
  for (const auto& format : formats) {
    SCOPED_TRACE(format.of_pictures);
    const std::string in = " ! videoconvert ! video/x-raw,format=" + format.of_cameras,
                      out = ",format=" + format.of_pictures, back = " ! gldownload ! video/x-raw" + out;
    const auto plain = array(in, "video/x-raw" + out, "", " renderer=gl");
    EXPECT_EQ(made_in_it_, 0u);
    ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
    for (const std::string& to_gpu : {"video/x-raw" + out + " ! glupload name=look",
                                      "video/x-raw(memory:GLMemory)" + out + " ! identity name=look"}) {
      const auto stayed = array(in, to_gpu + back, "", " renderer=gl");
      EXPECT_EQ(in_gpu_, kPictures);
      if (format.of_pictures == "RGB" && is_of_es()) {
        EXPECT_EQ(made_in_it_, 0u);
      } else {
        EXPECT_GE(made_in_it_, kPictures - 3u);
        EXPECT_LT(made_in_it_, static_cast<guint64>(kPictures));
      }
      expect_alike(stayed, plain);
    }
  }
}

TEST_F(GlMemory, HoldsSumsOfSeveralNodes) {
  const std::string rig = " rig=" + dir_ / "rig.json", out = ",format=RGBA";
  std::string line = "lfviewrequest location=" + dir_ / "views.json" +
                     " ! tee name=r r. ! queue ! c.request lfcompositor name=c focus=plane";
  for (const std::string node : {"0", "1"})
    line += " r. ! queue ! n" + node + ".request lffragment renderer=gl name=n" + node + rig + " ! c.sink_" + node;
  for (const std::string camera : {"0", "1", "2", "3"})
    line += " lfcamsrc" + rig + " camera=" + camera + " ! n" + (camera < "2" ? "0" : "1") + ".sink_" + camera;
  const auto plain = pictures(line + " c. ! video/x-raw" + out);
  EXPECT_EQ(made_in_it_, 0u);
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  const auto stayed = pictures(line + " c. ! video/x-raw(memory:GLMemory)" + out + " ! gldownload ! video/x-raw" + out);
  EXPECT_GE(made_in_it_, kPictures - 3u);
  expect_alike(stayed, plain);
}

// LF_CYCLES starts and stops, at every stage of starting, leave neither contexts nor threads.
class GlMemoryCycles : public GlMemory, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(, GlMemoryCycles, testing::Bool(),
                         [](const auto& of) { return of.param ? "FramesOnCard" : "FramesSent"; });

TEST_P(GlMemoryCycles, LeakNothing) {
  const char* const setting = g_getenv("LF_CYCLES");
  // Mesa 22.3's llvmpipe occasionally crashes, about once in 800 cycles, when a context writes to a texture while
  // another context draws triangles: llvmpipe inspects the resources of all contexts without a lock.
  const int cycles = setting ? std::atoi(setting) : GetParam() ? 8 : 24;
  save_array("rig.json", "videotestsrc pattern=ball ! video/x-raw,format=RGBA,width=96,height=72" +
                             std::string(GetParam() ? " ! glupload" : ""));
  const PipelinePtr pipeline = launch("lfviewsrc is-live=false focus=plane renderer=gl rig=" + dir_ / "rig.json" +
                                      " width=96 height=72 ! video/x-raw,format=RGBA ! glupload ! fakesink");
  share_display(pipeline.get());
  long warm = 0;
  ptrdiff_t idle = 0;
  int with_pictures = 0, with_frames = 0;
  for (int i = 0; i < cycles; i++) {
    if (i == cycles / 4) {
      warm = allocated_kib();
      idle = count_of("task");
    }
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << i;
    g_usleep(static_cast<gulong>(20'000 * (i % 7)));
    const gint64 end = g_get_monotonic_time() + 20 * G_TIME_SPAN_SECOND;
    const auto made = [&] { return sum_of(GST_BIN(pipeline.get()), "lfcompositor", "gpu-pictures"); };
    while (i % 2 && made() == 0 && g_get_monotonic_time() < end) g_usleep(10'000);
    with_pictures += made() > 0;
    const guint64 on_gpu = sum_of(GST_BIN(pipeline.get()), "lffragment", "gpu-frames");
    EXPECT_TRUE(GetParam() || on_gpu == 0);
    with_frames += on_gpu > 0;
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_FAILURE) << i;
  }
  EXPECT_EQ(renderer_of(GST_BIN(pipeline.get())), "gl: a GPU") << "renderer reported after stopping";
  std::printf("%d cycles, %d with pictures that stayed: %ld KiB more than after the first quarter\n", cycles,
              with_pictures, allocated_kib() - warm);
  EXPECT_GE(with_pictures, cycles / 2);
  EXPECT_TRUE(!GetParam() || with_frames >= cycles / 2) << with_frames;
  EXPECT_LE(count_of("task"), idle + 4);  // GStreamer keeps some threads
  // Allocated memory instead of resident memory: each context's new thread uses a separate malloc arena.
  EXPECT_LT(allocated_kib() - warm, 4 * 1024);
}

TEST_F(GlMemory, CompositorProvidesIt) {
  const std::string in = " ! videoconvert ! video/x-raw,format=RGB", there = "video/x-raw(memory:GLMemory),format=RGBA",
                    none = " ! identity drop-allocation=true name=look";
  const auto plain = array(in, "video/x-raw,format=RGBA");
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  EXPECT_TRUE(plain == array(in, there + none + " ! gldownload ! video/x-raw,format=RGBA"));
  EXPECT_EQ(came_, kPictures);
  EXPECT_EQ(in_gpu_, kPictures);
  EXPECT_TRUE(plain == array(in, there));
}

TEST_F(GlMemory, UnsupportedFormatsAreErrors) {
  const std::string error =
      "The pictures of these cameras are I420 or NV12 video, but downstream accepts format=RGBA in GPU "
      "memory: put glupload ! glcolorconvert in between.";
  const std::string in = " ! videoconvert ! video/x-raw,format=I420", out = "gleffects effect=identity ! gldownload";
  EXPECT_TRUE(array(in, out, error).empty());
  EXPECT_EQ(array(in, "glupload ! glcolorconvert ! " + out).size(), static_cast<size_t>(kPictures));
}

// Frames decoded on the GPU reach a node directly, or through gldownload.
TEST_F(GlMemory, AcceptsFrames) {
  const std::string out = "video/x-raw,format=RGB";
  const auto plain = array("", out);
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  EXPECT_TRUE(plain == array(" ! glupload ! gldownload", out));
  EXPECT_TRUE(plain == array(" ! glupload ! video/x-raw(memory:GLMemory)", out));
  for (const std::string format : {"I420", "NV12", "RGBA"}) {
    const std::string in = " ! videoconvert ! video/x-raw,format=" + format;
    const auto of_format = array(in, "video/x-raw");
    EXPECT_EQ(of_format.size(), static_cast<size_t>(kPictures));
    EXPECT_TRUE(of_format == array(in + " ! glupload ! video/x-raw(memory:GLMemory)", "video/x-raw")) << format;
  }
}

// If the GPU renders frames in its memory, they stay there: with sharpening too, for GPU and CPU output. The first
// answers precede the sharing of textures.
TEST_F(GlMemory, FramesAreNotDownloaded) {
  const std::string full = ",colorimetry=1:4:0:0,chroma-site=jpeg";
  for (const std::string& format :
       {std::string("RGBA"), std::string("BGRx"), "I420" + full, "NV12" + full, std::string("I420,colorimetry=bt709")})
    for (const std::string to_gpu : {"", "(memory:GLMemory)"})
      for (const std::string resampling : {"sharpened", "bilinear"}) {
        SCOPED_TRACE(format + to_gpu + resampling);
        if (to_gpu.empty() && (resampling != "sharpened" || format != "RGBA")) continue;
        if (resampling != "sharpened" && format != "I420" + full) continue;
        const bool is_rgb = format == "RGBA" || format == "BGRx";
        const std::string in = " ! videoconvert ! video/x-raw,format=" + format,
                          out = is_rgb ? ",format=RGBA" : ",format=I420",
                          line = "video/x-raw" + to_gpu + out + (to_gpu.empty() ? "" : " ! gldownload ! video/x-raw"),
                          node = " renderer=gl resampling=" + resampling;
        const auto plain = array(in, line, "", node);
        EXPECT_EQ(gpu_frames_, 0u);
        const auto stayed = array(in + " ! glupload ! video/x-raw(memory:GLMemory)", line, "", node);
        const bool has_limited_range = format.find("bt709") != std::string::npos;
        EXPECT_GE(gpu_frames_, has_limited_range ? 0u : 4u * (kPictures - 3));
        EXPECT_LE(gpu_frames_, has_limited_range ? 0u : 4u * (kPictures - 1));
        ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
        expect_alike(stayed, plain);
      }
}

// GPU frames may make the GPU the faster renderer, so they are part of the choice.
TEST_F(GlMemory, AutoMeasuresSumsThatStay) {
  const std::string in = " ! videoconvert ! video/x-raw,format=RGBA ! glupload ! video/x-raw(memory:GLMemory)";
  EXPECT_EQ(array(in, "video/x-raw", "", " renderer=auto").size(), static_cast<size_t>(kPictures));
  EXPECT_GE(gpu_frames_, 2u * 4);
}

// Frames in any format; the recordings must be playable.
TEST_F(GlMemory, FramesAreRecordedAndConverted) {
  const std::string source = "videotestsrc pattern=ball num-buffers=30 ! video/x-raw,width=96,height=72,format=";
  for (const std::string format : {"RGBA ! glupload", "NV12 ! glupload", "YUY2 ! glupload"}) {
    SCOPED_TRACE(format);
    save_array("rig.json", source + format);
    const std::string seen = dir_ / format.substr(0, 4), size = " width=96 height=72 num-buffers=8 ! ",
                      rgba = "videoconvert ! video/x-raw,format=RGBA",
                      of_files = "lfviewsrc is-live=false focus=plane rig=";
    const auto live = pictures(of_files + dir_ / "rig.json" + " renderer=gl record=" + seen + size + rgba);
    ASSERT_EQ(live.size(), 8u);
    EXPECT_TRUE(shows_something(live[5]));
    const auto again = pictures(of_files + seen + "/rig.json" + size + rgba);
    ASSERT_EQ(again.size(), 8u);
    EXPECT_LE(largest_difference(again[5], live[5]), 60) << "JPEG of a white ball";
  }
}

TEST_F(GlMemory, AcceptsFramesOfLaunchDescriptions) {
  const std::string source = "videotestsrc pattern=ball num-buffers=30 ! video/x-raw,format=RGBA,width=96,height=72";
  save_array("plain.json", source);
  save_array("gpu.json", source + " ! glupload ! gldownload");
  const auto views = [&](const std::string& rig) {
    return pictures("lfviewsrc is-live=false focus=plane rig=" + dir_ / rig + " location=" + dir_ / "views.json");
  };
  const auto plain = views("plain.json");
  ASSERT_EQ(plain.size(), static_cast<size_t>(kPictures));
  EXPECT_TRUE(shows_something(plain[0]));
  EXPECT_TRUE(plain == views("gpu.json"));
  // Directly, and for nodes that accept no GPU memory.
  save_array("gpu.json", source + " ! glupload");
  EXPECT_TRUE(plain == views("gpu.json"));
  const std::string camera = "lfcamsrc camera=2 rig=" + dir_.path();
  EXPECT_TRUE(pictures(camera + "/gpu.json") == pictures(camera + "/plain.json"));
  const auto by_gpu = [&](const std::string& rig) {
    return pictures("lfviewsrc is-live=false focus=plane renderer=gl rig=" + dir_ / rig +
                    " location=" + dir_ / "views.json");
  };
  const auto drawn = by_gpu("plain.json"), stayed = by_gpu("gpu.json");
  EXPECT_GE(gpu_frames_, 4u * (kPictures - 3));
  expect_alike(stayed, drawn);
}

}  // namespace
}  // namespace lf::test
