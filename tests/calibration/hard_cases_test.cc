// SPDX-License-Identifier: LGPL-2.1-or-later
// The table of hard cases: each must end with the right solution or with a finding that names the fault.
#include "base/text.h"
#include "calibration/diagnosis.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf::sim {
namespace {

struct Case {
  const char* name;
  const char* finding;  // finding that excuses a wrong result; "": the result must be right
  ArrayOptions array{};
  PathOptions path{};
  bool prior = true;
  void (*change)(Rig& truth, Watched& watched, SolveOptions& options) = nullptr;
  void (*before)(Rig& truth) = nullptr;  // edits the rig before it is observed
};

// Returns the root mean square error of poses after the best similarity, in the solution's own sigmas. Below 2 is
// right.
double error_in_sigmas(const Solution& solution, const Rig& truth) {
  std::vector<Pose> found, expected;
  std::vector<int> rows;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    found.push_back(solution.scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
    rows.push_back(solution.uncertainty.camera_row[i]);
  }
  const Similarity s = align(found, expected);
  double error = 0, told = 0;
  for (size_t i = 0; i < found.size(); i++) {
    const Vec3 e = s(found[i]).position - expected[i].position;
    error += glm::dot(e, e);
    told += solution.uncertainty.covariance.diagonal().segment(rows[i] + 3, 3).sum() * s.scale * s.scale;
  }
  return std::sqrt(error / told);
}

std::vector<Case> cases() {
  std::vector<Case> list;
  const auto add = [&](const char* name, const char* finding) -> Case& {
    list.push_back({name, finding});
    list.back().array.rows = list.back().array.columns = 5;
    return list.back();
  };
  add("reflections in all cameras", "").change = [](Rig& truth, Watched& w, SolveOptions&) {
    // At every fifth position all cameras see the light's reflection in a window.
    for (Observation& o : w.tracks.observations) {
      if (o.position % 5) continue;
      Vec3 p = w.lights[o.position];
      p.x = 1.2 - p.x;
      if (const auto pixel = truth.cameras[o.camera].lens.project(truth.cameras[o.camera].pose.camera_from_world(p)))
        if (std::abs(pixel->x - 160) < 300 && std::abs(pixel->y - 120) < 200) o.pixel = *pixel;
    }
  };
  add("swapped camera ids", "swapped-cameras").change = [](Rig&, Watched& w, SolveOptions&) {
    std::swap(w.tracks.cameras[3].id, w.tracks.cameras[17].id);
  };
  add("50 % missed", "").path.missed = 0.5;
  add("a dead camera", "dead-camera").change = [](Rig&, Watched& w, SolveOptions&) {
    std::erase_if(w.tracks.observations, [](const Observation& o) { return o.camera == 7; });
  };
  add("disconnected groups", "disconnected-groups").change = [](Rig&, Watched& w, SolveOptions&) {
    std::erase_if(w.tracks.observations, [](const Observation& o) { return (o.camera < 10) != (o.position < 50); });
  };
  add("light on a plane", "").path.shape = PathOptions::Shape::kPlane;
  add("light on a line", "soft-positions").path.shape = PathOptions::Shape::kLine;
  Case& far = add("far light only", "soft-positions");
  far.path.near = 60, far.path.far = 100;
  Case& row = add("one row of cameras", "");
  row.array.rows = 1, row.array.columns = 16;
  Case& still = add("no pointing jitter", "");
  still.array.pointing_jitter = 0;
  Case& blind = add("no jitter, no lens known", "soft-depth");
  blind.array.pointing_jitter = 0, blind.array.position_jitter = 0, blind.prior = false;
  add("a camera rotated by 90 degrees", "").before = [](Rig& truth) {
    truth.cameras[8].pose.orientation *= glm::angleAxis(M_PI / 2, Vec3(0, 0, 1));
  };
  add("12 points", "").path.positions = 12;
  Case& many = add("256 cameras", "");
  many.array.rows = many.array.columns = 16, many.array.pitch = 0.03, many.path.positions = 50;
  Case& strong = add("k1 = -0.3", "");
  strong.array.k1 = -0.3;
  add("one different lens", "").before = [](Rig& truth) {
    truth.cameras[6].lens = Lens(LensModel::kRadial, {300, 159.5, 119.5, 0.05, 0});
  };
  const auto wrong_prior = [](Rig&, Watched&, SolveOptions& options) {
    for (Camera& camera : options.prior->cameras) {
      auto params = camera.lens.params();
      params[0] *= 1.05;
      camera.lens = Lens(LensModel::kRadial, params);
    }
  };
  add("prior wrong by 5 %, one light", "unknown-focal-length").change = wrong_prior;
  Case& bar = add("prior wrong by 5 %, bar", "prior-contradicted");
  bar.path.bar = 0.3, bar.change = wrong_prior;
  add("a camera one frame late", "late-camera").change = [](Rig&, Watched& w, SolveOptions&) {
    for (Observation& o : w.tracks.observations)
      if (o.camera == 11) o.position++;
    std::erase_if(w.tracks.observations, [&](const Observation& o) { return o.position >= w.tracks.num_positions; });
  };
  add("millimetres for metres", "odd-scale").change = [](Rig&, Watched&, SolveOptions& options) {
    for (Camera& camera : options.prior->cameras) camera.pose.position *= 1000;
  };
  add("origin 10 km away", "").change = [](Rig&, Watched&, SolveOptions& options) {
    for (Camera& camera : options.prior->cameras) camera.pose.position += Vec3(1e4, 0, 0);
  };
  return list;
}

TEST(HardCases, EachIsSolvedOrReported) {
  std::printf("%-32s %10s  %s\n", "case", "in sigmas", "findings");
  for (const Case& c : cases()) {
    Rig truth = make_array(c.array, 5);
    if (c.before) c.before(truth);
    Watched watched = watch(truth, c.path, 6);
    SolveOptions options;
    if (c.prior) measure_lenses(truth, {}, 7, options);
    if (c.change) c.change(truth, watched, options);
    std::string codes;
    double error = 0;
    try {
      const Solution solution = solve_tracks(watched.tracks, options);
      for (const Finding& f :
           diagnose(solution, watched.tracks, options, place_solution(solution, watched.tracks, options, {})))
        if (codes.find(f.code) == std::string::npos && f.severity != Finding::Severity::kNote)
          codes += (codes.empty() ? "" : " ") + f.code;
      error = error_in_sigmas(solution, truth);
    } catch (const Error& e) {
      codes = e.what();
    }
    std::printf("%-32s %10.2f  %s\n", c.name, error, codes.c_str());
    if (*c.finding)
      EXPECT_NE(codes.find(c.finding), std::string::npos) << c.name << ": " << codes;
    else
      EXPECT_LE(error, 2) << c.name << ": " << codes;
  }
}

}  // namespace
}  // namespace lf::sim
