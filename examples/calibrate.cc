// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Calibrates a camera array from the tracks of a moving light. Without arguments, the program simulates an array of
// nine cameras and reports how far the calibration is off.
//
//   g++ -std=c++20 calibrate.cc $(pkg-config --cflags --libs lightfield-calibration) -o calibrate
//   ./calibrate [TRACKS.json RIG.json]
#include <lightfield/calibration.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace {

using namespace lightfield;

constexpr int kSide = 3, kWidth = 320, kHeight = 240, kPlaces = 80;
constexpr double kPitch = 0.06, kFocal = 420;

// If `most_off` is 0, returns the nominal array on a flat board. Otherwise, returns an array with random position
// errors of up to `most_off` metres, which simulates a real array.
Rig make_array(double most_off) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> off(-most_off, most_off);
  std::vector<Camera> cameras(kSide * kSide);
  for (uint32_t i = 0; i < cameras.size(); i++) {
    cameras[i].id = i;
    cameras[i].width = kWidth;
    cameras[i].height = kHeight;
    cameras[i].lens = {kFocal, kFocal, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0};
    cameras[i].world_from_camera.position = {kPitch * (i % kSide) + off(random), kPitch * (i / kSide) + off(random),
                                             off(random)};
  }
  return Rig(cameras, {Topology::Type::kGrid, kSide, kSide, {}});
}

// Simulates observations of a light at distances of 0.8 to 3 m, with noise of 0.2 pixels.
Tracks watch(const Rig& array) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 0.2);
  std::uniform_real_distribution<double> part(0, 1);
  Tracks tracks;
  for (uint32_t i = 0; i < array.size(); i++) tracks.cameras.push_back({i, kWidth, kHeight});
  tracks.num_positions = kPlaces;
  for (uint32_t place = 0; place < kPlaces; place++) {
    const double z = 0.8 + 2.2 * part(random), x = kPitch + (part(random) - 0.5) * 0.6 * z;
    const double y = kPitch + (part(random) - 0.5) * 0.45 * z;
    for (uint32_t i = 0; i < array.size(); i++) {
      const Vec3 at = array.camera(i).world_from_camera.position;
      const double u = kFocal * (x - at.x) / (z - at.z) + (kWidth - 1) / 2.0 + noise(random);
      const double v = kFocal * (y - at.y) / (z - at.z) + (kHeight - 1) / 2.0 + noise(random);
      if (u > 0 && u < kWidth - 1 && v > 0 && v < kHeight - 1) tracks.observations.push_back({i, place, 0, u, v, 1});
    }
  }
  return tracks;
}

double distance(const Vec3& a, const Vec3& b) { return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z); }

}  // namespace

int main(int argc, char** argv) try {
  CalibrationOptions options;
  options.progress = [](const std::string& step) { std::fprintf(stderr, "%s\n", step.c_str()); };
  const Rig truth = make_array(kPitch / 10);
  Tracks tracks;
  if (argc > 2) {
    tracks = load_tracks(argv[1]);
  } else {
    tracks = watch(truth);
    options.prior = make_array(0);
    options.distortion_terms = 0;
  }
  const Calibration found = calibrate_rig(tracks, options);
  for (const Finding& finding : found.findings) std::printf("%s: %s\n", finding.code.c_str(), finding.text.c_str());
  std::printf("%zu of %zu cameras, noise %.2f pixels, %zu outliers, scale from %s\n", found.rig.size(),
              tracks.cameras.size(), found.sigma, found.outliers, found.scale_from.c_str());
  if (argc > 2) return save_rig(found.rig, argv[2]), 0;

  // Error of the distances between neighbours; these do not depend on the coordinate frame of the result.
  double worst = 0;
  for (size_t i = 1; i < found.rig.size(); i++) {
    const auto apart = [i](const Rig& rig) {
      return distance(rig.camera(i).world_from_camera.position, rig.camera(i - 1).world_from_camera.position);
    };
    worst = std::max(worst, std::abs(apart(found.rig) - apart(truth)));
  }
  std::printf("largest error of distances between neighbours: %.1f mm\n", 1000 * worst);
  return found.rig.size() == truth.size() && worst < 0.01 ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
