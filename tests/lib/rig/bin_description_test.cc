// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/bin_description.h"

#include <gtest/gtest.h>

#include "rig/rig.h"

namespace lf {
namespace {

TEST(BinDescription, TellsElementsFromUrisAndFiles) {
  for (const char* source :
       {"videotestsrc ! identity", "videotestsrc pattern=ball", "v4l2src device=/dev/video0 ! image/jpeg,width=640",
        "libcamerasrc camera-name=\"/base/soc/i2c0mux/i2c@1/imx219@10\"", "  a   b =1"})
    EXPECT_TRUE(is_bin_description(source)) << source;
  for (const char* source :
       {"", "cam.mkv", "cam_%04d.jpg", "v4l2:///dev/video0", "rtsp://host/a ! b", "my films/cam=1.mkv", "cam 1.mkv",
        "cam !.mkv", "a b/c=d.mkv", "videotestsrc", "=1", "a =1"})
    EXPECT_FALSE(is_bin_description(source)) << source;
}

TEST(BinDescription, ElementsStayAsTheyAreWhereFilesMove) {
  Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  rig.directory = "/nowhere/a";
  rig.cameras[0].source = "film.mkv";
  rig.cameras[1].source = "filesrc location=film.mkv ! matroskademux";
  relocate(rig, "/nowhere");
  EXPECT_EQ(rig.cameras[0].source, "a/film.mkv");
  EXPECT_EQ(rig.cameras[1].source, "filesrc location=film.mkv ! matroskademux");
}

TEST(BinDescription, ListedElementsNeedNoTrust) {
  for (const char* source : {
           "videotestsrc ! identity",
           "videotestsrc pattern=ball",
           "videotestsrc is-live=true ! video/x-raw, width=(int)640, framerate=30/1 ! videoconvert ! queue",
           "v4l2src device=/dev/video0 ! image/jpeg,width=640",
           "libcamerasrc camera-name=\"/base/soc/i2c0mux/i2c@1/imx219@10\" ! queue",
           "rtspsrc location='rtsp://u:p@host/a b' latency = 200 ! rtph264depay ! decodebin",
           "glupload ! video/x-raw(memory:GLMemory),format=RGBA ! glcolorconvert",
           "filesrc location=film.mkv ! matroskademux",
           "cam.mkv",
           "cam_%04d.jpg",
           "rtsp://host/stream",
           "file:///films/a.mkv",
           "",
       })
    EXPECT_EQ(untrusted_part(source), std::nullopt) << source;
}

TEST(BinDescription, NamesThePartThatNeedsTrust) {
  struct {
    const char *source, *part;
  } const cases[] = {
      {"videotestsrc ! tee name=t ! filesink location=/x", "tee"},
      {"videotestsrc ! filesink location=/x", "filesink"},
      {"shellsrc command=ls", "shellsrc"},
      {"lfviewsrc rig=other.json ! identity", "lfviewsrc"},
      {"videotestsrc !filesink location=/x ! identity", "\"!filesink\""},
      {"videotestsrc pattern=ball!filesink location=/x", "\"pattern=ball!filesink\""},
      {"videotestsrc pattern=\"ball\"!filesink location=/x", "\"pattern=\"ball\"!filesink\""},
      {"videotestsrc name=a a. ! identity", "\"a.\""},
      {"videotestsrc ! a.sink ! identity", "\"a.sink\""},
      {"( videotestsrc ! identity )", "\"(\""},
      {"bin.( videotestsrc ! identity )", "\"bin.(\""},
      {"videotestsrc ! video/x-raw! filesink location=/x", "\"video/x-raw!\""},
      {"videotestsrc ! video/x-raw;a:filesink location=/x ! identity", "\"video/x-raw;a:filesink location=/x \""},
      {"videotestsrc ! video/x-raw:filesink ! file:///x ! identity", "\"file:///x\""},
      {"identity ! file:///x", "\"file:///x\""},
      {"souphttpsrc location=http://host/ method=DELETE ! jpegdec", "method of souphttpsrc"},
      {"videotestsrc a::b=c ! identity", "\"a::b=c\""},
      {"videotestsrc pattern=a\\ b ! identity", "\"pattern=a\\\""},
      {"videotestsrc pattern= ", "\"pattern=\""},
      {"lf:///rig.json", "a URI of another light field"},
      {"LF:///rig.json", "a URI of another light field"},
      {"multifile:///tmp/%25s%25n", "a URI of the scheme multifile"},
      {"ImageSequence:///tmp/%25s", "a URI of the scheme imagesequence"},
      {"multifilesrc location=/tmp/%s%n ! pngdec", "multifilesrc"},
      {"imagesequencesrc location=/tmp/%s%n ! pngdec", "imagesequencesrc"},
  };
  for (const auto& [source, part] : cases) EXPECT_EQ(untrusted_part(source), part) << source;
}

}  // namespace
}  // namespace lf
