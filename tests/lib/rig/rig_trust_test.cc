// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_trust.h"

#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

Rig rig_of(const std::string& source, const std::string& image = "") {
  Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  rig.cameras[1].source = source;
  rig.cameras[1].image = image;
  return rig;
}

TEST(RigTrust, OtherElementsAndLightFieldsNeedTheUsersWord) {
  const TempDir dir;
  const std::string path = dir.write("rig.json", "");
  for (const Rig& rig :
       {rig_of("videotestsrc ! filesink location=x"), rig_of("lf:///rig.json"), rig_of("", "lf:///rig.json")}) {
    EXPECT_ERROR(require_trust(rig, path, false), path + ": camera 1 (cam_00_01): its source has ");
    EXPECT_ERROR(require_trust(rig, path, false), "--trust-rig");
    require_trust(rig, path, true);
  }
  for (const Rig& rig : {rig_of(""), rig_of("a.mkv"), rig_of("", "a ! b.png"), rig_of("rtsp://host/"),
                         rig_of("videotestsrc ! queue"), rig_of("a.mkv", "lf:///rig.json")})
    require_trust(rig, path, false);
}

TEST(RigTrust, ElementsNeedAFileOfTheUsersOwn) {
  const TempDir dir;
  const std::string path = dir.write("rig.json", "");
  chmod(path.c_str(), 0646);
  EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, false), "rig.json is written by others");
  EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, true), "rig.json is written by others");
  chmod(path.c_str(), 0664);
  if (geteuid() == 0) {  // only root may give a file to any group
    ASSERT_EQ(chown(path.c_str(), 0, 33), 0);
    EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, false), "rig.json is written by others");
    ASSERT_EQ(chown(path.c_str(), 0, 0), 0);
    require_trust(rig_of("videotestsrc ! queue"), path, false);
  }
  require_trust(rig_of("a.mkv"), path, false);
  require_trust(rig_of("videotestsrc ! queue"), "", false);
}

}  // namespace
}  // namespace lf
