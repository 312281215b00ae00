// SPDX-License-Identifier: LGPL-2.1-or-later
#include <numbers>

#include "rig/mesh.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

Rig grid(int rows, int columns) {
  Rig rig = test::camera_grid(rows, columns, 1, 320, 240, 400, 100);
  for (Camera& camera : rig.cameras) camera.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, 0, 0});
  return rig;
}

std::vector<uint32_t> ids(const Rig& rig) {
  std::vector<uint32_t> ids;
  for (const Camera& camera : rig.cameras) ids.push_back(camera.id);
  return ids;
}

TEST(RigHash, ChangesWithRelevantMembers) {
  const std::function<void(Rig&)> changes[] = {
      [](Rig&) {},
      [](Rig& r) { r.cameras[2].width++; },
      [](Rig& r) { r.cameras[2].height++; },
      [](Rig& r) {
        r.cameras[2].lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, 1e-12, 0});
      },
      [](Rig& r) {
        r.cameras[2].lens = Lens(LensModel::kSimpleRadial, {400, 159.5, 119.5, 0});
      },
      [](Rig& r) { r.cameras[2].pose.position.z = 1e-300; },
      [](Rig& r) { r.cameras[2].pose.orientation = Quat(0, 1, 0, 0); },
      [](Rig& r) { r.cameras[2].pose.orientation = Quat(0, 0, 1, 0); },
      [](Rig& r) { std::swap(r.cameras[1], r.cameras[2]); },
      [](Rig& r) { r.cameras.pop_back(); },
      [](Rig& r) { std::swap(r.topology.rows, r.topology.columns); },
      [](Rig& r) { r.topology.type = Topology::Type::kDelaunay; },
      [](Rig& r) {
        r.topology = {Topology::Type::kTriangles, 0, 0, {{0, 1, 2}}};
      },
      [](Rig& r) {
        r.topology = {Topology::Type::kTriangles, 0, 0, {{0, 2, 1}}};
      },
  };
  std::set<uint64_t> hashes;
  for (const auto& change : changes) {
    Rig rig = grid(2, 3);
    change(rig);
    EXPECT_NE(rig.hash(), 0u);
    hashes.insert(rig.hash());
  }
  EXPECT_EQ(hashes.size(), std::size(changes));
}

TEST(RigHash, IgnoresNamesFilesAndTheSignOfZero) {
  const Rig rig = grid(2, 3);
  Rig other = rig;
  other.directory = "elsewhere";
  for (Camera& camera : other.cameras) {
    camera.name = "x";
    camera.image = "x.png";
    camera.source = "file:///x";
    camera.pose.position.z = -0.0;
  }
  EXPECT_EQ(other.hash(), rig.hash());
}

// All hosts and later versions must agree on the hash, so its value is fixed.
TEST(RigHash, HasAFixedValue) { EXPECT_EQ(grid(2, 3).hash(), 0x283e1b05c5ccb88bu); }

TEST(Rig, FindsCamerasById) {
  const Rig rig = grid(2, 3);
  EXPECT_EQ(rig.index_of_id(104), 4u);
  EXPECT_FALSE(rig.index_of_id(4));
}

TEST(Rig, ResolvesOnlyRelativePaths) {
  Rig rig;
  rig.directory = "some/where";
  EXPECT_EQ(rig.resolve("a.png"), "some/where/a.png");
  EXPECT_EQ(rig.resolve("../b/a.png"), "some/where/../b/a.png");
  EXPECT_EQ(rig.resolve("20:15.png"), "some/where/20:15.png");
  EXPECT_EQ(rig.resolve("C:x"), "some/where/C:x") << "schemes have at least two characters";
  for (const char* as_it_is : {"", "/abs/a.png", "v4l2:///dev/video0", "rtsp://host/x", "testbin:videotestsrc"})
    EXPECT_EQ(rig.resolve(as_it_is), as_it_is);
  rig.directory = "";
  EXPECT_EQ(rig.resolve("a.png"), "a.png");
}

TEST(RebasePaths, PathsStayValidInTheNewFolder) {
  const TempDir dir;
  std::filesystem::create_directories(dir / "a/images");
  std::filesystem::create_directories(dir / "b/c");
  std::filesystem::create_directory_symlink(dir / "b/c", dir / "link");
  struct {
    const char *from, *path, *to, *expected;
  } const cases[] = {
      {"a", "images/x.png", "a", "images/x.png"},
      {"a", "images/x.png", "b/c", "../../a/images/x.png"},
      {"a", "../b/x.png", "b", "x.png"},
      {"a", "images/x.png", "link", "../../a/images/x.png"},
      {"link", "x.png", "a", "../b/c/x.png"},
      {"a", "film_%03d.png", "b", "../a/film_%03d.png"},
      {"a", "x.png", "not/yet/there", "../../../a/x.png"},
      {"a", "/abs/x.png", "b", "/abs/x.png"},
      {"a", "rtsp://host/x", "b", "rtsp://host/x"},
      {"a", "", "b", ""},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.from + std::string("/") + c.path + " from " + c.to);
    Rig rig = grid(1, 1);
    rig.directory = dir / c.from;
    rig.cameras[0].image = rig.cameras[0].source = c.path;
    rebase_paths(rig, dir / c.to);
    EXPECT_EQ(rig.cameras[0].image, c.expected);
    EXPECT_EQ(rig.cameras[0].source, c.expected);
    EXPECT_EQ(rig.directory, dir / c.to);
  }
}

TEST(RebasePaths, TooLongFolderNameIsAnError) {
  Rig rig = grid(1, 1);
  const std::string name(300, 'a');
  rig.cameras[0].image = name + "/x.png";
  EXPECT_ERROR(rebase_paths(rig, "b"), name);
}

TEST(RigSubset, CompleteRowsAndColumnsStayAGrid) {
  const Rig rig = grid(4, 5);
  struct {
    std::vector<CameraIndex> indices;
    int rows, columns;  // 0: Delaunay
  } const cases[] = {
      {{0, 1, 5, 6}, 2, 2},    {{6, 8, 9, 16, 18, 19}, 2, 3}, {{7}, 1, 1},
      {{5, 6, 7, 8, 9}, 1, 5}, {{3, 8, 13, 18}, 4, 1},        {{0, 1, 5}, 0, 0},
      {{0, 1, 5, 7}, 0, 0},    {{0, 1, 6, 7}, 0, 0},          {{1, 0, 6, 5}, 0, 0},  // mirrored
      {{5, 6, 0, 1}, 0, 0},                                                          // rows exchanged
      {{0, 6, 12, 18}, 0, 0}  // a diagonal: a column by count but not by position
  };
  for (const auto& c : cases) {
    const Rig sub = rig_subset(rig, c.indices);
    ASSERT_EQ(sub.cameras.size(), c.indices.size());
    for (size_t i = 0; i < c.indices.size(); i++) EXPECT_EQ(sub.cameras[i].id, 100 + c.indices[i]);
    EXPECT_EQ(sub.topology.type, c.rows ? Topology::Type::kGrid : Topology::Type::kDelaunay);
    EXPECT_EQ(sub.topology.rows, c.rows);
    EXPECT_EQ(sub.topology.columns, c.columns);
  }
}

TEST(RigSubset, KeepsTrianglesOnlyForTheWholeRig) {
  Rig rig = grid(2, 2);
  rig.topology = {Topology::Type::kTriangles, 0, 0, {{0, 1, 3}}};
  rig.focus_distance = 3;
  EXPECT_EQ(rig_subset(rig, {0, 1}).focus_distance, 3);
  EXPECT_EQ(rig_subset(rig, {0, 1, 2, 3}).topology.triangles, rig.topology.triangles);
  EXPECT_EQ(rig_subset(rig, {0, 1, 3}).topology.type, Topology::Type::kDelaunay);
  EXPECT_EQ(rig_subset(rig, {1, 0, 2, 3}).topology.type, Topology::Type::kDelaunay);
}

TEST(RigSubset, RefusesUnknownCameras) {
  EXPECT_ERROR(rig_subset(grid(2, 2), {0, 4}), "index 4", "4 cameras");
  EXPECT_ERROR(rig_subset(grid(2, 2), {0, 1, 0}), "index 0", "twice");
  EXPECT_ERROR(rig_subset(grid(2, 2), {}), "one camera");
}

TEST(SubsampleGrid, KeepsRowsAndColumnsFromTheFirst) {
  EXPECT_THAT(ids(subsample_grid(grid(3, 4), 2)), ElementsAre(100, 102, 108, 110));
  EXPECT_THAT(ids(subsample_grid(grid(4, 4), 3)), ElementsAre(100, 103, 112, 115));
  EXPECT_THAT(ids(subsample_grid(grid(3, 4), 9)), ElementsAre(100));
  EXPECT_THAT(ids(subsample_grid(grid(3, 4), INT32_MAX)), ElementsAre(100));
  const Rig same = subsample_grid(grid(3, 4), 1);
  EXPECT_EQ(same.hash(), grid(3, 4).hash());
  EXPECT_EQ(subsample_grid(grid(3, 4), 2).topology.rows, 2);
  EXPECT_EQ(subsample_grid(grid(3, 4), 2).topology.columns, 2);
  EXPECT_ERROR(subsample_grid(grid(3, 4), 0), "every", "1", "0");
  Rig rig = grid(2, 2);
  rig.topology.type = Topology::Type::kDelaunay;
  EXPECT_ERROR(subsample_grid(rig, 2), "every", "grid");
}

TEST(CameraList, NamesCamerasById) {
  const Rig rig = grid(2, 4);
  EXPECT_THAT(parse_camera_list(rig, ""), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(parse_camera_list(rig, "107"), ElementsAre(7));
  EXPECT_THAT(parse_camera_list(rig, "100-102,107"), ElementsAre(0, 1, 2, 7));
  EXPECT_THAT(parse_camera_list(rig, "105,101-101,105,104-106"), ElementsAre(1, 4, 5, 6));
}

TEST(CameraList, ErrorsNameTheInvalidPart) {
  const InvalidText cases[] = {
      {"99", {"camera list \"99\"", "\"99\"", "id 99"}},
      {"100,106-108", {"106-108", "id 108"}},
      {"100-4294967295", {"100-4294967295", "id 108"}},
      {"102-101", {"\"102-101\"", "range"}},
      {"100,,101", {"\"\"", "camera id"}},
      {"100,", {"\"\"", "camera id"}},
      {",", {"\"\"", "camera id"}},
      {"x", {"\"x\"", "camera id"}},
      {"-1", {"\"-1\"", "camera id"}},
      {"100-", {"\"100-\"", "camera id"}},
      {"100-101-102", {"\"100-101-102\"", "camera id"}},
      {"100 101", {"\"100 101\"", "camera id"}},
      {"4294967296", {"\"4294967296\"", "camera id"}},
  };
  for (const auto& c : cases) EXPECT_ERROR(parse_camera_list(grid(2, 4), c.text), c.facts);
}

const GridRigOptions kGood = {2, 3, 0.1, 90, 640, 480};

TEST(GridRig, IsCentredWithRowsFromTheTop) {
  const Rig rig = make_grid_rig(kGood);
  ASSERT_EQ(rig.cameras.size(), 6u);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(rig.topology.rows, 2);
  EXPECT_EQ(rig.topology.columns, 3);
  EXPECT_NEAR(glm::length(rig.cameras[0].pose.position - Vec3(-0.1, -0.05, 0)), 0, 1e-15);
  EXPECT_NEAR(glm::length(rig.cameras[1].pose.position - Vec3(0, -0.05, 0)), 0, 1e-15);
  EXPECT_NEAR(glm::length(rig.cameras[3].pose.position - Vec3(-0.1, 0.05, 0)), 0, 1e-15);
  EXPECT_EQ(rig.cameras[5].name, "cam_01_02");
  EXPECT_EQ(rig.cameras[5].id, 5u);
  const Lens& lens = rig.cameras[5].lens;
  EXPECT_EQ(lens.model(), LensModel::kRadial);
  EXPECT_NEAR(lens.fx(), 240, 1e-12) << "vertical field of view: 90 degrees";
  EXPECT_EQ(lens.cx(), 319.5);
  EXPECT_EQ(lens.cy(), 239.5);
  EXPECT_EQ(parse_rig(rig_to_json(rig), "r.json").hash(), rig.hash());
}

TEST(GridRig, AcceptsOneCameraUpToTheLimits) {
  EXPECT_EQ(make_grid_rig({1, 1, 1, 60, 1, 1}).cameras[0].pose.position, Vec3(0, 0, 0));
  EXPECT_EQ(make_grid_rig({1, 1, 1e-6, 60, 8192, 8192}).cameras[0].width, 8192);
  EXPECT_EQ(make_grid_rig({255, 257, 1, 60, 4, 4}).cameras.size(), kMaxCameras);
}

TEST(GridRig, ErrorsNameTheOption) {
  const std::pair<std::vector<std::string>, std::function<void(GridRigOptions&)>> cases[] = {
      {{"rows", "1 to 65535", "0"}, [](auto& o) { o.rows = 0; }},
      {{"columns", "1 to 65535", "-1"}, [](auto& o) { o.columns = -1; }},
      {{"rows x columns", "65535 cameras"}, [](auto& o) { o.rows = o.columns = 256; }},
      {{"width", "1 to 16384", "0"}, [](auto& o) { o.width = 0; }},
      {{"height", "1 to 16384", "16385"}, [](auto& o) { o.height = 16385; }},
      {{"pitch", "positive"}, [](auto& o) { o.pitch = 0; }},
      {{"pitch", "positive"}, [](auto& o) { o.pitch = std::nan(""); }},
      {{"pitch", "positive"}, [](auto& o) { o.pitch = INFINITY; }},
      {{"fov_y", "0 and 180"}, [](auto& o) { o.fov_y_deg = 180; }},
  };
  for (const auto& [facts, spoil] : cases) {
    GridRigOptions options = kGood;
    spoil(options);
    EXPECT_ERROR(make_grid_rig(options), facts);
  }
}

TEST(CameraRanges, MergesNeighbours) {
  const CameraRanges ranges(CameraSet{0, 1, 2, 7, 9, 10});
  EXPECT_EQ(ranges.ranges(), (std::vector<CameraRange>{{0, 2}, {7, 7}, {9, 10}}));
  EXPECT_EQ(ranges.size(), 6u);
  EXPECT_EQ(ranges.cameras(), (CameraSet{0, 1, 2, 7, 9, 10}));
  EXPECT_TRUE(CameraRanges(CameraSet{}).empty());
}

TEST(CameraRanges, AppendsWithAGap) {
  CameraRanges ranges;
  EXPECT_TRUE(ranges.append({3, 5}));
  EXPECT_FALSE(ranges.append({6, 7}));
  EXPECT_FALSE(ranges.append({5, 7}));
  EXPECT_FALSE(ranges.append({0, 1}));
  EXPECT_FALSE(ranges.append({9, 8}));
  EXPECT_TRUE(ranges.append({7, 7}));
  EXPECT_EQ(ranges.cameras(), (CameraSet{3, 4, 5, 7}));
}

TEST(CameraRanges, AreSets) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; i++) {
    const auto some = [&random] {
      CameraSet set;
      const int one_in = 1 + static_cast<int>(random() % 4);
      for (CameraIndex camera = 0; camera < 24; camera++)
        if (random() % one_in == 0) set.push_back(camera);
      return set;
    };
    const CameraSet a = some(), b = some();
    const CameraRanges ra(a), rb(b);
    CameraSet both, left, common;
    std::ranges::set_union(a, b, std::back_inserter(both));
    std::ranges::set_difference(a, b, std::back_inserter(left));
    std::ranges::set_intersection(a, b, std::back_inserter(common));
    CameraRanges sum = ra, difference = ra;
    sum.add(rb);
    difference.remove(rb);
    EXPECT_EQ(sum, CameraRanges(both));
    EXPECT_EQ(difference, CameraRanges(left));
    EXPECT_EQ(ra.intersects(rb), !common.empty());
    EXPECT_EQ(ra.contains(rb), common.size() == b.size());
    for (CameraIndex camera = 0; camera < 26; camera++)
      EXPECT_EQ(ra.contains(camera), std::ranges::binary_search(a, camera));
  }
}

double apart(const Rig& rig, size_t a, size_t b) {
  return glm::length(rig.cameras[a].pose.position - rig.cameras[b].pose.position);
}

TEST(ArcRig, IsAroundItsCentreAndLooksAtTheCentre) {
  const Rig rig = make_arc_rig({.cameras = 9, .pitch = 0.06, .radius = 1.5, .fov_y_deg = 50});
  ASSERT_EQ(rig.cameras.size(), 9u);
  const Vec3 centre(0, 0, 1.5);
  for (size_t i = 0; i < 9; i++) {
    const Pose& pose = rig.cameras[i].pose;
    EXPECT_NEAR(glm::length(pose.position - centre), 1.5, 1e-12);
    EXPECT_NEAR(glm::length(pose.forward() - (centre - pose.position) / 1.5), 0, 1e-12) << "looks at the centre";
    EXPECT_NEAR(glm::length(pose.down() - Vec3(0, 1, 0)), 0, 1e-12) << "upright";
    if (i == 0) continue;
    EXPECT_NEAR(apart(rig, i - 1, i), 0.06, 1e-12);
    EXPECT_GT(pose.position.x, rig.cameras[i - 1].pose.position.x) << "from the left";
  }
  EXPECT_NEAR(glm::length(rig.cameras[4].pose.position), 0, 1e-12);
  EXPECT_EQ(rig.cameras[3].name, "cam_03");
  EXPECT_EQ(build_mesh(rig).faces.size(), 8u) << "a strip between neighbours";
  EXPECT_EQ(parse_rig(rig_to_json(rig), "arc").hash(), rig.hash());
}

TEST(ArcRig, RefusesInvalidOptions) {
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 0, .radius = 1, .fov_y_deg = 50}), "pitch", "positive");
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 1, .radius = -1, .fov_y_deg = 50}), "radius", "positive");
  EXPECT_ERROR(make_arc_rig({.cameras = 4, .pitch = 1, .radius = 1, .fov_y_deg = 50}), "half the circle");
  EXPECT_ERROR(make_arc_rig({.cameras = 2, .pitch = 3, .radius = 1, .fov_y_deg = 50}), "half the circle");
  EXPECT_ERROR(make_arc_rig({.cameras = 0, .pitch = 1, .radius = 1, .fov_y_deg = 50}), "columns", "1");
  EXPECT_ERROR(make_arc_rig({.cameras = 3, .pitch = 0.1, .radius = 1, .fov_y_deg = 0}), "fov_y");
}

TEST(RingRig, IsACircleLookingForward) {
  const Rig rig = make_ring_rig({.cameras = 8, .radius = 0.2, .fov_y_deg = 60});
  ASSERT_EQ(rig.cameras.size(), 8u);
  for (const Camera& camera : rig.cameras) {
    EXPECT_NEAR(glm::length(camera.pose.position), 0.2, 1e-12);
    EXPECT_NEAR(glm::length(camera.pose.forward() - Vec3(0, 0, 1)), 0, 1e-12);
  }
  EXPECT_NEAR(glm::length(rig.cameras[0].pose.position - Vec3(0, -0.2, 0)), 0, 1e-12) << "y is down";
  EXPECT_NEAR(glm::length(rig.cameras[2].pose.position - Vec3(0.2, 0, 0)), 0, 1e-12);
  EXPECT_EQ(build_mesh(rig).faces.size(), 6u) << "the triangles of an octagon";
  EXPECT_ERROR(make_ring_rig({.cameras = 2, .radius = 0.2, .fov_y_deg = 60}), "3 cameras");
  EXPECT_ERROR(make_ring_rig({.cameras = 5, .radius = 0, .fov_y_deg = 60}), "radius", "positive");
}

TEST(CylinderRig, IsAroundItsAxisWithAClosedMesh) {
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 3, .columns = 10, .pitch = 0.2, .radius = 1.5, .inward = inward, .fov_y_deg = 50});
    ASSERT_EQ(rig.cameras.size(), 30u);
    const Vec3 middle(0, 0, inward ? 1.5 : 0);
    for (size_t i = 0; i < 30; i++) {
      const Pose& pose = rig.cameras[i].pose;
      const Vec3 from_axis = pose.position - Vec3(middle.x, pose.position.y, middle.z);
      EXPECT_NEAR(glm::length(from_axis), 1.5, 1e-12);
      EXPECT_NEAR(pose.position.y, 0.2 * (static_cast<double>(i / 10) - 1), 1e-12);
      EXPECT_NEAR(glm::length(pose.forward() - (inward ? -1.0 : 1.0) * from_axis / 1.5), 0, 1e-12);
      EXPECT_NEAR(glm::length(pose.down() - Vec3(0, 1, 0)), 0, 1e-12) << "upright";
      const Pose& next = rig.cameras[i / 10 * 10 + (i + 1) % 10].pose;
      EXPECT_GT(pose.camera_from_world(next.position).x, 0) << "to the right";
    }
    EXPECT_NEAR(glm::length(rig.cameras[10].pose.forward() - Vec3(0, 0, 1)), 0, 1e-12);
    EXPECT_EQ(rig.cameras[23].name, "cam_02_03");
    const Mesh mesh = build_mesh(rig);
    EXPECT_EQ(mesh.faces.size(), 40u);
    std::vector<int> faces(30);
    for (const MeshFace& face : mesh.faces)
      for (const CameraIndex camera : face.camera) faces[camera]++;
    for (size_t i = 0; i < 30; i++) EXPECT_EQ(faces[i], i / 10 == 1 ? 6 : 3) << "the same all around";
    EXPECT_EQ(parse_rig(rig_to_json(rig), "cylinder").hash(), rig.hash());
  }
}

TEST(CylinderRig, RefusesInvalidOptions) {
  const auto make = [](int rows, int columns, double pitch, double radius) {
    return make_cylinder_rig({.rows = rows, .columns = columns, .pitch = pitch, .radius = radius, .fov_y_deg = 50});
  };
  EXPECT_EQ(make(2, 3, 0.1, 1).cameras.size(), 6u);
  EXPECT_ERROR(make(1, 3, 0.1, 1), "rows", "2");
  EXPECT_ERROR(make(2, 2, 0.1, 1), "columns", "3");
  EXPECT_ERROR(make(2, 3, 0.1, 0), "radius", "positive");
  EXPECT_ERROR(make(2, 3, -1, 1), "pitch", "positive");
}

Rig rig_of(int cameras, const std::function<Vec3(int)>& place) {
  std::vector<Vec3> positions;
  for (int i = 0; i < cameras; i++) positions.push_back(place(i));
  return test::rig_at(positions);
}

void expect_as_all_pairs(const Rig& rig) {
  double largest = 0, sum = 0;
  for (const Camera& a : rig.cameras) {
    double nearest = INFINITY;
    for (const Camera& b : rig.cameras) {
      if (&a == &b) continue;
      const double distance = glm::distance(a.pose.position, b.pose.position);
      largest = std::max(largest, distance);
      nearest = std::min(nearest, distance);
    }
    sum += nearest;
  }
  EXPECT_NEAR(largest_distance(rig), largest, 1e-9 * largest);
  EXPECT_NEAR(mean_nearest_distance(rig), sum / static_cast<double>(rig.cameras.size()), 1e-9 * largest);
}

TEST(CameraDistances, MatchAllPairs) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int n : {2, 3, 10, 200}) {
    expect_as_all_pairs(rig_of(n, [&](int) { return Vec3(number(random), number(random), number(random)); }));
    expect_as_all_pairs(rig_of(n, [&](int) { return Vec3(5, number(random), 0); }));
    expect_as_all_pairs(rig_of(n, [&](int i) { return Vec3(i % 7, i / 7, 0); }));
    expect_as_all_pairs(rig_of(n, [&](int i) {
      const double angle = 2 * std::numbers::pi * i / n;
      return Vec3(std::cos(angle), 3, std::sin(angle));
    }));
    expect_as_all_pairs(rig_of(n, [&](int i) { return Vec3(i % 2, 0, 0); }));
  }
}

TEST(CameraDistances, AreZeroForOneCamera) {
  const Rig rig = test::rig_at(std::vector{Vec3(1, 2, 3)});
  EXPECT_EQ(largest_distance(rig), 0);
  EXPECT_EQ(mean_nearest_distance(rig), 0);
}

}  // namespace
}  // namespace lf
