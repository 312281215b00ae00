// SPDX-License-Identifier: LGPL-2.1-or-later
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <nlohmann/json.hpp>

#include "calibration/adjustment.h"
#include "calibration/diagnosis.h"
#include "calibration/feature_tracks.h"
#include "calibration/report.h"
#include "calibration/solve.h"
#include "calibration/tracks.h"
#include "composite/still.h"
#include "image/image.h"
#include "quality/image_quality.h"
#include "render/sum_renderer.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "support/test.h"
#include "view/view_path.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

const fs::path kData = fs::path(LF_SOURCE_ROOT) / "../shared/data";

// Real tracks: 4 cameras, 1,125 positions of one light. The toolbox of this data set published a mean of 0.62 px over
// the 523 positions that it kept, without distortion.
const fs::path kPointlight = kData / "pointlight/DATA20100906_134124";

nlohmann::ordered_json solve(std::optional<DistortionModel> model) {
  const Tracks tracks = load_multicamselfcal(kPointlight, 0).tracks;
  EXPECT_EQ(tracks.cameras.size(), 4u);
  EXPECT_EQ(tracks.observations.size(), 3914u);
  SolveOptions options;
  options.distortion = model;
  const Solution solution = solve_tracks(tracks, options);
  auto report = calibration_report(solution, tracks, place_solution(solution, tracks, options, {}), {});
  std::printf("%s: mean %.3f px, median %.3f, rms %.3f over all; %d outliers, %d unplaced\n",
              report["model"].get<std::string>().c_str(), report["mean_px"].get<double>(),
              report["median_px"].get<double>(), report["rms_px"].get<double>(), report["outliers"].get<int>(),
              report["unplaced"].get<int>());
  EXPECT_EQ(report["unplaced"], 0);
  return report;
}

class Pointlight : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kPointlight)) GTEST_SKIP() << kPointlight << " is not there";
  }
};

TEST_F(Pointlight, WithoutDistortion) { EXPECT_LE(solve(DistortionModel{0, false})["mean_px"], 0.61); }

TEST_F(Pointlight, WithTwoTerms) { EXPECT_LE(solve(DistortionModel{2, false})["mean_px"], 0.48); }

// On held-out observations, k1 and k2 predict 0.380 px, with p1 and p2 0.338.
TEST_F(Pointlight, SelectsFourTerms) {
  const auto report = solve(std::nullopt);
  EXPECT_EQ(report["model"], "k1, k2, p1, p2, per camera");
  EXPECT_LE(report["mean_px"], 0.46);
  EXPECT_LE(report["median_px"], 0.19);
  // In the printed table, the chosen model is better than all models above.
  const auto& models = report["models"];
  for (size_t i = 0; i + 1 < models.size(); i++)
    EXPECT_LT(models.back()["bic"].get<double>(), models[i]["bic"].get<double>()) << models[i]["model"];
}

// Arrays of still photographs, calibrated from image features and judged by rendering.

std::vector<Image> images_of(const Rig& rig) {
  StillImageCache stills(rig);
  std::vector<Image> images;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) images.push_back(stills.get(i));
  return images;
}

// Calibrates `nominal` from its images, without knowledge of lenses or layout. Uses fewer references than the default,
// to save time.
Rig calibrated(const Rig& nominal, int references) {
  FeatureOptions features;
  features.references = references;
  const Tracks tracks = track_features(nominal, images_of(nominal), features);
  SolveOptions options;
  options.prior = nominal;
  const Solution solution = solve_tracks(tracks, options);
  const Placement placement = place_solution(solution, tracks, options, {});
  std::printf("%zu tracks, %zu observations; distortion %s, sigma %.3f px\n", tracks.num_positions,
              tracks.observations.size(), solution.distortion.name().c_str(), solution.sigma);
  for (const Finding& finding : diagnose(solution, tracks, options, placement))
    std::printf("%s: %s\n", finding.code.c_str(), finding.text.c_str());
  const Rig rig = make_rig(solution, tracks, options, placement);
  EXPECT_EQ(rig.cameras.size(), nominal.cameras.size());
  return rig;
}

Still render(const Rig& rig, const Mesh& mesh, const View& view, StillImageCache& stills) {
  const auto images = [&](CameraIndex i) -> const Image& { return stills.get(i); };
  return render_still(rig, mesh, view, images);
}

// The similarity between two calibrations of the same cameras. The rotation comes from the pixels' lines of sight
// instead of orientations or centres alone. Images of a planar array determine two things poorly: the principal points
// against rotation, and the cameras' offsets from the plane together with its tilt. Errors of both kinds would rotate a
// transferred view without changing the cameras' images.
Similarity between(const Rig& a, const Rig& b) {
  constexpr int kGrid = 5;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  const auto sight = [](const Camera& camera, int x, int y) {
    const Vec2 pixel((x + 0.5) / kGrid * camera.width - 0.5, (y + 0.5) / kGrid * camera.height - 0.5);
    const Vec3 v = camera.pose.rotation() * glm::normalize(Vec3(camera.lens.unproject(pixel).value(), 1));
    return Eigen::Vector3d(v.x, v.y, v.z);
  };
  Vec3 middle_a(0, 0, 0), middle_b(0, 0, 0);
  const size_t n = a.cameras.size();
  for (size_t i = 0; i < n; i++) {
    for (int k = 0; k < kGrid * kGrid; k++)
      sum += sight(b.cameras[i], k % kGrid, k / kGrid) * sight(a.cameras[i], k % kGrid, k / kGrid).transpose();
    middle_a += a.cameras[i].pose.position / static_cast<double>(n);
    middle_b += b.cameras[i].pose.position / static_cast<double>(n);
  }
  // Nearest rotation (Kabsch); directions within one hemisphere exclude a reflection.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Quaterniond q(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose()));
  Similarity similarity;
  similarity.rotation = glm::normalize(Quat(q.w(), q.x(), q.y(), q.z()));
  double along = 0, square = 0;
  for (size_t i = 0; i < n; i++) {
    const Vec3 x = similarity.rotation * (a.cameras[i].pose.position - middle_a);
    along += glm::dot(x, b.cameras[i].pose.position - middle_b);
    square += glm::dot(x, x);
  }
  similarity.scale = along / square;
  similarity.translation = middle_b - similarity.scale * (similarity.rotation * middle_a);
  return similarity;
}

Pose mean_pose(const Rig& rig) {
  Pose mean{Vec3(0, 0, 0), Quat(0, 0, 0, 0)};
  for (const Camera& camera : rig.cameras) {
    const Quat& q = camera.pose.orientation;
    mean.orientation += glm::dot(q, mean.orientation) < 0 ? -q : q;
    mean.position += camera.pose.position / static_cast<double>(rig.cameras.size());
  }
  mean.orientation = glm::normalize(mean.orientation);
  return mean;
}

View carried(View view, const Similarity& through) {
  view.pose = through(view.pose);
  Plane& plane = view.focus.plane;
  plane.normal = through.rotation * plane.normal;
  plane.d = through.scale * plane.d - glm::dot(plane.normal, through.translation);
  return view;
}

// Starts from 8x8 cameras and the approximate field of view alone.
TEST(StillArrays, ChessIsRenderedAsWellAsWithTheTrueRig) {
  if (!fs::exists(kData / "chess")) GTEST_SKIP() << "needs ../shared/data/chess";
  Rig truth = load_rig(kData / "chess/rig.json");
  const std::vector<NamedView> views = load_views(kData / "chess/views.json");
  Rig nominal = make_grid_rig({8, 8, 1, 34.5158770189817, 320, 240});
  nominal.directory = truth.directory;
  for (size_t i = 0; i < nominal.cameras.size(); i++) nominal.cameras[i].image = truth.cameras[i].image;
  const Rig solved = calibrated(nominal, 9);

  double mean[3] = {};
  const Rig* const rigs[] = {&truth, &solved, &nominal};
  std::printf("%-8s %9s %9s %9s\n", "PSNR, dB", "true", "solved", "nominal");
  std::vector<Mesh> meshes;
  for (const Rig* rig : rigs) meshes.push_back(build_mesh(*rig));
  for (const NamedView& view : views) {
    const Image picture = load_image(kData / "chess/truth" / (view.name + ".png"));
    std::printf("%-8s", view.name.c_str());
    for (int i = 0; i < 3; i++) {
      StillImageCache stills(*rigs[i]);
      const Still still = render(*rigs[i], meshes[i], carried(view.view, between(truth, *rigs[i])), stills);
      const double db = compare(still.picture, picture, still.coverage).psnr_db;
      mean[i] += db / static_cast<double>(views.size());
      std::printf(" %9.2f", db);
    }
    std::printf("\n");
  }
  std::printf("%-8s %9.2f %9.2f %9.2f\n", "mean", mean[0], mean[1], mean[2]);
  EXPECT_GE(mean[1], mean[0] - 1);
  EXPECT_GT(mean[1], mean[2]);
}

// Errors of 40x40 pixel blocks of predicted pictures; each block uses its best plane.
struct Blocks {
  static constexpr int kSide = 40;
  std::map<std::array<CameraIndex, 3>, double> squared;  // camera, column, row

  void add(CameraIndex camera, const Still& still, const Image& photograph) {
    for (int row = 0; row < photograph.height() / kSide; row++)
      for (int column = 0; column < photograph.width() / kSide; column++) {
        double sum = 0;
        for (int i = 0; i < kSide * kSide; i++) {
          const int x = column * kSide + i % kSide, y = row * kSide + i / kSide;
          if (!(still.coverage[static_cast<size_t>(y) * photograph.width() + x] > kMinCoverage)) sum = INFINITY;
          for (int c = 0; c < 3; c++) sum += std::pow(still.picture.pixel(x, y)[c] - photograph.pixel(x, y)[c], 2);
        }
        if (!std::isfinite(sum)) continue;
        double& best =
            squared.try_emplace({camera, static_cast<CameraIndex>(column), static_cast<CameraIndex>(row)}, INFINITY)
                .first->second;
        best = std::min(best, sum / (3 * kSide * kSide));
      }
  }
};

// Real photographs without any calibration. The 64 cameras in rows and columns 0, 2, ... render the views of 16 cameras
// between them; the poses of those 16 are calibrated too, without using their pictures for rendering. The camera moved
// along the grid so precisely that neighbours predict a picture to 0.13 pixels with the nominal rig, and to 0.03 after
// removing each camera's own shift. At the single best plane another effect is larger: with nominal poses, some planes
// sample all pictures half-way between pixels, which blurs the ghosts of out-of-focus parts by 0.4 dB. The test
// therefore selects the plane per block and only prints the figure for a single plane.
TEST(StillArrays, ToysAreCalibratedWithoutPriorKnowledge) {
  if (!fs::exists(kData / "toys")) GTEST_SKIP() << "needs ../shared/data/toys";
  const Rig all = load_rig(kData / "toys/rig.json");
  std::vector<CameraIndex> even, odd;
  for (CameraIndex row = 0; row < 16; row++)
    for (CameraIndex column = 0; column < 16; column++) {
      if (row % 2 == 0 && column % 2 == 0) even.push_back(row * 16 + column);
      if (row % 4 == 1 && column % 4 == 1) odd.push_back(row * 16 + column);
    }
  ASSERT_EQ(odd.size(), 16u);
  std::vector<CameraIndex> both = even;
  both.insert(both.end(), odd.begin(), odd.end());
  const Rig nominal = rig_subset(all, both);
  const Rig solved = calibrated(nominal, 6);

  Blocks blocks[2];
  const Rig* const rigs[] = {&nominal, &solved};
  for (int i = 0; i < 2; i++) {
    Rig array = *rigs[i];
    array.cameras.resize(even.size());
    array.topology = {Topology::Type::kGrid, 8, 8, {}};
    const Mesh mesh = build_mesh(array);
    StillImageCache stills(array), held_out(*rigs[i]);
    const Pose middle = mean_pose(array);
    double focal_length = 0, best = 0;
    for (const Camera& camera : array.cameras) focal_length += camera.lens.fx() / static_cast<double>(even.size());
    for (double disparity = 3.5; disparity <= 9; disparity += 0.5) {  // pixels between neighbouring cameras
      const Vec3 normal = middle.rotation()[2];
      const Plane plane{normal, -focal_length * 0.01 / disparity - glm::dot(normal, middle.position)};
      double mean = 0;
      for (auto k = static_cast<CameraIndex>(even.size()); k < both.size(); k++) {
        const Camera& camera = rigs[i]->cameras[k];
        const Still still =
            render(array, mesh, {camera.width, camera.height, camera.lens, camera.pose, {plane}}, stills);
        mean += compare(still.picture, held_out.get(k), still.coverage).psnr_db / 16;
        blocks[i].add(k, still, held_out.get(k));
      }
      best = std::max(best, mean);
    }
    std::printf("%s: mean PSNR of 16 held-out cameras %.2f dB at the best plane\n", i == 0 ? "before" : "after", best);
  }
  double squared[2] = {}, count = 0, better = 0;
  for (const auto& [place, before] : blocks[0].squared) {
    const auto after = blocks[1].squared.find(place);
    if (after == blocks[1].squared.end()) continue;
    squared[0] += before, squared[1] += after->second, count++;
    better += after->second < before;
  }
  ASSERT_GT(count, 200);
  double db[2];
  for (int i = 0; i < 2; i++) db[i] = 10 * std::log10(255 * 255 / (squared[i] / count));
  std::printf("at the best plane for each of %.0f blocks: before %.2f dB, after %.2f dB; better in %.0f %%\n", count,
              db[0], db[1], 100 * better / count);
  EXPECT_GT(db[1], db[0]);
  EXPECT_GT(better / count, 0.55);
}

}  // namespace
}  // namespace lf
