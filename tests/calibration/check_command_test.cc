// SPDX-License-Identifier: LGPL-2.1-or-later
#include <arpa/inet.h>

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

// lf-calibrate check on later tracks and recordings, and on output of the running monitor.

class CheckCommand : public testing::Test {
 protected:
  CheckCommand() {
    sim::ArrayOptions options;
    options.rows = options.columns = 3;
    rig_ = sim::make_array(options, 4);
    save_rig(rig_, dir_ / "rig.json");
  }
  Outcome check(const std::string& arguments) {
    return run_program("lf-calibrate", "check rig.json " + arguments, dir_.path());
  }
  void film(const Rig& now) {
    sim::PathOptions path;
    path.bar = 0.3, path.noise = 0.05;
    dir_.write("tracks.json", tracks_to_json(sim::watch(now, path, 9).tracks));
  }
  // Writes output of the monitor with a fault of camera 4.
  void write_monitor(const char* fault) {
    nlohmann::json cameras = nlohmann::json::array();
    for (size_t i = 0; i < 9; i++) {
      const bool corner = i == 0 || i == 2 || i == 6 || i == 8, odd = i == 4 && *fault != 0;
      nlohmann::json camera = {{"name", rig_.cameras[i].name},
                               {"psnr", 30},
                               {"gain", odd ? 1.08 : 1.0},
                               {"shift", odd ? 1.5 : 0.02},
                               {"fault", nullptr}};
      if (corner) camera["psnr"] = camera["gain"] = camera["shift"] = nullptr;
      if (odd) camera["fault"] = fault;
      cameras.push_back(camera);
    }
    dir_.write("monitor.json", nlohmann::json({{"turns", 90}, {"bytes", 1}, {"cameras", cameras}}).dump());
  }

  const TempDir dir_;
  Rig rig_;
};

TEST_F(CheckCommand, ExitStatusIsTheVerdict) {
  film(rig_);
  const Outcome holds = check("--tracks tracks.json --bar 0.3 --json check.json");
  EXPECT_EQ(holds.status, 0) << holds.output;
  EXPECT_THAT(holds.output, AllOf(mentions("rig.json holds", "9 of 9"), HasSubstr("bar         300.")));

  Rig now = rig_;
  now.cameras[4].pose.orientation = now.cameras[4].pose.orientation * glm::angleAxis(0.01, Vec3(0, 1, 0));
  film(now);
  const Outcome moved = check("--tracks tracks.json --json check.json");
  EXPECT_EQ(moved.status, 1) << moved.output;
  EXPECT_THAT(moved.output, mentions("camera 4", "cam_01_01", "moved", "4."));
  EXPECT_THAT(moved.output, mentions("turned", "0.57", "right"));
  EXPECT_THAT(moved.output, mentions("rig.json", "not hold", "1 of 9"));
  const nlohmann::json report = parse_json(read_text_file(dir_ / "check.json"), "check.json");
  EXPECT_EQ(report["format"], "lightfield-check");
  EXPECT_EQ(report["cameras"][4]["state"], "moved");
  EXPECT_NEAR(report["cameras"][4]["turn_deg"][1].get<double>(), 0.573, 0.02);
  EXPECT_EQ(report["cameras"][3]["state"], "holds");
}

TEST_F(CheckCommand, ReadsTheCameraMonitor) {
  const struct {
    const char* fault;
    int status;
    std::vector<std::string> facts;
  } cases[] = {
      {"", 0, {"rig.json holds", "5 of 9"}},
      {"direction", 1, {"camera 4", "cam_01_01", "another direction", "6 pixels"}},
      {"colour", 0, {"camera 4", "cam_01_01", "8 %", "exposure"}},
      {"picture", 0, {"focus", "dirty", "covered"}},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.fault);
    write_monitor(c.fault);
    test::expect_outcome(check("--monitor monitor.json"), c.status, mentions(c.facts));
  }
}

TEST_F(CheckCommand, UnknownVerdictNamesTheRemedy) {
  film(rig_);
  Rig other = rig_;
  other.cameras[3].id = 70;
  save_rig(other, dir_ / "other.json");
  Tracks dark = parse_tracks(read_text_file(dir_ / "tracks.json"), "tracks.json");
  dark.observations.clear();
  dir_.write("dark.json", tracks_to_json(dark));
  write_monitor("");
  nlohmann::json early = parse_json(read_text_file(dir_ / "monitor.json"), "monitor.json");
  early["cameras"] = nlohmann::json::array();
  dir_.write("early.json", early.dump());
  std::filesystem::create_directory(dir_ / "empty");
  const struct {
    const char* arguments;
    std::vector<std::string> facts;
  } cases[] = {
      {"rig.json --tracks dark.json", {"three cameras", "light", "this rig"}},
      {"other.json --tracks tracks.json", {"camera 3", "rig"}},
      {"rig.json --recordings empty", {"three cameras", "moving light"}},
      {"rig.json --recordings nowhere", {"nowhere:", "folder"}},
      {"rig.json --tracks rig.json", {"rig.json"}},
      {"rig.json --monitor early.json", {"not checked", "camera"}},
      {"rig.json --monitor http://127.0.0.1:1", {"lf-serve", "address"}},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.arguments);
    test::expect_outcome(run_program("lf-calibrate", std::string("check ") + c.arguments, dir_.path()), 2,
                         AllOf(mentions(c.facts), Not(HasSubstr("holds: "))));
  }
  EXPECT_EQ(check("").status, 2) << "nothing is asked";
}

// Answers every request on a port of this machine with one byte a second.
class SlowServer {
 public:
  SlowServer() {
    sockaddr_in address{.sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(listener_, 1), 0);
    EXPECT_EQ(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::jthread([this] {
      const int client = accept(listener_, nullptr, nullptr);
      std::string part = "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n";
      while (send(client, part.data(), part.size(), MSG_NOSIGNAL) > 0) {
        part = " ";
        std::this_thread::sleep_for(std::chrono::seconds(1));
      }
      close(client);
    });
  }
  ~SlowServer() {
    shutdown(listener_, SHUT_RDWR);
    thread_ = {};
    close(listener_);
  }
  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_); }

 private:
  const int listener_ = socket(AF_INET, SOCK_STREAM, 0);
  int port_ = 0;
  std::jthread thread_;
};

TEST_F(CheckCommand, TimesOutForASlowServer) {
  const SlowServer server;
  test::expect_outcome(check("--monitor " + server.address()), 2, AllOf(HasSubstr(server.address()), mentions("20 s")));
}

class ReportCommand : public testing::Test {
 protected:
  Outcome run(const std::string& arguments) { return run_program("lf-calibrate", arguments, dir_.path()); }
  std::string page() const { return read_text_file(dir_ / "report.html"); }
  // Writes solve.json of a rig; camera 4 sees nothing or everything.
  void solve(bool blind) {
    sim::ArrayOptions array;
    array.rows = array.columns = 3;
    sim::PathOptions path;
    path.bar = 0.3;
    Tracks tracks = sim::watch(sim::make_array(array, 1), path, 2).tracks;
    if (blind) std::erase_if(tracks.observations, [](const Observation& o) { return o.camera == 4; });
    dir_.write("tracks.json", tracks_to_json(tracks));
    const Outcome solved = run("solve --tracks tracks.json --bar 0.3 --out rig.json --json solve.json");
    ASSERT_EQ(solved.status, blind ? 1 : 0) << solved.output;
  }

  const TempDir dir_;
};

TEST_F(ReportCommand, PageIsSelfContained) {
  solve(false);
  test::expect_outcome(run("report solve.json --title \"A <rig> & more\""), 0, HasSubstr("report.html: "));
  const std::string html = page();
  EXPECT_THAT(html, AllOf(HasSubstr("A &lt;rig&gt; &amp; more"), HasSubstr("<svg "), HasSubstr("What to do"),
                          HasSubstr("prefers-color-scheme: dark")));
  // The page loads no external resources.
  EXPECT_THAT(html, AllOf(Not(HasSubstr("http")), Not(HasSubstr("src=")), Not(HasSubstr("<script"))));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  for (const char* part : {"Residuals", "Coverage", "ellipsoids", "light positions", "Depth scale"})
    EXPECT_THAT(html, HasSubstr(part));
}

TEST_F(ReportCommand, MissingCameraIsReportedFirst) {
  solve(true);
  test::expect_outcome(run("report solve.json"), 0,
                       AllOf(mentions("1 camera", "9", "attention"), mentions("camera 4", "light")));
  EXPECT_THAT(page(), AllOf(mentions("1 camera", "9", "attention"), HasSubstr("badge bad"), HasSubstr("8 of 9")));
}

TEST_F(ReportCommand, ReportsAreMergedByCamera) {
  solve(false);
  dir_.write("colour.json", R"({"format": "lightfield-colour-report", "version": 1, "from": "12 charts",
      "terms": "brightness", "before": {"median": 5.9, "p95": 18.7}, "after": {"median": 0.67, "p95": 2.6},
      "trials": [{"terms": "brightness", "held_out": {"median": 0.7, "p95": 2.7}}],
      "findings": [{"severity": "warning", "code": "stuck-exposure", "text": "camera 2 (cam_2): its exposure is stuck"}],
      "cameras": [{"id": 2, "corrected": true, "gain": 1.6, "rms": 1, "clipped": 0.3, "stuck": true},
                  {"id": 3, "corrected": true, "gain": 1.02, "rms": 0.6, "clipped": 0, "stuck": false}]})");
  dir_.write("check.json", R"({"format": "lightfield-check", "version": 1, "from": "monitor", "holds": false,
      "findings": [{"severity": "error", "code": "moved", "text": "camera 7 (cam_7) looks elsewhere"}],
      "cameras": [{"id": 7, "name": "cam_7", "state": "moved", "shift_px": 6}]})");
  test::expect_outcome(
      run("report solve.json colour.json check.json"), 0,
      AllOf(HasSubstr("no longer holds"), AllOf(mentions("camera 7", "cam_7", "elsewhere"), HasSubstr("exposure"))));
  EXPECT_THAT(page(), AllOf(HasSubstr("Latest check"), HasSubstr("camera monitor"), HasSubstr("18.7")));
}

TEST_F(ReportCommand, OtherFilesAreErrors) {
  dir_.write("tracks.json", R"({"format": "lightfield-tracks"})");
  dir_.write("damaged.json", R"({"format": "lightfield-check", "findings": [], "cameras": [{"id": "x"}]})");
  dir_.write("text.json", "what");
  const struct {
    const char* arguments;
    std::vector<std::string> facts;
  } cases[] = {
      {"tracks.json", {"tracks.json", "report", "lf-calibrate"}},
      {"damaged.json", {"damaged.json:", "report", "damaged", "version"}},
      {"text.json", {"text.json"}},
      {"nowhere.json", {"nowhere.json"}},
      {"", {"FILE"}},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.arguments);
    test::expect_outcome(run(std::string("report ") + c.arguments), 1, mentions(c.facts));
    EXPECT_FALSE(std::filesystem::exists(dir_ / "report.html"));
  }
}

}  // namespace
}  // namespace lf
