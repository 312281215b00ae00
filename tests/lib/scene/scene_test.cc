// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.h"

#include "base/text.h"
#include "quality/image_quality.h"
#include "scene/objects.h"
#include "scene/trace.h"
#include "support/test.h"

namespace lf {
namespace {

SceneCamera camera_of(const Camera& c) { return {c.width, c.height, c.lens, c.pose}; }

SceneCamera central_camera(int width = 160, int height = 120) {
  SceneCamera c = camera_of(scene_rig(1, 1, width, height).cameras[0]);
  return c;
}

TEST(Scene, IsReproducible) {
  const SceneCamera camera = central_camera();
  const Image here = render_scene(camera, 1.234);
  Image there;
  std::thread([&] { there = render_scene(camera, 1.234); }).join();
  EXPECT_EQ(here.data(), there.data());
  EXPECT_NE(here.data(), render_scene(camera, 1.3).data());
}

// Regular steps, jumps, and repeated times; a lens with black corners; one ray per pixel, and nine.
TEST(Scene, FilmEqualsSinglePictures) {
  SceneCamera distorted = central_camera(97, 64);
  distorted.lens = Lens(LensModel::kRadial, {70, 48, 32, -0.4, 0.02});
  distorted.pose.position = {0.2, -0.1, 0.3};
  for (const SceneCamera& camera : {central_camera(), distorted})
    for (const int samples : {1, 2, 3, 5}) {
      std::vector<double> times = {0.3};
      for (const double step : {1 / 15.0, 1 / 15.0, 1 / 15.0, 0.0, 1 / 30.0, 0.5, 1e-4, -0.9, 1 / 15.0})
        times.push_back(times.back() + step);
      for (int n = 0; n < 8; n++) times.push_back(times.back() + 1 / 60.0);
      SceneRenderer film(camera, times, samples);
      for (const double time : times)
        ASSERT_EQ(film.next().data(), render_scene(camera, time, samples).data()) << samples << ", " << time;
    }
}

TEST(Scene, LoopsWithItsPeriod) {
  const SceneCamera camera = central_camera();
  EXPECT_GT(compare(render_scene(camera, 0.5), render_scene(camera, 0.5 + kScenePeriod)).psnr_db, 45);
}

TEST(Scene, AdaptiveSamplingIsCloseToFullSampling) {
  for (const double time : {0.0, 1.1, 2.7}) {
    const SceneCamera camera = central_camera(320, 240);
    const Image full = render_scene(camera, time, 3, true), adaptive = render_scene(camera, time, 3);
    const Quality q = compare(adaptive, full);
    EXPECT_GT(q.psnr_db, 38) << time;
    EXPECT_GT(q.psnr_db, compare(render_scene(camera, time, 1), full).psnr_db + 4) << time;
  }
}

TEST(Scene, KnownObjectAppearsWhereItProjects) {
  // No other object has the balloon's colour: the centroid of its pixels is the projection of its centre.
  const Rig rig = scene_rig();
  for (const double time : {0.0, 0.8, 2.6}) {
    const scene::Objects objects = scene::objects_at(time);
    const auto balloon = std::find_if(objects.spheres.begin(), objects.spheres.end(),
                                      [](const scene::Sphere& s) { return s.texture == scene::Texture::kBalloon; });
    ASSERT_NE(balloon, objects.spheres.end());
    for (const CameraIndex index : {0u, 7u, 27u, 63u}) {
      const Camera& c = rig.cameras[index];
      const Vec2 expected = *c.lens.project(c.pose.camera_from_world(Vec3(balloon->centre)));
      const Image image = render_scene(camera_of(c), time);
      int left = c.width, right = -1;
      const int row = static_cast<int>(std::lround(expected.y)) - 8;  // above the swinging balls and the head
      for (int x = 0; x < c.width; x++) {
        const uint8_t* p = image.pixel(x, row);
        if (std::abs(x - expected.x) < 20 && p[0] > 2 * p[1] && p[0] > 2 * p[2]) {
          left = std::min(left, x);
          right = std::max(right, x);
        }
      }
      ASSERT_GT(right, left) << "camera " << index << " at " << time;
      EXPECT_NEAR((left + right) / 2.0, expected.x, 2.5) << "camera " << index << " at " << time;
    }
  }
}

TEST(Scene, ParallaxFollowsDepth) {
  // The chart is static at kSceneFar: its disparity between neighbouring cameras is f * pitch / z.
  const Rig rig = scene_rig(1, 2, 640, 480);
  const Image left = render_scene(camera_of(rig.cameras[0]), 0.9), right = render_scene(camera_of(rig.cameras[1]), 0.9);
  const double shift = 800 * kScenePitch / kSceneFar;  // 7.1 px
  const Camera& c = rig.cameras[0];
  const Vec2 corner = *c.lens.project(c.pose.camera_from_world({0.20, -0.36, kSceneFar - 0.012}));
  const auto mismatch = [&](int dx) {
    double sum = 0;
    for (int y = 0; y < 50; y++)
      for (int x = 0; x < 110; x++)
        for (int k = 0; k < 3; k++)
          sum += std::abs(left.pixel(static_cast<int>(corner.x) + x, static_cast<int>(corner.y) + y)[k] -
                          right.pixel(static_cast<int>(corner.x) + x - dx, static_cast<int>(corner.y) + y)[k]);
    return sum;
  };
  int best = 0;
  for (int dx = 0; dx < 20; dx++)
    if (mismatch(dx) < mismatch(best)) best = dx;
  EXPECT_EQ(best, std::lround(shift));
}

TEST(Scene, HasObjectsAtItsDepths) {
  const SceneCamera camera = central_camera();
  const scene::Objects objects = scene::objects_at(0.9);
  int at_depth[3] = {}, beyond = 0;
  const double depths[3] = {kSceneNear, kSceneMiddle, kSceneFar};
  for (int y = 0; y < camera.height; y++)
    for (int x = 0; x < camera.width; x++) {
      const Vec2 u = *camera.lens.unproject({static_cast<double>(x), static_cast<double>(y)});
      const Vec3 d = glm::normalize(Vec3(u.x, u.y, 1));
      const scene::Hit hit = scene::intersect_scene(objects, {scene::V3(0), scene::V3(d)});
      const double z = hit.t * d.z;
      beyond += z > scene::kRoomMax.z + 1e-3;
      for (int i = 0; i < 3; i++) at_depth[i] += hit.kind != scene::Kind::kRoom && std::abs(z - depths[i]) < 0.2;
    }
  for (int i = 0; i < 3; i++) EXPECT_GT(at_depth[i], 0.05 * camera.width * camera.height) << depths[i];
  EXPECT_EQ(beyond, 0);
}

TEST(Scene, ColourMatchesTheRayThroughThePixel) {
  SceneCamera camera = central_camera(320, 240);
  camera.lens = Lens(LensModel::kRadial, {400, 150, 125, -0.25, 0.08});
  camera.pose = look_at({0.1, -0.05, -0.2}, {0, 0, 2}, {0, 1, 0});
  const Image image = render_scene(camera, 0.6, 1);
  double difference = 0;
  int compared = 0;
  for (int y = 3; y < 240; y += 13)
    for (int x = 2; x < 320; x += 11, compared++) {
      const Vec2 u = *camera.lens.unproject({static_cast<double>(x), static_cast<double>(y)});
      const Rgb c = scene_colour(camera.pose.position, camera.pose.rotation() * Vec3(u.x, u.y, 1), 0.6);
      const uint8_t* p = image.pixel(x, y);
      difference += (std::abs(c.r - p[0]) + std::abs(c.g - p[1]) + std::abs(c.b - p[2])) / 3;
    }
  // The error is not 0 because scene_colour() has no pixel footprint for texture filtering.
  EXPECT_LT(difference / compared, 4);
}

TEST(Scene, DistortionFollowsTheLens) {
  SceneCamera straight = central_camera(320, 240), bent = straight;
  bent.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.3, 0.05});
  const Image a = render_scene(straight, 0, 3), b = render_scene(bent, 0, 3);
  double moved = 0, fixed = 0;
  int n = 0;
  for (int y = 6; y < 234; y++)
    for (int x = 8; x < 312; x++, n++) {
      const Vec2 u = *bent.lens.unproject({static_cast<double>(x), static_cast<double>(y)});
      const Vec2 q = *straight.lens.project({u.x, u.y, 1});
      const int qx = std::clamp(static_cast<int>(std::lround(q.x)), 0, 319);
      const int qy = std::clamp(static_cast<int>(std::lround(q.y)), 0, 239);
      moved += std::abs(b.pixel(x, y)[1] - a.pixel(qx, qy)[1]);
      fixed += std::abs(b.pixel(x, y)[1] - a.pixel(x, y)[1]);
    }
  EXPECT_LT(moved, 0.6 * fixed);
}

TEST(Scene, RaysBeyondTheLensAreBlack) {
  SceneCamera camera = central_camera(64, 48);
  camera.lens = Lens(LensModel::kSimpleRadial, {20, 31.5, 23.5, -0.5});  // folds at r = 0.816, image 0.544: 10.9 px
  const Image image = render_scene(camera, 0);
  for (int c = 0; c < 3; c++) {
    EXPECT_EQ(image.pixel(0, 0)[c], 0);
    EXPECT_EQ(image.pixel(31 + 14, 23)[c], 0);
    EXPECT_GT(image.pixel(31 + 8, 23)[c], 0);
  }
}

TEST(Scene, FisheyePicturesAreACircle) {
  SceneCamera camera = central_camera(64, 48);
  camera.lens = Lens(LensModel::kOpenCvFisheye, {14, 14, 31.5, 23.5, 0, 0, 0, 0});  // 90 degrees at 22 px
  const Image image = render_scene(camera, 0);
  for (int c = 0; c < 3; c++) {
    EXPECT_EQ(image.pixel(0, 0)[c], 0);
    EXPECT_EQ(image.pixel(31 + 25, 23)[c], 0);
    EXPECT_GT(image.pixel(31 + 20, 23)[c], 0);
    EXPECT_GT(image.pixel(31, 23 + 20)[c], 0);
  }
}

TEST(Scene, OddAndTinyPictures) {
  EXPECT_EQ(render_scene(central_camera(1, 1), 0).data().size(), 3u);
  EXPECT_EQ(render_scene(central_camera(7, 3), 0, 4).data().size(), 63u);
  EXPECT_THROW(render_scene(central_camera(), 0, 0), Error);
}

TEST(SceneRig, IsAGridAroundTheOrigin) {
  const Rig rig = scene_rig(3, 5, 640, 480);
  ASSERT_EQ(rig.cameras.size(), 15u);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(rig.topology.rows, 3);
  EXPECT_EQ(rig.topology.columns, 5);
  EXPECT_EQ(rig.cameras[0].name, "cam_00_00");
  EXPECT_EQ(rig.cameras[14].name, "cam_02_04");
  Vec3 sum(0);
  std::set<uint32_t> ids;
  for (const Camera& c : rig.cameras) {
    sum += c.pose.position;
    ids.insert(c.id);
    EXPECT_EQ(c.pose.position.z, 0);
    EXPECT_EQ(c.pose.forward(), Vec3(0, 0, 1));
    EXPECT_EQ(c.lens, Lens(LensModel::kRadial, {800, 319.5, 239.5, 0, 0}));
  }
  EXPECT_EQ(ids.size(), 15u);
  EXPECT_LT(glm::length(sum), 1e-12);
  EXPECT_NEAR(rig.cameras[1].pose.position.x - rig.cameras[0].pose.position.x, kScenePitch, 1e-12);
  EXPECT_NEAR(rig.cameras[5].pose.position.y - rig.cameras[0].pose.position.y, kScenePitch, 1e-12);
}

TEST(SceneRig, RefusesInvalidSizes) {
  EXPECT_THROW(scene_rig(0, 8), Error);
  EXPECT_THROW(scene_rig(1000, 1000), Error);
  EXPECT_THROW(scene_rig(2, 2, 0, 240), Error);
  EXPECT_THROW(scene_rig(2, 2, 320, kMaxImageSize + 1), Error);
}

}  // namespace
}  // namespace lf
