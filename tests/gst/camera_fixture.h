// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "gst/camera_pipeline.h"

namespace lf::test {

// lfcamsrc beside files of all kinds that it may read.
class CamSrcTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { files = new CameraFiles; }
  static void TearDownTestSuite() {
    delete files;
    files = nullptr;
  }
  // A rig of one camera.
  static std::string rig_with(const std::function<void(Camera&)>& edit) { return files->save("rig.json", 1, edit); }
  static std::string rig_with_source(const std::string& source) {
    return rig_with([&](Camera& camera) { camera.source = source; });
  }
  static inline CameraFiles* files = nullptr;
};

}  // namespace lf::test
