// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfviewsrc listen=..., the views of which are those that others ask for, and the keys of both sides.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "gst/lfviewsrc_fixture.h"
#include "support/free_port.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

class LfViewSrcListenTest : public LfViewSrcTest {
 protected:
  LfViewSrcListenTest() { chmod(key_.path().c_str(), 0600); }
  // A viewer that takes no pictures here: requests of a view of this many pixels across.
  ElementPtr ask(guint view_id, int width, const std::string& with = "") {
    ElementPtr viewer = launch("lfviewrequest is-live=true framerate=30/1 rig=" + array_.rig_path() +
                               " view-id=" + std::to_string(view_id) + " width=" + std::to_string(width) +
                               " height=20 capture-delay=100000000 ! rtplfpay ! lfrtpseal " + with +
                               " ! udpsink host=127.0.0.1 sync=false async=false port=" + std::to_string(port_));
    use_realtime(viewer.get());
    EXPECT_NE(gst_element_set_state(viewer.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    return viewer;
  }
  // What lfviewsrc does by itself.
  static void use_realtime(GstElement* pipeline) {
    g_autoptr(GstClock) clock = GST_CLOCK(
        gst_object_ref_sink(g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_REALTIME, nullptr)));
    gst_pipeline_use_clock(GST_PIPELINE(pipeline), clock);
  }
  static void end(ElementPtr& pipeline) {
    EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    pipeline.reset();
  }
  std::string listen() const { return "listen=127.0.0.1:" + std::to_string(port_) + " "; }
  std::string with_key() const { return "key-file=" + key_.path(); }
  uint64_t complete(const char* compositor) { return stat(child(compositor).get(), "complete"); }
  std::string caps(const char* sink) {
    const PadPtr pad(gst_element_get_static_pad(child(sink).get(), "sink"));
    return caps_of(pad.get());
  }

  const int port_ = free_port(SOCK_DGRAM);
  const std::string secret_ = std::string(40, 'k');
  const TempFile key_{{secret_.begin(), secret_.end()}};
};

TEST_F(LfViewSrcListenTest, EachPadShowsTheViewThatOthersAskFor) {
  // Sinks that wait for nobody, because a view may never be asked for.
  play(listen(), "v.src ! fakesink name=s sync=false async=false  v.src_6 ! fakesink name=t sync=false async=false");
  ElementPtr seventh = ask(7, 36), nobody = ask(3, 48);
  EXPECT_TRUE(more("t"));
  EXPECT_TRUE(comes([&] { return complete("compositor_6") > 5; }));
  EXPECT_THAT(caps("t"), HasSubstr("width=(int)36"));
  EXPECT_EQ(shown_["s"], 0) << "nobody asks for view 0";
  ElementPtr first = ask(0, 30);
  EXPECT_TRUE(more("s"));
  EXPECT_THAT(caps("s"), HasSubstr("width=(int)30"));
  // A viewer that goes and comes, and a pad that does.
  end(seventh);
  EXPECT_TRUE(more("s"));
  seventh = ask(7, 36);
  EXPECT_TRUE(more("t"));
  const PadPtr pad = add_viewer("u");
  ElementPtr another = ask(1, 42);
  EXPECT_TRUE(more("u"));
  close_viewer(pad.get(), "u");
  EXPECT_TRUE(more("t"));
  stop();
  for (ElementPtr* each : {&first, &seventh, &nobody, &another}) end(*each);
}

TEST_F(LfViewSrcListenTest, RequestsAreThoseOfTheKey) {
  play(listen() + with_key());
  ElementPtr stranger = ask(0, 30);
  EXPECT_TRUE(comes([&] { return stat(child("listen_gate").get(), "unsealed") > 5; }));
  EXPECT_EQ(shown_["s"], 0);
  ElementPtr viewer = ask(0, 36, with_key());
  EXPECT_TRUE(more("s"));
  EXPECT_THAT(caps("s"), HasSubstr("width=(int)36"));
  stop();
  end(stranger);
  end(viewer);
}

TEST_F(LfViewSrcListenTest, SealedRequestsAreToldWhereThereIsNoKey) {
  play(listen());
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_.get());
  ElementPtr viewer = ask(0, 36, with_key());
  EXPECT_TRUE(comes([&] { return warnings_on(bus).find("key-file, and this end none") != std::string::npos; }));
  EXPECT_EQ(shown_["s"], 0);
  stop();
  end(viewer);
}

// What a host of a rack sends is an answer.
TEST_F(LfViewSrcListenTest, APartialOneIsANode) {
  play(listen() + "partial=true node=5", "v.src ! application/x-lightfield-answer ! fakesink name=s sync=false");
  ElementPtr viewer = ask(0, 30);
  EXPECT_TRUE(more("s"));
  stop();
  end(viewer);
}

TEST_F(LfViewSrcListenTest, ListensNoMoreAfterwards) {
  play(listen());
  ASSERT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  g_object_set(child("v").get(), "listen", nullptr, nullptr);
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_TRUE(more("s")) << "a view of its own";
  EXPECT_FALSE(child("listen_gate"));
}

TEST_F(LfViewSrcListenTest, APortIsTakenOnce) {
  play(listen());
  ElementPtr other = launch("lfviewsrc rig=" + array_.rig_path() + " " + listen() + " ! fakesink");
  EXPECT_EQ(gst_element_set_state(other.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  std::swap(pipeline_, other);
  const std::string told = error();
  EXPECT_THAT(told, HasSubstr("UDP port " + std::to_string(port_)));
  EXPECT_THAT(told, HasSubstr("already in use"));
  drop();
  std::swap(pipeline_, other);
  ElementPtr viewer = ask(0, 30);
  EXPECT_TRUE(more("s")) << "the first one goes on";
  stop();
  end(viewer);
}

TEST_F(LfViewSrcListenTest, ErrorsSayWhatIsWrong) {
  struct Case {
    std::string properties, words;
  };
  for (const Case& c :
       {Case{"listen=here", "listen: here: must be PORT"}, Case{"listen=1,2", "listen: must be one port"},
        Case{"listen=7 is-live=false", "is-live must be true"},
        Case{"listen=7 key-file=/nobody", "key-file: /nobody: can't be read"},
        Case{"key-file=/nobody", "key-file: nothing goes over the network without nodes or listen"},
        Case{"peers=localhost", "peers: nobody sends requests without listen"},
        Case{"listen=7 peers=nobody.invalid", "peers: nobody.invalid: "}}) {
    pipeline_ = launch("lfviewsrc name=v rig=" + array_.rig_path() + " " + c.properties + " ! fakesink");
    ASSERT_TRUE(pipeline_);
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.properties;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

}  // namespace
}  // namespace lf::test
