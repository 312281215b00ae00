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
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace {

// Answers one client at a time.
class Server {
 public:
  // Returns whether the client takes more of them.
  using Send = std::function<bool(const std::string& bytes)>;
  // Called for each client that has said something.
  using Answer = std::function<void(const Send& send)>;

  explicit Server(Answer answer) : answer_(std::move(answer)) {
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
  ~Server() {
    stopping_ = true;
    shutdown(listening_, SHUT_RDWR);
    thread_.join();
    close(listening_);
  }
  Server(const Server&) = delete;
  std::string uri(const std::string& scheme = "http") const {
    return scheme + "://127.0.0.1:" + std::to_string(port_) + "/stream";
  }
  int connections() const { return connections_; }

 private:
  void serve() {
    while (!stopping_) {
      const int client = accept(listening_, nullptr, nullptr);
      if (client < 0) return;
      connections_++;
      char request[4096];
      if (recv(client, request, sizeof request, 0) > 0)
        answer_([this, client](const std::string& bytes) { return !stopping_ && send_all(client, bytes); });
      close(client);
    }
  }
  static bool send_all(int client, const std::string& bytes) {
    return send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }

  const Answer answer_;
  int listening_ = -1, port_ = 0;
  std::atomic<bool> stopping_ = false;
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

constexpr char kHeader[] = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n";

// Sends the pictures jpeg_00.jpg, jpeg_01.jpg, ... of the fixture at 20 pictures/s.
class MjpegServer : public Server {
 public:
  // `most`: pictures after which a connection is closed.
  MjpegServer(const CameraFiles& files, bool with_length, int most)
      : Server([pictures = load(files), with_length, most](const Send& send) {
          bool goes_on = send(kHeader);
          for (int i = 0; i < most && goes_on; i++) {
            const std::string& picture = pictures[static_cast<size_t>(i % kFrames)];
            std::string part = "--frame\r\nContent-Type: image/jpeg\r\n";
            if (with_length) part += "Content-Length: " + std::to_string(picture.size()) + "\r\n";
            goes_on = send(part + "\r\n" + picture + "\r\n");
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
          }
        }) {}

 private:
  static std::vector<std::string> load(const CameraFiles& files) {
    std::vector<std::string> pictures;
    for (int k = 0; k < kFrames; k++) {
      std::ifstream file(files.path("jpeg_0" + std::to_string(k) + ".jpg"), std::ios::binary);
      pictures.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
    return pictures;
  }
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

// A part without an end, and one of two gigabytes: what has been sent is kept until the part is complete.
TEST_F(CamSrcHttpTest, ACameraThatSendsNoPictureIsAnError) {
  for (const std::string length : {"", "Content-Length: 2147483640\r\n"}) {
    size_t sent = 0;
    const Server server([&](const Server::Send& send) {
      const std::string nothing(1 << 20, 'a');
      if (!send(kHeader + ("--frame\r\nContent-Type: image/jpeg\r\n" + length) + "\r\n")) return;
      while (send(nothing)) sent += nothing.size();
    });
    CameraPipeline camera("is-live=true rig=" + rig_with_source(server.uri()));
    camera.set_state(GST_STATE_PLAYING);
    EXPECT_THAT(camera.wait(20 * GST_SECOND), testing::HasSubstr("it sends more than 64 MB without a picture"));
    camera.set_state(GST_STATE_NULL);
    EXPECT_LT(sent, size_t{1} << 30);
  }
}

TEST_F(CamSrcHttpTest, APlaylistNamesNoFileOfThisMachine) {
  const Server server([&](const Server::Send& send) {
    send("HTTP/1.0 200 OK\r\nContent-Type: application/vnd.apple.mpegurl\r\n\r\n#EXTM3U\n#EXT-X-TARGETDURATION:4\n"
         "#EXT-X-MEDIA-SEQUENCE:0\n#EXTINF:4,\nfile://" +
         files->path("mjpeg.mkv") + "\n#EXT-X-ENDLIST\n");
  });
  CameraPipeline camera("is-live=true rig=" + rig_with_source(server.uri()));
  camera.set_state(GST_STATE_PLAYING);
  EXPECT_THAT(camera.wait(20 * GST_SECOND), testing::HasSubstr("its playlist names a file of this machine"));
  camera.set_state(GST_STATE_NULL);
  EXPECT_TRUE(camera.frames.empty());
}

// rtspsrc waits for the end of an answer as long as anything comes.
TEST_F(CamSrcHttpTest, ACameraThatNeverEndsItsAnswerIsLeftBehind) {
  const Server server([](const Server::Send& send) {
    for (bool goes_on = send("RTSP/1.0 200 OK\r\nCSeq: 1\r\nX: "); goes_on; goes_on = send("a"))
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
  });
  CameraPipeline camera("is-live=true retry=true rig=" + rig_with_source(server.uri("rtsp")));
  camera.set_state(GST_STATE_PLAYING);
  while (server.connections() == 0) g_usleep(1000);
  g_usleep(300'000);
  const gint64 begin = g_get_monotonic_time();
  camera.set_state(GST_STATE_NULL);
  EXPECT_LT(g_get_monotonic_time() - begin, 10'000'000);
}

}  // namespace
}  // namespace lf::test
