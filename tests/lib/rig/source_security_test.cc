// SPDX-License-Identifier: LGPL-2.1-or-later

#include <sys/stat.h>

#include "rig/rig.h"
#include "rig/rig_json.h"
#include "rig/source_security.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(LaunchDescription, DistinguishesElementsFromUrisAndFiles) {
  for (const char* source :
       {"videotestsrc ! identity", "videotestsrc pattern=ball", "v4l2src device=/dev/video0 ! image/jpeg,width=640",
        "libcamerasrc camera-name=\"/base/soc/i2c0mux/i2c@1/imx219@10\"", "  a   b =1"})
    EXPECT_TRUE(is_launch_description(source)) << source;
  for (const char* source :
       {"", "cam.mkv", "cam_%04d.jpg", "v4l2:///dev/video0", "rtsp://host/a ! b", "my films/cam=1.mkv", "cam 1.mkv",
        "cam !.mkv", "a b/c=d.mkv", "videotestsrc", "=1", "a =1"})
    EXPECT_FALSE(is_launch_description(source)) << source;
}

TEST(LaunchDescription, IsUnchangedWhenPathsMove) {
  Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  rig.directory = "/nowhere/a";
  rig.cameras[0].source = "film.mkv";
  rig.cameras[1].source = "filesrc location=film.mkv ! matroskademux";
  rebase_paths(rig, "/nowhere");
  EXPECT_EQ(rig.cameras[0].source, "a/film.mkv");
  EXPECT_EQ(rig.cameras[1].source, "filesrc location=film.mkv ! matroskademux");
}

TEST(LaunchDescription, ListedElementsNeedNoTrust) {
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
    EXPECT_EQ(untrusted_component(source), std::nullopt) << source;
}

TEST(LaunchDescription, NamesThePartThatNeedsTrust) {
  const std::pair<const char*, const char*> cases[] = {
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
      {"multifilesrc location=/tmp/%s%n ! pngdec", "multifilesrc"},
      {"imagesequencesrc location=/tmp/%s%n ! pngdec", "imagesequencesrc"},
  };
  for (const auto& [source, part] : cases) EXPECT_EQ(untrusted_component(source), part) << source;
  for (const char* uri : {"lf:///rig.json", "LF:///rig.json"})
    EXPECT_MENTIONS(untrusted_component(uri).value_or(""), "URI", "light field");
  EXPECT_MENTIONS(untrusted_component("multifile:///tmp/%25s%25n").value_or(""), "URI", "multifile");
  EXPECT_MENTIONS(untrusted_component("ImageSequence:///tmp/%25s").value_or(""), "URI", "imagesequence");
}

Rig rig_of(const std::string& source, const std::string& image = "") {
  Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  rig.cameras[1].source = source;
  rig.cameras[1].image = image;
  return rig;
}

TEST(RigTrust, UnlistedElementsAndLightFieldsNeedTrust) {
  const TempDir dir;
  const std::string path = dir.write("rig.json", "");
  for (const Rig& rig :
       {rig_of("videotestsrc ! filesink location=x"), rig_of("lf:///rig.json"), rig_of("", "lf:///rig.json")}) {
    EXPECT_ERROR(require_trust(rig, path, false), path, "camera 1 (cam_00_01)", "source");
    EXPECT_ERROR(require_trust(rig, path, false), "--trust-rig");
    require_trust(rig, path, true);
  }
  for (const Rig& rig : {rig_of(""), rig_of("a.mkv"), rig_of("", "a ! b.png"), rig_of("rtsp://host/"),
                         rig_of("videotestsrc ! queue"), rig_of("a.mkv", "lf:///rig.json")})
    require_trust(rig, path, false);
}

TEST(RigTrust, ElementsNeedAFileThatOthersCannotWrite) {
  const TempDir dir;
  const std::string path = dir.write("rig.json", "");
  chmod(path.c_str(), 0646);
  EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, false), "rig.json", "other users");
  EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, true), "rig.json", "other users");
  chmod(path.c_str(), 0664);
  if (geteuid() == 0) {  // root may assign a file to any group, other users may not
    ASSERT_EQ(chown(path.c_str(), 0, 33), 0);
    EXPECT_ERROR(require_trust(rig_of("videotestsrc ! queue"), path, false), "rig.json", "other users");
    ASSERT_EQ(chown(path.c_str(), 0, 0), 0);
    require_trust(rig_of("videotestsrc ! queue"), path, false);
  }
  require_trust(rig_of("a.mkv"), path, false);
  require_trust(rig_of("videotestsrc ! queue"), "", false);
}

TEST(RedactedLocation, HidesUsersAndPasswords) {
  const std::pair<const char*, const char*> cases[] = {
      {"rtsp://admin:secret@host:554/stream?channel=1", "rtsp://host:554/stream?channel=1"},
      {"rtsp://admin@host/", "rtsp://host/"},
      {"http://a:b@c@host/x@y", "http://host/x@y"},
      {"http://admin:pa/ss@host/x", "http://host/x"},
      {"http://admin:@host/x", "http://host/x"},
      {"http://host:80/a@b", "http://host:80/a@b"},
      {"http://[::1]/a@b", "http://[::1]/a@b"},
      {"http://host/video.cgi?user=admin&pwd=secret&size=1", "http://host/video.cgi?user=***&pwd=***&size=1"},
      {"srt://host:7000?passphrase=secret#x", "srt://host:7000?passphrase=***#x"},
      {"rtspsrc location=\"rtsp://u:secret@h/\" user-id=me user-pw=sec,ret latency=5 ! queue",
       "rtspsrc location=\"rtsp://h/\" user-id=*** user-pw=*** latency=5 ! queue"},
      {"rtspsrc user-pw = \"sec \\\" ret\" latency=5", "rtspsrc user-pw=*** latency=5"},
      {"souphttpsrc user-pw='sec ret' location=http://h/", "souphttpsrc user-pw=*** location=http://h/"},
      {"details, password=(string)\"sec ret\", n=(int)5;", "details, password=***, n=(int)5;"},
      {"srtsrc passphrase=sec\\ ret x=1", "srtsrc passphrase=*** x=1"},
      {"Not found (404), URL: http://u:secret@h/a.jpg, Redirect to: (NULL)",
       "Not found (404), URL: http://h/a.jpg, Redirect to: (NULL)"},
      {"two: rtsp://a:b@c/ and 'rtsp://d:e@f/'", "two: rtsp://c/ and 'rtsp://f/'"},
      {"http://host/videostream.cgi?loginuse=admin&loginpas=secret&resolution=32",
       "http://host/videostream.cgi?loginuse=***&loginpas=***&resolution=32"},
      {"souphttpsrc extra-headers=\"h,Authorization=(string)secret\" location=http://h/",
       "souphttpsrc extra-headers=*** location=http://h/"},
      {"could not set property \"cookies\" in element \"souphttpsrc\" to \"<secret>\"",
       "could not set property \"cookies\" in element \"souphttpsrc\" to \"***\""},
      {"Connecting to rtsp://ad min:secret@host/x", "Connecting to rtsp://host/x"},
      {"rtmp://host:1935/app/secret", "rtmp://host:1935/***"},
      {"rtsp:/admin:secret@host/x", "host/x"},
      {"admin:secret@host/x: no such file", "host/x: no such file"},
      {"cam_%04d.jpg", "cam_%04d.jpg"},
      {"v4l2:///dev/video0", "v4l2:///dev/video0"},
      {"v4l2src device=/dev/video0 ! image/jpeg,width=640", "v4l2src device=/dev/video0 ! image/jpeg,width=640"},
      {"", ""},
      {"password=", "password=***"},
      {"://", "://"},
  };
  for (const auto& [source, shown] : cases) EXPECT_EQ(redacted_location(source), shown);
  for (const char* text : {"user: the camera is not there", "key-int-max=30 is unknown", "a = b", "keys=3", "a@b.c"})
    EXPECT_EQ(redacted_location(text), text);
}

TEST(RigSecrets, MustNotBeAccessibleToOtherUsers) {
  const TempDir dir;
  Rig rig = make_grid_rig({1, 3, 0.1, 60, 64, 48});
  rig.cameras[0].source = "rtsp://host/stream";
  save_rig(rig, dir / "rig.json");
  namespace fs = std::filesystem;
  fs::permissions(dir / "rig.json", fs::perms(0644));
  EXPECT_EQ(secret_warning(rig, dir / "rig.json"), "") << "no secret";
  rig.cameras[2].image = "http://user:secret@host/a.jpg";
  EXPECT_THAT(secret_warning(rig, dir / "rig.json"), mentions("cameras[2]", "source"));
  rig.cameras[1].source = "rtsp://user:secret@host/stream";
  EXPECT_MENTIONS(secret_warning(rig, dir / "rig.json"), "cameras[1]", "password", "644", "chmod 600",
                  dir / "rig.json");
  fs::permissions(dir / "rig.json", fs::perms(0600));
  EXPECT_EQ(secret_warning(rig, dir / "rig.json"), "");
  EXPECT_EQ(secret_warning(rig, dir / "none.json"), "");
}

}  // namespace
}  // namespace lf
