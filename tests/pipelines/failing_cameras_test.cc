// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pipelines and scripts of arrays as they are: with cameras that fail, or with those that the rig names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "gst/camera_files.h"
#include "gst/gst_test.h"
#include "pipelines/gst_launch.h"

namespace lf::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class FailingCamerasTest : public testing::Test {
 protected:
  std::string rig(const std::string& second) {
    return files_.save("rig.json", 3, [&](Camera& camera) { camera.source = camera.id == 1 ? second : "mjpeg.mkv"; });
  }
  CameraFiles files_;
};

// gst-launch-1.0 ends with the first error.
TEST_F(FailingCamerasTest, OneOfThemEndsNoPipeline) {
  for (const std::string live : {"", "is-live=true "}) {
    const std::string path = rig("nowhere.mkv");
    const std::string pace = live.empty() ? "" : "capture-delay=200000000 ";
    const Launched launched =
        gst_launch("lfviewrequest num-buffers=30 framerate=15/1 width=64 height=48 " + live + pace + "rig=" + path +
                       " ! tee name=r  r. ! queue ! n.request lfcameranode name=n loop=true " + live + "rig=" + path +
                       " ! c.sink_0  r. ! queue ! c.request lfcompositor name=c rig=" + path +
                       " post-messages=true ! fakesink sync=false",
                   "-m");
    EXPECT_EQ(launched.status, 0) << launched.output;
    EXPECT_THAT(launched.output, HasSubstr("lightfield-camera-lost, camera=(uint)1, name=(string)cam_1"));
    EXPECT_THAT(launched.output, HasSubstr("WARNING: from element"));
    EXPECT_THAT(launched.output, HasSubstr("nowhere.mkv: no such file: out of service"));
    EXPECT_THAT(launched.output, HasSubstr("Got EOS"));
  }
}

TEST_F(FailingCamerasTest, ACameraHostHasAllCamerasOfTheRigByDefault) {
  const std::string log = files_.path("log");
  const std::string script = "GST_PLUGIN_PATH=" LF_PLUGIN_DIR " GST_REGISTRY=" LF_PLUGIN_DIR
                             "/test-registry.bin " LF_SOURCE_ROOT "/pipelines/camera-node.sh --rig " +
                             rig("mjpeg.mkv") + " --requests 27431 --answers 127.0.0.1:27432 --set loop=true >" + log +
                             " 2>&1 & node=$!; for i in $(seq 300); do sleep 0.1; kill -0 $node 2>/dev/null || break; "
                             "grep -q 'clockselect0.*new-state=(GstState)playing' " +
                             log + " && break; done; kill $node; cat " + log;
  FILE* pipe = popen(script.c_str(), "r");
  ASSERT_TRUE(pipe);
  std::string output;
  char buffer[4096];
  while (const size_t n = fread(buffer, 1, sizeof buffer, pipe)) output.append(buffer, n);
  pclose(pipe);
  EXPECT_THAT(output, HasSubstr("new-state=(GstState)playing"));
  EXPECT_THAT(output, HasSubstr("camera2"));
  EXPECT_THAT(output, Not(HasSubstr("ERROR")));
}

}  // namespace
}  // namespace lf::test
