// SPDX-License-Identifier: LGPL-2.1-or-later
// Invariants of the rendering rule that can break unnoticed.
#include "composite/accumulator.h"
#include "image/image.h"
#include "lib/render/production.h"
#include "quality/image_quality.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "render/ownership.h"
#include "rig/rig_json.h"
#include "support/fragments.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;

Rig square_array(Random& random) {
  Rig rig = reference::planar_grid(8, 8, 0.1);
  for (Camera& camera : rig.cameras) {
    camera.pose.position += random.point_in_box(0.005);
    camera.pose.orientation = random.small_rotation(0.03);
  }
  return rig;
}

View view_from(const Vec3& eye, double fov_y, double focus, int width = 160, int height = 120) {
  View view = test::view_from(eye, width, height, fov_y, focus - eye.z);
  view.blending.extrapolates = false;
  return view;
}

std::vector<View> views() {
  std::vector<View> out{view_from({0.03, 0.02, -0.4}, 50, 3), view_from({0.31, -0.2, -0.15}, 60, 2),
                        view_from({0, 0.1, 0.2}, 55, 4), view_from({0.013, 0.027, 0}, 40, 1.5),
                        view_from({0.4, 0.3, -0.3}, 60, 3)};
  out.push_back(out[0]);
  out.back().pose.orientation = glm::normalize(Quat(1, 0.1, -0.15, 0.05));
  out.push_back(out[0]);
  out.back().lens = Lens(LensModel::kRadial, {140, 79, 60, -0.2, 0.03});
  return out;
}

Rig wide_array(Random& random) {
  Rig rig = square_array(random);
  for (Camera& camera : rig.cameras) camera.lens = Lens::pinhole(12, 31.5, 23.5);
  return rig;
}

TEST(PartitionOfUnity, WeightsAddUpToOneInsideTheMesh) {
  Random random(1);
  const Rig rig = wide_array(random);
  const Mesh mesh = build_mesh(rig);
  double largest = 0;
  for (const View& view : views()) {
    const test::Production production(rig, mesh, view);
    std::vector<double> sum(static_cast<size_t>(view.width) * view.height);
    for (const auto& own : production.own_weights())
      for (size_t i = 0; i < sum.size(); i++) sum[i] += own.weight[i];
    const reference::Picture expected = reference::render(rig, mesh, view, {});
    size_t inside = 0;
    for (size_t i = 0; i < sum.size(); i++) {
      const bool owned = sum[i] != 0;
      inside += owned;
      if (owned) largest = std::max(largest, std::abs(sum[i] - 1));
      if (expected.pixels[i].owner_margin > 1e-9) {
        EXPECT_EQ(owned, expected.pixels[i].owner != reference::Pixel::kNone);
      }
    }
    EXPECT_GT(inside, sum.size() / 4);
  }
  std::printf("largest |sum of weights - 1|: %.2g (bound 1e-6)\n", largest);
  EXPECT_LE(largest, 1e-6);
}

TEST(PartitionOfUnity, WhiteStaysWhiteInFloat) {
  Random random(2);
  const Rig rig = square_array(random);
  const Mesh mesh = build_mesh(rig);
  const std::vector<Image> white(rig.cameras.size(), reference::white_image(64, 48));
  size_t with_loss = 0;
  for (const View& view : views()) {
    const auto sums = test::Production(rig, mesh, view).sums(white);
    for (size_t i = 0; i < sums.valid.size(); i++) {
      if (sums.valid[i] < 0.01) continue;
      with_loss += sums.lost[i] > 0;
      ASSERT_NEAR(sums.colour[3 * i] / 255, 1, sums.lost[i] > 0 ? 1e-6 / sums.valid[i] : 1e-6);
    }
  }
  EXPECT_GT(with_loss, 1000u);
}

TEST(PartitionOfUnity, WhiteIs254Or255InEightBits) {
  Random random(3);
  const Rig rig = wide_array(random);
  const Mesh mesh = build_mesh(rig);
  const std::vector<Image> white(rig.cameras.size(), reference::white_image(64, 48));
  const std::vector<Image> white_i420 = test::i420_of(white);
  for (const View& view : views()) {
    const test::Production production(rig, mesh, view);
    const Image rgb = production.picture(white), i420 = production.picture(white_i420);
    size_t owned = 0;
    for (int y = 0; y < view.height; y++)
      for (int x = 0; x < view.width; x++) {
        const bool inside = production.owners.at(x, y) != FaceIdMap::kNone;
        owned += inside;
        const size_t i = static_cast<size_t>(y) * view.width + x;
        for (const uint8_t value : {rgb.pixel(x, y)[0], rgb.pixel(x, y)[1], rgb.pixel(x, y)[2], i420.plane(0)[i]}) {
          if (inside) {
            ASSERT_GE(value, 254) << x << ", " << y;
          } else {
            ASSERT_EQ(value, 0) << x << ", " << y;
          }
        }
      }
    EXPECT_GT(owned, 1000u);
  }
}

// Returns planes that every line of sight of the view meets in front.
std::vector<Plane> planes_in_front(Random& random, const View& view, int n) {
  std::vector<Plane> planes;
  const Rays rays(view.lens, view.width, view.height);
  while (static_cast<int>(planes.size()) < n) {
    const Vec3 axis = view.pose.forward();
    const double distance = std::exp(random.uniform(std::log(0.05), std::log(1000)));
    const Vec3 normal = planes.empty() ? axis : glm::normalize(axis + random.point_in_box(0.8));
    bool in_front = true;
    for (const int x : {0, view.width - 1})
      for (const int y : {0, view.height - 1}) {
        const Vec3 d = view.pose.rotation() * Vec3(rays.at(x, y), 1);
        in_front = in_front && glm::dot(normal, d) > 0.05;
      }
    if (in_front) planes.push_back(plane_through(view.pose.position + distance * axis, -normal));
  }
  return planes;
}

TEST(ViewAtACamera, IsItsImage) {
  Random random(4);
  Rig rig = square_array(random);
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    Lens& lens = rig.cameras[i].lens;
    if (i % 3 == 1) lens = Lens(LensModel::kRadial, {50, 31, 24, random.uniform(-0.2, 0.1), 0.02});
    if (i % 3 == 2) lens = Lens(LensModel::kOpenCv, {50, 52, 31, 24, random.uniform(-0.2, 0.1), 0.02, 0.005, -0.004});
  }
  const Mesh mesh = build_mesh(rig);
  const std::vector<Image> images = images_of(rig, random, reference::noise_image);
  int pictures = 0;
  for (CameraIndex i = 0; i < rig.cameras.size(); i += random.integer(1, 4)) {
    const Camera& camera = rig.cameras[i];
    View view{camera.width, camera.height, camera.lens, camera.pose, {}};
    for (const Plane& plane : planes_in_front(random, view, 6)) {
      view.focus.plane = plane;
      const Image picture = test::Production(rig, mesh, view).picture(images);
      EXPECT_EQ(picture.data(), images[i].data())
          << "camera " << i << ", " << compare(picture, images[i]).psnr_db << " dB";
      pictures++;
    }
  }
  EXPECT_GT(pictures, 100);
}

// Regular rigs are hard: collinear cameras, zero-area triangles on the border of their Delaunay triangulation, and (if
// rotated) inexact coordinates.
TEST(ViewAtACamera, IsItsImageOnRegularRigs) {
  Random random(10);
  int pictures = 0;
  for (int trial = 0; trial < 40; trial++) {
    Rig rig = reference::planar_grid(random.integer(2, 4), random.integer(2, 5), random.uniform(0.05, 0.5));
    if (trial % 2 == 0) rig.topology = {};
    const Quat turn = trial % 4 < 2 ? Quat(1, 0, 0, 0) : random.orientation();
    const Vec3 by = trial % 8 < 4 ? Vec3(0) : random.point_in_box(trial % 16 < 8 ? 1 : 1e6);
    for (Camera& camera : rig.cameras)
      camera.pose = {glm::mat3_cast(turn) * camera.pose.position + by, glm::normalize(turn * camera.pose.orientation)};
    const CameraSet out = reference::random_out_of_service(random, rig);
    const Mesh mesh = build_mesh(rig, out);
    const std::vector<Image> images = images_of(rig, random, reference::noise_image);
    for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
      if (std::binary_search(out.begin(), out.end(), i)) continue;
      const Camera& camera = rig.cameras[i];
      View view{camera.width, camera.height, camera.lens, camera.pose, {}};
      view.focus.plane = focal_plane_at(view.pose, random.uniform(0.1, 5));
      const Image picture = test::Production(rig, mesh, view).picture(images);
      EXPECT_EQ(picture.data(), images[i].data()) << "trial " << trial << " camera " << i;
      pictures++;

      // The camera at the viewpoint has all the weight for any viewing direction, as long as the cameras face that way.
      view.pose.orientation = glm::normalize(view.pose.orientation * random.small_rotation(0.7));
      view.focus.plane = focal_plane_at(view.pose, 2);
      double least = 0;
      for (const auto& own : test::Production(rig, mesh, view).own_weights())
        if (own.camera == i) least = *std::min_element(own.weight.begin(), own.weight.end());
      EXPECT_GE(least, 1 - 1e-6) << "trial " << trial << " camera " << i << " from its place, turned";
    }
  }
  EXPECT_GT(pictures, 200);
}

TEST(ViewAtACamera, IsItsPhotograph) {
  const std::string folder = test::data_folder("toys");
  if (folder.empty()) GTEST_SKIP() << "../shared/data/toys is absent";
  const Rig rig = load_rig(folder + "/rig.json");
  const Mesh mesh = build_mesh(rig);
  Random random(5);
  std::vector<Image> images = images_of(
      rig, random, +[](Random&, int w, int h) { return Image(PixelFamily::kRgb, w, h); });
  for (const CameraIndex i : {0u, 15u, 100u, 137u, 240u, 255u}) {
    const Camera& camera = rig.cameras[i];
    const Image photograph = load_image(rig.resolve(camera.image));
    images[i] = photograph;
    View view{camera.width, camera.height, camera.lens, camera.pose, {}};
    for (const Plane& plane : planes_in_front(random, view, 8)) {
      view.focus.plane = plane;
      EXPECT_GE(compare(test::Production(rig, mesh, view).picture(images), photograph).psnr_db, 50) << "camera " << i;
    }
    images[i] = Image(PixelFamily::kRgb, camera.width, camera.height);
  }
}

// A texture in the plane n . x = c: waves along two directions.
struct Texture {
  static constexpr double kAmplitude = 55;
  Vec3 waves[2];  // rad/m
  double at(const Vec3& x, int channel) const {
    return 127.5 + kAmplitude * std::sin(glm::dot(waves[0], x) + channel) +
           kAmplitude * std::cos(glm::dot(waves[1], x) - 2 * channel);
  }
};

std::optional<Vec3> meet(const Plane& plane, const Pose& pose, const Vec2& ray) {
  const Vec3 d = pose.rotation() * Vec3(ray, 1);
  const double t = -plane.signed_distance(pose.position) / glm::dot(plane.normal, d);
  if (!(t > 0)) return std::nullopt;
  return pose.position + t * d;
}

// Bilinear interpolation of a wave of w rad/pixel has an error of at most A |w|^2 / 8 (an eighth of the sum of both
// second derivatives). Rounding adds 0.5 for the images and 1.5 for up to three weighted samples. Samples in the outer
// half of border pixels are clamped instead of interpolated: pixels that use such samples are skipped.
TEST(FocalPlane, IsRenderedSharp) {
  Random random(6);
  Rig rig = square_array(random);
  for (Camera& camera : rig.cameras) {
    camera.width = 160;
    camera.height = 120;
    camera.lens = Lens(LensModel::kRadial, {110, 79.5, 59.5, -0.05, 0.01});
  }
  const Mesh mesh = build_mesh(rig);
  for (const Vec3& normal : {Vec3(0, 0, -1), glm::normalize(Vec3(0.3, 0.2, -1)), glm::normalize(Vec3(-0.5, 0.1, -1))}) {
    const Plane plane = plane_through({0, 0, 2}, normal);
    const Texture texture{{{9, 3.5, 1}, {-2.5, 10.5, -1.5}}};
    std::vector<Image> images;
    double wave = 0;  // largest phase step of a texture from pixel to pixel, rad
    for (const Camera& camera : rig.cameras) {
      Image image(PixelFamily::kRgb, camera.width, camera.height);
      const Rays rays(camera.lens, camera.width, camera.height);
      for (int y = 0; y < camera.height; y++)
        for (int x = 0; x < camera.width; x++) {
          const auto hit = meet(plane, camera.pose, rays.at(x, y));
          ASSERT_TRUE(hit);
          for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(texture.at(*hit, c)));
          if (x == 0 || y == 0) continue;
          const Vec3 across = *hit - *meet(plane, camera.pose, rays.at(x - 1, y));
          const Vec3 down = *hit - *meet(plane, camera.pose, rays.at(x, y - 1));
          for (const Vec3& w : texture.waves) wave = std::max(wave, std::hypot(glm::dot(w, across), glm::dot(w, down)));
        }
      images.push_back(std::move(image));
    }
    const double bound = 2 * Texture::kAmplitude * wave * wave / 8 + 0.5 + 1.5;
    double largest = 0;
    size_t compared = 0;
    for (View view : views()) {
      view.focus.plane = plane;
      const test::Production production(rig, mesh, view);
      const Image picture = production.picture(images);
      const auto sums = production.sums(images);
      for (int y = 0; y < view.height; y++)
        for (int x = 0; x < view.width; x++) {
          if (sums.valid[static_cast<size_t>(y) * view.width + x] < 0.999) continue;
          const Vec3 hit = *meet(plane, view.pose, production.plan.rays().at(x, y));
          bool interpolated = true;
          for (const CameraIndex i : production.plan.faces()[production.owners.at(x, y)].camera) {
            const Camera& camera = rig.cameras[i];
            const auto at = camera.lens.project(camera.pose.camera_from_world(hit));
            interpolated = interpolated && at && at->x >= 0 && at->y >= 0 && at->x <= camera.width - 1 &&
                           at->y <= camera.height - 1;
          }
          if (!interpolated) continue;
          compared++;
          for (int c = 0; c < 3; c++)
            largest = std::max(largest, std::abs(picture.pixel(x, y)[c] - texture.at(hit, c)));
        }
    }
    std::printf("normal (%5.2f %5.2f %5.2f): %zu pixels, largest error %.2f of 255 (bound %.2f)\n", normal.x, normal.y,
                normal.z, compared, largest, bound);
    EXPECT_GT(compared, 20000u);
    EXPECT_LE(largest, bound);
  }
}

// Renders as one process does: a separate plan with only the ownership that its cameras need.
std::vector<Fragment> render_part(const Rig& rig, const View& view, const std::vector<CameraIndex>& cameras,
                                  const std::vector<Image>& images) {
  const RenderJob job(rig, build_mesh(rig), view, cameras);
  std::vector<Fragment> fragments;
  for (const CameraIndex i : job.cameras())
    if (auto fragment = test::camera_part(job.plan(), job.runs(), {i, &rig.cameras[i], images[i].view()}))
      fragments.push_back(std::move(*fragment));
  return fragments;
}

class Split : public testing::TestWithParam<PixelFamily> {};
INSTANTIATE_TEST_SUITE_P(Families, Split, testing::Values(PixelFamily::kRgb, PixelFamily::kI420),
                         [](const auto& i) { return i.param == PixelFamily::kRgb ? "RGB" : "I420"; });

TEST_P(Split, OverProcessesIsBitExact) {
  Random random(7);
  for (int trial = 0; trial < 6; trial++) {
    const Rig rig = trial == 0 ? square_array(random) : reference::random_rig(random);
    std::vector<Image> images = images_of(rig, random, reference::noise_image);
    if (GetParam() == PixelFamily::kI420) images = test::i420_of(images);
    const View view = trial == 0 ? views()[1] : reference::random_view(random, rig, 61, 47);
    const test::Production one(rig, build_mesh(rig), view);
    const Image expected = one.picture_of_parts(images);
    for (int processes = 2; processes <= 8; processes++) {
      std::vector<std::vector<CameraIndex>> cameras(processes);
      for (CameraIndex i = 0; i < rig.cameras.size(); i++) cameras[random.integer(0, processes - 1)].push_back(i);
      Accumulator accumulator = test::empty_sum(GetParam(), view.width, view.height);
      for (const auto& part : cameras)
        for (const Fragment& fragment : render_part(rig, view, part, images)) ASSERT_TRUE(accumulator.add(fragment));
      accumulator.set_uncovered(one.owners);
      EXPECT_EQ(accumulator.resolve().data(), expected.data())
          << "trial " << trial << ", " << processes << " processes";
    }
  }
}

TEST(Split, OverATreeOfPartialSumsIsBitExact) {
  Random random(8);
  const Rig rig = square_array(random);
  const std::vector<Image> images = images_of(rig, random, reference::noise_image);
  for (const View& view : views()) {
    const test::Production one(rig, build_mesh(rig), view);
    Accumulator root = test::empty_sum(PixelFamily::kRgb, view.width, view.height);
    for (CameraIndex first = 0; first < 64; first += 16) {
      std::vector<CameraIndex> part(16);
      for (CameraIndex i = 0; i < 16; i++) part[i] = first + i;
      Accumulator branch = test::empty_sum(PixelFamily::kRgb, view.width, view.height);
      for (const Fragment& fragment : render_part(rig, view, part, images)) ASSERT_TRUE(branch.add(fragment));
      const auto sum = test::rounded_sum(branch);
      ASSERT_TRUE(!sum || root.add(*sum));
    }
    root.set_uncovered(one.owners);
    EXPECT_EQ(root.resolve().data(), one.picture_of_parts(images).data());
  }
}

TEST(Bytes, DoNotGrowWithTheNumberOfCameras) {
  Random random(9);
  std::printf("%-28s", "fragment bytes per view:");
  for (const int side : {2, 4, 8, 16}) std::printf("%8d cameras", side * side);
  std::printf("\n");
  int number = 0;
  for (const View& view :
       {view_from({0.03, 0.02, -0.4}, 50, 3, 320, 240), view_from({0.01, -0.04, -0.8}, 40, 4, 320, 240),
        view_from({0, 0.1, 0.2}, 55, 4, 320, 240), view_from({0.05, 0.03, -0.1}, 60, 2, 320, 240)}) {
    std::printf("view %d (of %6d pixel bytes) ", number++, view.width * view.height * 3);
    size_t bytes_of_16 = 0;
    for (const int side : {2, 4, 8, 16}) {
      Rig rig = reference::planar_grid(side, side, 0.8 / (side - 1));
      const std::vector<Image> images(rig.cameras.size(), reference::noise_image(random, 64, 48));
      size_t bytes = 0;
      for (const Fragment& fragment : test::Production(rig, build_mesh(rig), view).fragments(images))
        bytes += fragment.bytes();
      std::printf("%16zu", bytes);
      if (side == 4) bytes_of_16 = bytes;
      if (side > 4) {
        EXPECT_LE(static_cast<double>(bytes), 1.2 * static_cast<double>(bytes_of_16)) << side * side << " cameras";
      }
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace lf
