// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/location_text.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(LocationText, HidesUsersAndPasswords) {
  struct {
    const char *source, *shown;
  } const cases[] = {
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
  for (const auto& [source, shown] : cases) EXPECT_EQ(location_text(source), shown);
}

TEST(LocationText, ATextWithoutSecretsStays) {
  for (const char* text : {"user: the camera is not there", "key-int-max=30 is unknown", "a = b", "keys=3", "a@b.c"})
    EXPECT_EQ(location_text(text), text);
}

}  // namespace
}  // namespace lf
