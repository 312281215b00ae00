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

}  // namespace
}  // namespace lf
