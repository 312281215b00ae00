// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Network cameras that send Motion JPEG over HTTP, as mjpg-streamer, ESP32-CAM, OctoPrint and Axis do.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace {

// Sends the pictures jpeg_00.jpg, jpeg_01.jpg, ... of the fixture at 20 pictures/s, to one client at a time.
class MjpegServer {
 public:
  // `most`: pictures after which a connection is closed.
  MjpegServer(const CameraFiles& files, bool with_length, int most) : with_length_(with_length), most_(most) {
    for (int k = 0; k < kFrames; k++) {
      std::ifstream file(files.path("jpeg_0" + std::to_string(k) + ".jpg"), std::ios::binary);
      pictures_.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
    listening_ = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(listening_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(listening_, 8), 0);
    getsockname(listening_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~MjpegServer() {
    stopping_ = true;
    shutdown(listening_, SHUT_RDWR);
    thread_.join();
    close(listening_);
  }
  MjpegServer(const MjpegServer&) = delete;
  std::string uri() const { return "http://127.0.0.1:" + std::to_string(port_) + "/stream"; }
  int connections() const { return connections_; }

 private:
  void serve() {
    while (!stopping_) {
      const int client = accept(listening_, nullptr, nullptr);
      if (client < 0) return;
      connections_++;
      answer(client);
      close(client);
    }
  }
  static bool send_all(int client, const std::string& bytes) {
    return send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }
  void answer(int client) {
    char request[4096];
    if (recv(client, request, sizeof request, 0) <= 0) return;
    if (!send_all(client, "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n")) return;
    for (int i = 0; i < most_ && !stopping_; i++) {
      const std::string& picture = pictures_[static_cast<size_t>(i % kFrames)];
      std::string part = "--frame\r\nContent-Type: image/jpeg\r\n";
      if (with_length_) part += "Content-Length: " + std::to_string(picture.size()) + "\r\n";
      if (!send_all(client, part + "\r\n" + picture + "\r\n")) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }

  const bool with_length_;
  const int most_;
  std::vector<std::string> pictures_;
  int listening_ = -1, port_ = 0;
  std::atomic<bool> stopping_ = false;
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

class CamSrcHttpTest : public CamSrcTest {};

TEST_F(CamSrcHttpTest, FramesAreDatedByTheirArrival) {
  for (const bool with_length : {true, false})
    for (const std::string live : {"true", "false"}) {
      SCOPED_TRACE(live + (with_length ? "" : ", without Content-Length"));
      const MjpegServer server(*files, with_length, 1000);
      CameraPipeline camera("num-frames=12 is-live=" + live + " rig=" + rig_with_source(server.uri()));
      ASSERT_TRUE(camera.reach(GST_STATE_PLAYING));
      const GstClockTime begin = gst_element_get_base_time(camera.pipeline());
      ASSERT_EQ(camera.wait(), "EOS");
      camera.set_state(GST_STATE_NULL);
      ASSERT_EQ(camera.frames.size(), 12u);
      // The first ones come together, as the kind of stream is found from them, and may have waited for PLAYING.
      size_t first = 2;
      while (first < 6 && camera.frames[first - 1].running_time == 0) first++;
      for (size_t k = first; k < camera.frames.size(); k++) {
        EXPECT_GT(camera.frames[k].running_time, camera.frames[k - 1].running_time) << k;
        EXPECT_NEAR(static_cast<double>(camera.frames[k].capture_time),
                    static_cast<double>(begin + camera.frames[k].running_time), 1e6)
            << k;
      }
    }
}

TEST_F(CamSrcHttpTest, StaysJpegForANode) {
  const MjpegServer server(*files, true, 1000);
  const ElementPtr pipeline =
      launch("lfcamsrc decode=false is-live=true num-frames=5 rig=" + rig_with_source(server.uri()) +
             " ! image/jpeg ! jpegdec ! fakesink sync=false");
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(run(pipeline.get()), "");
}

// No second stream is waited for, which would take 10 s at pictures as small as these.
TEST_F(CamSrcHttpTest, StartsWithTheFirstPictures) {
  const MjpegServer server(*files, true, 1000);
  CameraPipeline camera("num-frames=1 is-live=true rig=" + rig_with_source(server.uri()));
  camera.set_state(GST_STATE_PLAYING);
  EXPECT_EQ(camera.wait(5 * GST_SECOND), "EOS");
}

TEST_F(CamSrcHttpTest, IsOpenedAgainWhereTheConnectionEnds) {
  const MjpegServer server(*files, true, 5);
  CameraPipeline camera("num-frames=12 is-live=true loop=true retry=true rig=" + rig_with_source(server.uri()));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.frames.size(), 12u);
  EXPECT_GE(server.connections(), 3);
}

}  // namespace
}  // namespace lf::test
