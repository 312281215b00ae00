// SPDX-License-Identifier: LGPL-2.1-or-later
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "gst/camera_pipeline.h"
#include "gst/loss_fixture.h"
#include "gst/rtsp_server.h"
#include "support/recorded.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

// Network cameras: an RTSP server on loopback, if gst-rtsp-server is installed.

class RtspTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (kRtspServerMissing) return;
    files = new CameraFiles;
    server = new RtspServer;
  }
  static void TearDownTestSuite() {
    delete server;
    if (server) RtspServer::clean_up();
    delete files;
  }
  void SetUp() override {
    if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  }
  static std::string rig(const std::string& path, int width = CameraFiles::kWidth) {
    return files->save("rig.json", 1, [&](Camera& camera) {
      camera.source = server->uri(path);
      camera.width = width;
    });
  }
  static inline CameraFiles* files = nullptr;
  static inline RtspServer* server = nullptr;
};

TEST_F(RtspTest, FramesAreLiveAndOnTheClock) {
  for (const std::string path : {"/jpeg", "/h264"}) {
    if (path == "/h264" && CameraFiles::h264_encoder().empty()) {
      std::printf("no encoder and decoder of H.264 are installed\n");
      continue;
    }
    CameraPipeline camera("num-buffers=10 latency=50000000 rig=" + rig(path));
    for (int i = 0; i < 4; ++i) {
      camera.frames.clear();
      ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL) << path << ": always live";
      ASSERT_EQ(camera.play(), "EOS") << path << " " << i;
      ASSERT_EQ(camera.frames.size(), 10u);
      EXPECT_EQ(camera.info.width, 64);
      const GstClockTime base_time = gst_element_get_base_time(camera.pipeline());
      for (const Frame& frame : camera.frames) {
        // By arrival or by the sender's time: both are the same machine's clock.
        const GstClockTimeDiff age = GST_CLOCK_DIFF(frame.capture_time, base_time + frame.running_time);
        EXPECT_LT(std::abs(age), static_cast<GstClockTimeDiff>(2 * GST_SECOND)) << path;
        EXPECT_GT(frame.level, 220) << path << ": white";
      }
    }
  }
}

// Frames carry the server's time of day as soon as sender reports arrive.
TEST_F(RtspTest, CaptureTimesComeFromSenderReports) {
  const PipelinePtr pipeline =
      launch("lfcamsrc name=c latency=50000000 rig=" + rig("/jpeg") + " ! fakesink name=s sync=false");
  const ElementPtr camera = child_of(pipeline.get(), "c");
  const auto capture_time = [&]() -> std::string {
    const StructurePtr stats = stats_of(camera.get());
    const gchar* how = gst_structure_get_string(stats.get(), "capture-time");
    return how ? how : "";
  };
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(capture_time(), AnyOf("arrival", "sender-reports"));
  EXPECT_TRUE(eventually([&] { return capture_time() == "sender-reports"; })) << capture_time();

  // The pipeline uses the server's clock, so the age of frames is correct.
  const ElementPtr sink = child_of(pipeline.get(), "s");
  std::atomic<int> frames = 0, wrong = 0;
  on_buffers(sink.get(), "sink", [&](GstBuffer* buffer) {
    const CapsPtr reference(gst_caps_new_empty_simple("timestamp/x-lightfield-capture"));
    const auto* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference.get());
    g_autoptr(GstClock) clock = gst_element_get_clock(sink.get());
    const GstClockTimeDiff age =
        meta && clock ? GST_CLOCK_DIFF(meta->timestamp, gst_clock_get_time(clock)) : -static_cast<gint64>(GST_SECOND);
    if (age < -static_cast<gint64>(GST_SECOND / 10) || age > static_cast<gint64>(3 * GST_SECOND)) wrong++;
    frames++;
  });
  EXPECT_TRUE(eventually([&] { return frames >= 10; })) << frames;
  EXPECT_EQ(wrong, 0);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST_F(RtspTest, JpegStaysJpegWithoutDecoding) {
  EXPECT_EQ(
      run("lfcamsrc decode=false latency=50000000 num-buffers=5 rig=" + rig("/jpeg") + " ! image/jpeg ! fakesink"), "");
}

TEST_F(RtspTest, ErrorsNameThePlace) {
  EXPECT_THAT(CameraPipeline("rig=" + rig("/jpeg", 66)).play(), mentions(server->uri("/jpeg"), "64x48", "66x48"));
  EXPECT_THAT(CameraPipeline("rig=" + rig("/nothing")).play(), mentions("camera 0", "cam_0", server->uri("/nothing")));
}

TEST_F(RtspTest, NodeRecordsCodedPicturesUnchanged) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  const TempDir dir;
  const std::string other = dir / "other.mkv", folder = dir / "recording";
  const PipelinePtr client = launch("rtspsrc latency=50 location=" + server->uri("/h264") +
                                    " ! rtph264depay ! h264parse ! matroskamux ! filesink location=" + other);
  const PipelinePtr pipeline = launch("lfcameranode name=n is-live=true latency=50000000 rig=" + rig("/h264") +
                                      " record=" + folder + " ! fakesink async=false");
  const ElementPtr node = child_of(pipeline.get(), "n");
  const auto size = [&](const std::string& file) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(file, error);
    return error ? 0 : bytes;
  };
  gst_element_set_state(client.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return size(other) > 1000; })) << "the other client has pictures first";
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return size(folder + "/camera0.mkv") >= 3000; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  gst_element_send_event(client.get(), gst_event_new_eos());
  g_autoptr(GstBus) bus = gst_element_get_bus(client.get());
  EXPECT_TRUE(MessagePtr(gst_bus_timed_pop_filtered(bus, 60 * GST_SECOND, GST_MESSAGE_EOS)));
  gst_element_set_state(client.get(), GST_STATE_NULL);
  const RecordedFile recorded = read_recorded(folder + "/camera0.mkv");
  const auto came = slices_of(read_recorded(other)), kept = slices_of(recorded);
  ASSERT_GT(kept.size(), 10u) << came.size();
  EXPECT_EQ(recorded.kind, "video/x-h264");
  EXPECT_TRUE(recorded.keys[0]);
  // Uniform pictures encode to identical bytes, so the recording may begin with any of the identical pictures.
  size_t most = 0;
  for (size_t begin = 0; begin < came.size(); begin++) {
    const size_t common = std::min(kept.size(), came.size() - begin);
    if (std::equal(kept.begin(), kept.begin() + static_cast<ptrdiff_t>(common),
                   came.begin() + static_cast<ptrdiff_t>(begin)))
      most = std::max(most, common);
  }
  EXPECT_GT(most, 10u);
}

// A node with a network camera, which has latency, and a file.
TEST_F(RtspTest, NodeWithNetworkCameraAndFile) {
  const std::string rig = files->save(
      "mixed.json", 2, [](Camera& camera) { camera.source = camera.id == 0 ? server->uri("/jpeg") : "mjpeg.mkv"; });
  const PipelinePtr pipeline =
      launch("lfviewrequest is-live=true framerate=15/1 capture-delay=400000000 rig=" + rig +
             " ! lfcameranode name=n is-live=true loop=true latency=100000000 rig=" + rig + " ! fakesink");
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  const ElementPtr node = child_of(pipeline.get(), "n");
  uint64_t whole = 0, answers = 0, missing = 0;
  EXPECT_TRUE(eventually([&] {
    const uint64_t missing_now = stat(node.get(), "missing-frames"), answers_now = stat(node.get(), "answers");
    if (missing_now == missing) whole += answers_now - answers;
    missing = missing_now;
    answers = answers_now;
    return whole >= 10;
  })) << whole;
}

// --- HTTP ------------------------------------------------------------------------------------------------------------
// Network cameras that send Motion JPEG over HTTP, as mjpg-streamer, ESP32-CAM, OctoPrint and Axis do.

class Server {
 public:
  // Returns false once the client has closed the connection.
  using Send = std::function<bool(const std::string& bytes)>;
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

class MjpegServer : public Server {
 public:
  // `most`: pictures per connection.
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
    for (int k = 0; k < kFrames; k++)
      pictures.push_back(read_binary(files.path("jpeg_0" + std::to_string(k) + ".jpg")));
    return pictures;
  }
};

class CamSrcHttpTest : public CamSrcTest {};

TEST_F(CamSrcHttpTest, CaptureTimeIsTheArrivalTime) {
  for (const bool with_length : {true, false})
    for (const std::string live : {"true", "false"}) {
      SCOPED_TRACE(live + (with_length ? "" : ", without Content-Length"));
      const MjpegServer server(*files, with_length, 1000);
      CameraPipeline camera("num-buffers=12 is-live=" + live + " rig=" + rig_with_source(server.uri()));
      ASSERT_TRUE(camera.reach(GST_STATE_PLAYING));
      const GstClockTime begin = gst_element_get_base_time(camera.pipeline());
      ASSERT_EQ(camera.wait(), "EOS");
      camera.set_state(GST_STATE_NULL);
      ASSERT_EQ(camera.frames.size(), 12u);
      // The first frames arrive together because typefinding buffers them, and they may have waited for PLAYING.
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
  EXPECT_EQ(run("lfcamsrc decode=false is-live=true num-buffers=5 rig=" + rig_with_source(server.uri()) +
                " ! image/jpeg ! jpegdec ! fakesink sync=false"),
            "");
}

// Waiting for a second stream would take 10 s with such small pictures.
TEST_F(CamSrcHttpTest, StartsWithTheFirstPictures) {
  const MjpegServer server(*files, true, 1000);
  CameraPipeline camera("num-buffers=1 is-live=true rig=" + rig_with_source(server.uri()));
  camera.set_state(GST_STATE_PLAYING);
  EXPECT_EQ(camera.wait(5 * GST_SECOND), "EOS");
}

TEST_F(CamSrcHttpTest, ReconnectsWhenTheConnectionEnds) {
  const MjpegServer server(*files, true, 5);
  CameraPipeline camera("num-buffers=12 is-live=true loop=true retry=true rig=" + rig_with_source(server.uri()));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.frames.size(), 12u);
  EXPECT_GE(server.connections(), 3);
}

// Endless parts and parts of 2 GB are buffered only as far as data arrives.
TEST_F(CamSrcHttpTest, CameraWithoutPicturesIsAnError) {
  for (const std::string length : {"", "Content-Length: 2147483640\r\n"}) {
    size_t sent = 0;
    const Server server([&](const Server::Send& send) {
      const std::string nothing(1 << 20, 'a');
      if (!send(kHeader + ("--frame\r\nContent-Type: image/jpeg\r\n" + length) + "\r\n")) return;
      while (send(nothing)) sent += nothing.size();
    });
    CameraPipeline camera("is-live=true rig=" + rig_with_source(server.uri()));
    EXPECT_THAT(camera.play(), mentions("64 MB", "picture"));
    EXPECT_LT(sent, size_t{1} << 30);
  }
}

// The file type of these bytes is JPEG, but no demuxer or parser gives the pictures a time.
TEST_F(CamSrcHttpTest, BytesWithoutTimesAreAnError) {
  for (const std::string decode : {"false", "true"}) {
    const Server server([&](const Server::Send& send) {
      const std::string junk = "\xff\xd8" + std::string(65536, 'z');
      if (!send(kHeader)) return;
      while (send(junk)) {
      }
    });
    CameraPipeline camera("is-live=true decode=" + decode + " rig=" + rig_with_source(server.uri()));
    EXPECT_THAT(camera.play(), AllOf(HasSubstr("camera 0 (cam_0)"),
                                     HasSubstr(decode == "false" ? "without times" : "without a picture")));
  }
}

// A depayloader collects packets until one has the marker bit.
TEST_F(CamSrcHttpTest, RtpWithoutMarkerBitsIsAnError) {
  const int sender = socket(AF_INET, SOCK_DGRAM, 0), receiver = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(bind(receiver, reinterpret_cast<sockaddr*>(&address), size), 0);
  getsockname(receiver, reinterpret_cast<sockaddr*>(&address), &size);
  close(receiver);
  CameraPipeline camera("is-live=true trusted=true rig=" +
                        rig_with_source("udpsrc port=" + std::to_string(ntohs(address.sin_port)) +
                                        " caps=\"application/x-rtp,media=video,encoding-name=JPEG,clock-rate=90000,"
                                        "payload=26\" ! rtpjpegdepay"));
  camera.set_state(GST_STATE_PLAYING);
  std::atomic<bool> stopping = false;
  std::thread packets([&] {
    std::string packet(60000, 'x');
    const unsigned char header[] = {0x80, 26, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 80, 8, 6};
    std::copy(std::begin(header), std::end(header), packet.begin());
    for (unsigned i = 0; !stopping; i++) {
      packet[2] = static_cast<char>(i >> 8);
      packet[3] = static_cast<char>(i);
      sendto(sender, packet.data(), packet.size(), 0, reinterpret_cast<sockaddr*>(&address), size);
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  });
  const std::string text = camera.wait(20 * GST_SECOND);
  stopping = true;
  packets.join();
  close(sender);
  EXPECT_THAT(text, AllOf(HasSubstr("camera 0 (cam_0)"), mentions("64 MB", "picture")));
}

// Servers choose the words of a refusal freely.
TEST_F(CamSrcHttpTest, RefusalStatesTheHttpStatus) {
  for (const std::string status : {"401 Log in, please", "401 Unauthorized", "403 Forbidden"}) {
    const Server server([&](const Server::Send& send) {
      send("HTTP/1.0 " + status + "\r\nWWW-Authenticate: Basic realm=\"camera\"\r\n\r\n");
    });
    CameraPipeline camera("is-live=true rig=" + rig_with_source(server.uri()));
    EXPECT_THAT(camera.play(), mentions("/stream", "HTTP", status.substr(0, 3), status.substr(4)));
  }
}

TEST_F(CamSrcHttpTest, PlaylistCannotOpenLocalFiles) {
  const Server server([&](const Server::Send& send) {
    send(
        "HTTP/1.0 200 OK\r\nContent-Type: application/vnd.apple.mpegurl\r\n\r\n#EXTM3U\n#EXT-X-TARGETDURATION:4\n"
        "#EXT-X-MEDIA-SEQUENCE:0\n#EXTINF:4,\nfile://" +
        files->path("mjpeg.mkv") + "\n#EXT-X-ENDLIST\n");
  });
  CameraPipeline camera("is-live=true rig=" + rig_with_source(server.uri()));
  EXPECT_THAT(camera.play(), mentions("playlist", "this machine"));
  EXPECT_TRUE(camera.frames.empty());
}

// rtspsrc waits for the end of a response as long as data arrives.
TEST_F(CamSrcHttpTest, EndlessResponseIsAbandoned) {
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

class RetryTest : public LossTest {
 protected:
  static std::string camera(const std::string& properties) {
    return "lfcamsrc name=camera " + properties + " ! fakesink name=sink sync=false";
  }
  // Returns the running time of the last frame.
  static GstClockTime time_shown(GstElement* sink) {
    g_autoptr(GstSample) sample = get<GstSample*>(sink, "last-sample");
    EXPECT_TRUE(sample);
    return sample ? gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME,
                                                GST_BUFFER_PTS(gst_sample_get_buffer(sample)))
                  : 0;
  }
};

TEST_F(RetryTest, WithoutRetryALossIsAnError) {
  failing_device(0).frames_at_most = 10;
  const WatchedPipeline pipeline(camera("trusted=true rig=" + devices(1)));
  EXPECT_TRUE(eventually([&] { return !pipeline.errors().empty(); }));
  EXPECT_THAT(pipeline.errors()[0], mentions("failing://0", "Device 0"));
  pipeline.set_state(GST_STATE_NULL);
  EXPECT_EQ(pipeline.lost(0), 0);
}

TEST_F(RetryTest, FailingDeviceIsReopened) {
  failing_device(0).frames_at_most = 10;
  const WatchedPipeline pipeline(camera("retry=true trusted=true rig=" + devices(1)));
  const ElementPtr camera = pipeline.child("camera");
  Pictures frames(pipeline, "sink");
  EXPECT_TRUE(eventually([&] { return frames.count() >= 30; }));
  EXPECT_GE(pipeline.lost(0), 2);
  EXPECT_GE(pipeline.found(0), 2);
  EXPECT_EQ(camera_stats(camera.get()).retries, static_cast<uint64_t>(pipeline.found(0))) << "each attempt succeeds";
  failing_device(0).frames_at_most = 0;
  pipeline.stop();
  EXPECT_EQ(camera_stats(camera.get()).state, "stopped");
}

// After days, decoding everything that a looping file has shown since would take too long.
TEST_F(RetryTest, LoopingFileResumesInItsCurrentLoop) {
  const std::string late = files->path("late.mkv");
  const WatchedPipeline pipeline(
      camera("is-live=true loop=true retry=true rig=" + rig(1, [](guint) { return "late.mkv"; })), GST_STATE_NULL);
  constexpr GstClockTime kRunning = 1000 * 3600 * GST_SECOND;
  GstClock* clock = GST_CLOCK(g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_REALTIME, nullptr));
  gst_pipeline_use_clock(GST_PIPELINE(pipeline.get()), clock);
  gst_element_set_start_time(pipeline.get(), GST_CLOCK_TIME_NONE);
  gst_element_set_base_time(pipeline.get(), gst_clock_get_time(clock) - kRunning);
  gst_object_unref(clock);
  pipeline.set_state(GST_STATE_PLAYING);
  const ElementPtr sink = pipeline.child("sink");
  Pictures frames(pipeline, "sink");
  EXPECT_TRUE(eventually([&] { return pipeline.lost(0) == 1; }));
  std::filesystem::copy(files->path("mjpeg.mkv"), late);
  EXPECT_TRUE(eventually([&] { return pipeline.found(0) == 1 && frames.count() > 5; }));
  EXPECT_GE(time_shown(sink.get()), kRunning);
  pipeline.stop();
  std::filesystem::remove(late);
}

// Frames would be late if the file had to play up to the current loop position first.
TEST_F(RetryTest, ReopenedFileIsNotLate) {
  const std::string late = files->path("late-long.mkv"), whole = files->path("whole-long.mkv");
  run_to_end(
      "videotestsrc num-buffers=60 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! jpegenc ! "
      "matroskamux ! filesink location=" +
      whole);
  const WatchedPipeline pipeline(
      camera("is-live=true loop=true retry=true rig=" + rig(1, [](guint) { return "late-long.mkv"; })));
  const ElementPtr sink = pipeline.child("sink");
  Pictures frames(pipeline, "sink");
  EXPECT_TRUE(eventually([&] { return pipeline.lost(0) == 1; }));
  g_usleep(2'000'000);
  std::filesystem::copy(whole, late);
  EXPECT_TRUE(eventually([&] { return frames.count() > 0; }));
  const GstClockTime taken = time_shown(sink.get());
  EXPECT_LT(gst_element_get_current_running_time(pipeline.get()), taken + GST_SECOND / 2);
  pipeline.stop();
}

TEST_F(RetryTest, MissingDeviceIsLive) {
  failing_device(0).broken = true;
  const WatchedPipeline pipeline(camera("is-live=true retry=true trusted=true rig=" + devices(1)), GST_STATE_NULL);
  EXPECT_EQ(pipeline.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  EXPECT_EQ(pipeline.lost(0), 1);
  const ElementPtr camera = pipeline.child("camera");
  EXPECT_TRUE(eventually([&] { return camera_stats(camera.get()).retries >= 1; }));
  pipeline.set_state(GST_STATE_PLAYING);
  EXPECT_TRUE(gst_element_send_event(pipeline.get(), gst_event_new_eos()));
  EXPECT_TRUE(eventually([&] { return pipeline.has_ended(); }));
}

TEST_F(RetryTest, RunningTimeContinues) {
  const std::string path = rig(1, [](guint) { return "late.mkv"; });
  const WatchedPipeline pipeline(camera("retry=true rig=" + path));
  Pictures frames(pipeline, "sink");
  EXPECT_TRUE(eventually([&] { return pipeline.lost(0) == 1; }));
  std::filesystem::copy(files->path("mjpeg.mkv"), files->path("late.mkv"));
  EXPECT_TRUE(eventually([&] { return pipeline.has_ended(); })) << "at its end";
  EXPECT_EQ(pipeline.found(0), 1);
  EXPECT_EQ(frames.count(), CameraFiles::kFrames);
  pipeline.set_state(GST_STATE_NULL);
  std::filesystem::remove(files->path("late.mkv"));
}

TEST_F(RetryTest, UnreadableRigIsAnError) {
  const WatchedPipeline pipeline(camera("retry=true rig=" + files->path("none.json")), GST_STATE_NULL);
  EXPECT_EQ(pipeline.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(pipeline.errors(), ElementsAre(mentions("none.json", "no such")));
}

}  // namespace
}  // namespace lf::test
