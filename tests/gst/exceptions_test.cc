// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Exceptions become errors or refusals, never reach GStreamer's C code, and leave no lock held. Tests make each
// allocation fail in turn with a replaced operator new.
#include <gst/video/video.h>

#include <new>

#include "gst/array_fixture.h"
#include "support/answers.h"
#include "wire/request_codec.h"

namespace {

std::atomic<int> left = -1;  // allocations until one fails; negative: no failure

void* allocate(std::size_t size, std::size_t alignment) {
  if (left >= 0 && left-- == 0) throw std::bad_alloc();
  void* memory = alignment > 0 ? std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
                               : std::malloc(size > 0 ? size : 1);
  if (!memory) throw std::bad_alloc();
  return memory;
}

}  // namespace

#pragma GCC diagnostic ignored "-Wmismatched-new-delete"

void* operator new(std::size_t size) { return allocate(size, 0); }
void* operator new[](std::size_t size) { return allocate(size, 0); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return left >= 0 && left-- == 0 ? nullptr : std::malloc(size > 0 ? size : 1);
}
void* operator new[](std::size_t size, const std::nothrow_t& nothrow) noexcept { return operator new(size, nothrow); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace lf::test {
namespace {

// Calls `use` on a new element once per allocation and lets that allocation fail. `prepare` and the teardown do not
// fail.
class Exceptions : public testing::Test {
 protected:
  // Reads the rig in advance: nlohmann::json terminates the program if a destructor cannot allocate.
  Exceptions() {
    set_rig(has_rig_.get());
    EXPECT_EQ(gst_element_set_state(has_rig_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_SUCCESS);
  }
  ~Exceptions() override { gst_element_set_state(has_rig_.get(), GST_STATE_NULL); }

  using Step = std::function<void(GstElement*)>;
  void each_place(const char* factory, const Step& use, const Step& prepare = {}) {
    int places = 0;
    for (bool reached_end = false; !reached_end; places++) {
      ASSERT_LT(places, 20000);
      ElementPtr element = make_element(factory);
      ASSERT_TRUE(element);
      if (prepare) prepare(element.get());
      left = places;
      use(element.get());
      reached_end = left.exchange(-1) >= 0;
      gst_element_set_state(element.get(), GST_STATE_NULL);
    }
    RecordProperty(std::string(factory) + "-places", places);
    places_ += places;
  }
  void set_rig(GstElement* element) const { g_object_set(element, "rig", array_.rig_path().c_str(), nullptr); }

  static void push_start(GstPad* pad, const char* caps) {
    gst_pad_send_event(pad, gst_event_new_stream_start("test"));
    const CapsPtr parsed(gst_caps_from_string(caps));
    gst_pad_send_event(pad, gst_event_new_caps(parsed.get()));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_pad_send_event(pad, gst_event_new_segment(&segment));
  }

  ArrayFixture array_;
  const ElementPtr has_rig_ = make_element("lffragment");
  int places_ = 0;
};

constexpr const char* kRequestCaps = "application/x-lightfield-request,framerate=10/1,parsed=true";
constexpr const char* kAnswerCaps = "application/x-lightfield-answer,parsed=true";

TEST_F(Exceptions, InProperties) {
  for (const char* factory : {"lfviewrequest", "lfcamsrc", "lfcameranode", "lfcompositor", "lffragment"}) {
    SCOPED_TRACE(factory);
    each_place(factory, [&](GstElement* element) {
      set_rig(element);
      if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), "stats")) stats_of(element);
      guint count = 0;
      g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
      for (guint i = 0; i < count; i++) {
        if (!(specs[i]->flags & G_PARAM_READABLE) || !(specs[i]->flags & G_PARAM_WRITABLE)) continue;
        if (g_str_equal(specs[i]->name, "parent")) continue;
        GValue value = G_VALUE_INIT;
        g_object_get_property(G_OBJECT(element), specs[i]->name, &value);
        if (G_IS_VALUE(&value)) g_object_set_property(G_OBJECT(element), specs[i]->name, &value);
        if (G_IS_VALUE(&value)) g_value_unset(&value);
      }
    });
  }
  EXPECT_GT(places_, 20);
}

TEST_F(Exceptions, InStateChanges) {
  for (const char* factory : {"lfviewrequest", "lfcompositor", "lffragment", "lfcameranode", "lfcamsrc", "lfviewsrc"}) {
    SCOPED_TRACE(factory);
    each_place(
        factory,
        [](GstElement* element) {
          gst_element_set_state(element, GST_STATE_READY);
          gst_element_set_state(element, GST_STATE_READY);
        },
        [&](GstElement* element) { set_rig(element); });
  }
  EXPECT_GT(places_, 100);
}

// Tears down bins with everything that a run creates inside.
TEST_F(Exceptions, InTeardownOfBins) {
  const auto each_place_of_going = [&](const char* factory, const Step& prepare) {
    SCOPED_TRACE(factory);
    int places = 0;
    for (bool reached_end = false; !reached_end; places++) {
      ASSERT_LT(places, 20000);
      GstElement* element = GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr)));
      ASSERT_TRUE(element);
      prepare(element);
      EXPECT_EQ(gst_element_set_state(element, GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
      gst_element_set_state(element, GST_STATE_NULL);
      gpointer still_there = element;
      g_object_add_weak_pointer(G_OBJECT(element), &still_there);
      left = places;
      gst_object_unref(element);
      reached_end = left.exchange(-1) >= 0;
      EXPECT_FALSE(still_there);
    }
    places_ += places;
  };
  each_place_of_going("lfnodesink", [&](GstElement* element) {
    set_rig(element);
    g_object_set(element, "listen", "27431", "answers", "127.0.0.1:27432", nullptr);
  });
  each_place_of_going("lfviewsrc", [&](GstElement* element) {
    g_object_set(element, "rig", array_.rig_path().c_str(), "nodes", "127.0.0.1:27433:27434", nullptr);
  });
}

TEST_F(Exceptions, InAnswers) {
  const std::vector<uint8_t> bytes = wire::encode_request(array_.request(0, 0));
  const BufferPtr frame(ArrayFixture::frame("RGB", 100, 0));
  const std::string caps = ArrayFixture::caps("RGB");
  GstPad* camera = nullptr;
  each_place(
      "lffragment",
      [&](GstElement* element) {
        gst_element_set_state(element, GST_STATE_PAUSED);
        const PadPtr request = pad_of(element, "request");
        push_start(camera, caps.c_str());
        gst_pad_chain(camera, gst_buffer_ref(frame.get()));
        gst_pad_send_event(camera, gst_event_new_eos());
        push_start(request.get(), kRequestCaps);
        GstBuffer* buffer = to_buffer(bytes);
        GST_BUFFER_PTS(buffer) = 0;
        gst_pad_chain(request.get(), buffer);
        gst_pad_send_event(request.get(), gst_event_new_eos());
        gst_element_release_request_pad(element, camera);
        gst_clear_object(&camera);
      },
      [&](GstElement* element) {
        set_rig(element);
        camera = gst_element_request_pad_simple(element, "sink_0");
      });
}

TEST_F(Exceptions, LoseOnlyOneAnswer) {
  const BufferPtr frame(ArrayFixture::frame("RGB", 100, 0));
  const std::string caps = ArrayFixture::caps("RGB");
  std::vector<std::vector<uint8_t>> requests;
  for (uint32_t i = 0; i < 2; i++) requests.push_back(wire::encode_request(array_.request(i, 0)));
  HarnessPtr harness, camera;
  each_place(
      "lffragment",
      [&](GstElement*) {
        const auto ask = [&](size_t i) {
          GstBuffer* buffer = to_buffer(requests[i]);
          GST_BUFFER_PTS(buffer) = 0;
          return gst_harness_push(harness.get(), buffer);
        };
        EXPECT_EQ(ask(0), GST_FLOW_OK);
        const int rest = left.exchange(-1);
        const guint before = gst_harness_buffers_received(harness.get());
        EXPECT_EQ(ask(1), GST_FLOW_OK);
        EXPECT_EQ(gst_harness_buffers_received(harness.get()), before + 1);
        camera.reset();
        harness.reset();
        left = rest;
      },
      [&](GstElement* element) {
        set_rig(element);
        harness.reset(gst_harness_new_with_element(element, "request", "src"));
        camera.reset(gst_harness_new_with_element(element, "sink_0", nullptr));
        gst_harness_set_live(harness.get(), FALSE);
        gst_harness_set_live(camera.get(), FALSE);
        gst_harness_set_src_caps_str(camera.get(), caps.c_str());
        gst_harness_push(camera.get(), gst_buffer_ref(frame.get()));
        gst_harness_push_event(camera.get(), gst_event_new_eos());
        gst_harness_set_src_caps_str(harness.get(), kRequestCaps);
      });
  EXPECT_GT(places_, 20);
}

TEST_F(Exceptions, InComposition) {
  const ViewRequest asked = array_.request(0, 0);
  wire::Answer answer;
  answer.view_width = asked.view.width;
  answer.view_height = asked.view.height;
  answer.rig_hash = array_.rig().hash();
  answer.last_of_node = true;
  const std::vector<uint8_t> request_bytes = wire::encode_request(asked), answer_bytes = wire::encode_answer(answer);
  const auto pass = [](GstPad* pad, const char* caps, const std::vector<uint8_t>& bytes) {
    push_start(pad, caps);
    GstBuffer* buffer = to_buffer(bytes);
    GST_BUFFER_PTS(buffer) = 0;
    gst_pad_chain(pad, buffer);
    gst_pad_send_event(pad, gst_event_new_eos());
  };
  GstPad* node = nullptr;
  each_place(
      "lfcompositor",
      [&](GstElement* element) {
        gst_element_set_state(element, GST_STATE_PLAYING);
        pass(node, kAnswerCaps, answer_bytes);
        pass(pad_of(element, "request").get(), kRequestCaps, request_bytes);
        gst_element_set_state(element, GST_STATE_READY);
        gst_element_release_request_pad(element, node);
        gst_clear_object(&node);
      },
      [&](GstElement* element) {
        set_rig(element);
        node = gst_element_request_pad_simple(element, "sink_0");
      });
}

TEST_F(Exceptions, InRequests) {
  each_place(
      "lfviewrequest",
      [](GstElement* element) {
        gst_element_set_state(element, GST_STATE_PLAYING);
        emit(element, "set-view", StructurePtr(gst_structure_new("view", "x", G_TYPE_DOUBLE, 0.25, nullptr)).get());
        const PadPtr src = pad_of(element, "src");
        gst_pad_send_event(src.get(), gst_event_new_seek(1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                                         GST_SEEK_TYPE_NONE, -1));
        g_autoptr(GstQuery) query = gst_query_new_latency();
        gst_pad_query(src.get(), query);
        gst_element_set_state(element, GST_STATE_READY);
      },
      [&](GstElement* element) { set_rig(element); });
}

TEST_F(Exceptions, LoseOnlyOneRequest) {
  constexpr int kRequests = 4;
  struct Passed {
    std::atomic<int> places, requests;
  } passed;
  const auto pass = [](GstPad*, GstPadProbeInfo*, gpointer data) {
    Passed* passed = static_cast<Passed*>(data);
    if (passed->requests++ == 0) left = passed->places.load();
    return GST_PAD_PROBE_OK;
  };
  each_place("lfviewrequest", [&](GstElement* element) {
    passed.places = left.exchange(-1);
    passed.requests = 0;
    set_rig(element);
    g_object_set(element, "num-buffers", kRequests, nullptr);
    gst_pad_add_probe(pad_of(element, "src").get(), GST_PAD_PROBE_TYPE_BUFFER, pass, &passed, nullptr);
    HarnessPtr harness(gst_harness_new_with_element(element, nullptr, "src"));
    gst_harness_play(harness.get());
    ASSERT_TRUE(reaches_eos(harness.get()));
    const int rest = left.exchange(-1);
    EXPECT_EQ(passed.requests, kRequests);
    harness.reset();
    left = rest;
  });
  EXPECT_GE(places_, 5);
}

TEST_F(Exceptions, ArePostedAsErrors) {
  const ElementPtr element = make_element("lffragment");
  set_rig(element.get());
  const ElementBus bus(element.get());
  left = 0;
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  left = -1;
  EXPECT_THAT(bus.errors(), ElementsAre(HasSubstr("memory")));
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_SUCCESS)
      << "recovered";
  gst_element_set_state(element.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
