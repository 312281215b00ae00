// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "support/photographs.h"
#include "support/run_program.h"

namespace lf {
namespace {

constexpr int kWidth = 33, kHeight = 24;  // rows are padded in the raw video

class LfReport : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(2, 2, kWidth, kHeight);
    test::save_photographs(rig, dir_, 0);
    views_ = make_tour(rig, {1.2, 4.5}, {.frames = 3, .rate_hz = 10});
    save_views(views_, dir_ / "views.json");
    write_frames(3, 5);
    write_frames(3, 20, "plane.rgb");
    write_log("log", {{10.0, 100, 4'000'000}, {10.5, 200, 6'000'000}, {11.0, 300, 5'000'000}});
  }

  void write_frames(size_t count, int error, const std::string& name = "frames.rgb") {
    std::ofstream file(dir_ / name, std::ios::binary);
    for (size_t i = 0; i < count; i++) {
      const View& view = views_[i].view;
      const Image truth = render_scene({kWidth, kHeight, view.lens, view.pose}, views_[i].time);
      for (int y = 0; y < kHeight; y++) {
        for (int k = 0; k < 3 * kWidth; k++) file.put(static_cast<char>(std::min(255, truth.pixel(0, y)[k] + error)));
        file.put(0);
      }
    }
  }
  struct Message {
    double clock;
    int bytes, latency_ns;
  };
  void write_log(const std::string& name, const std::vector<Message>& messages) {
    std::ofstream file(dir_ / name);
    file << "9.5 Setting pipeline to PLAYING ...\n";
    int sequence = 0;
    for (const Message& m : messages)
      file << std::fixed << m.clock
           << " Got message #9 from element \"c\" (element): lightfield-view, view-id=(uint)0, "
           << "sequence=(uint)" << sequence++ << ", pts=(guint64)0, complete=(boolean)true, fragments=(uint)3, "
           << "missing=(uint)0, bytes=(guint64)" << m.bytes << ", consistency-bytes=(guint64)" << m.bytes / 10
           << ", skew-ns=(guint64)0, latency-ns=(guint64)" << m.latency_ns << ", composite-ns=(guint64)1;\n";
  }
  Outcome report(const std::string& more = "") {
    return run_program(
        "lf-report",
        "--rig rig.json --views views.json --frames frames.rgb --plane plane.rgb --log log --out out " + more,
        dir_.path());
  }
  nlohmann::json figures() const { return nlohmann::json::parse(read_text_file(dir_ / "out/report.json")); }

  TempDir dir_;
  std::vector<NamedView> views_;
};

TEST_F(LfReport, ReportsFiguresAgainstTheGroundTruth) {
  write_log("live", {{1, 9, 20'000'000}, {2, 9, 30'000'000}, {3, 9, 40'000'000}});
  test::expect_outcome(report("--scene --live-log live"), 0, HasSubstr("\"fps\": 2.0"));
  const nlohmann::json json = figures();
  EXPECT_EQ(json["frames"], 3);
  EXPECT_NEAR(json["fps"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(json["latency_ms"]["p50"].get<double>(), 30, 1e-9);
  EXPECT_NEAR(json["latency_ms"]["p95"].get<double>(), 40, 1e-9);
  EXPECT_NEAR(json["bytes_per_frame"].get<double>(), 200, 1e-9);
  EXPECT_NEAR(json["consistency_bytes_per_frame"].get<double>(), 20, 1e-9);
  EXPECT_NEAR(json["psnr_db"].get<double>(), 20 * std::log10(255 / 5.0), 0.3);
  EXPECT_NEAR(json["plane_psnr_db"].get<double>(), 20 * std::log10(255 / 20.0), 0.3);
  EXPECT_GT(load_image(dir_ / "out/sheet.png").width(), 1000);
}

TEST_F(LfReport, WorksWithoutTruthAndLiveRun) {
  test::expect_outcome(report(), 0);
  EXPECT_TRUE(figures()["psnr_db"].is_null());
  EXPECT_TRUE(figures()["plane_psnr_db"].is_null());
  EXPECT_NEAR(figures()["latency_ms"]["p50"].get<double>(), 5, 1e-9);
}

TEST_F(LfReport, RefusesAFifoWithoutWaiting) {
  ASSERT_EQ(mkfifo((dir_ / "fifo").c_str(), 0600), 0);
  for (const char* option : {"--frames", "--plane", "--log"}) {
    std::string line = "--rig rig.json --views views.json --frames frames.rgb --plane plane.rgb --log log --out out";
    const size_t value = line.find(option) + std::string(option).size() + 1;
    line.replace(value, line.find(' ', value) - value, "fifo");
    test::expect_outcome(run_program("lf-report", line, dir_.path()), 1, mentions("fifo", "regular file"));
  }
}

TEST_F(LfReport, RefusesMismatchedInputs) {
  const auto expect_failure = [&](const std::vector<std::string>& facts) {
    test::expect_outcome(report(), 1, mentions(facts));
  };
  write_frames(2, 0, "plane.rgb");
  expect_failure({"plane.rgb", "2 pictures", "frames.rgb", "3"});
  write_frames(2, 0);
  expect_failure({"frames.rgb", "2 pictures", "3 views", "3 messages"});
  std::ofstream(dir_ / "frames.rgb", std::ios::app) << "x";
  expect_failure({"frames.rgb", "RGB", "33x24"});
  write_log("log", {});
  expect_failure({"log:", "lightfield-view"});
  std::ofstream(dir_ / "log") << "1 (element): lightfield-view, view-id=(uint)0;\n";
  expect_failure({"field sequence"});
}

}  // namespace
}  // namespace lf
