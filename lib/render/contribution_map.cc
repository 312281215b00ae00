// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/contribution_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/text.h"
#include "render/camera_projection.h"

namespace lf {

namespace {

// The palette of Okabe and Ito (Color Universal Design, 2008), which colour-blind people can distinguish, with white
// instead of black.
constexpr std::array<CameraColour, 8> kPalette{{{0, 114, 178},
                                                {230, 159, 0},
                                                {0, 158, 115},
                                                {204, 121, 167},
                                                {240, 228, 66},
                                                {213, 94, 0},
                                                {86, 180, 233},
                                                {235, 235, 235}}};

constexpr float kLineWidth = 1.2f;

// Returns how much of the pixel the face's outline covers, 0 to 1. A weight is 0 along the edge opposite its corner, so
// the distance from that edge is weight / slope.
float outline(const ViewPlan& plan, const FacePlan& face, int x, int y) {
  const auto weights = [&](int px, int py) { return face_weights(face, plan.rays().at(px, py)); };
  const FaceWeights here = weights(x, y);
  const int dx = x + 1 < plan.view().width ? 1 : -1, dy = y + 1 < plan.view().height ? 1 : -1;
  const FaceWeights right = weights(x + dx, y), below = weights(x, y + dy);
  float nearest = INFINITY;
  for (int k = 0; k < 3; k++) {
    const float slope = std::hypot(right.w[k] - here.w[k], below.w[k] - here.w[k]);
    if (slope > 0) nearest = std::min(nearest, here.w[k] / slope);
  }
  return std::clamp(kLineWidth - nearest, 0.f, 1.f);
}

float luma(const Image& rgb, int x, int y) {
  const uint8_t* p = rgb.pixel(x, y);
  return 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
}

}  // namespace

std::vector<float> valid_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect) {
  std::vector<float> weights = pixel_weights(plan, owners, camera, rect);
  const CameraProjection projection(plan, camera, rig_camera);
  float* weight = weights.data();
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++, weight++) {
      Vec2 pixel;
      if (*weight > 0 && !projection.project(plan.rays().at(x, y), plan.inverse_at(x, y), pixel)) *weight = 0;
    }
  return weights;
}

namespace {

// Calls fn(x, y, weight) for each pixel in the rectangle of a camera, with its valid_weights().
template <typename Fn>
void for_valid_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                       const Fn& fn) {
  const Rect rect = plan.camera_rect(camera);
  const std::vector<float> weights = valid_weights(plan, owners, camera, rig.cameras[camera], rect);
  const float* weight = weights.data();
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) fn(x, y, *weight++);
}

}  // namespace

std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners) {
  const int width = plan.view().width;
  std::vector<float> coverage(static_cast<size_t>(width) * plan.view().height);
  for (const CameraIndex camera : plan.contributors())
    for_valid_weights(rig, plan, owners, camera,
                      [&](int x, int y, float weight) { coverage[static_cast<size_t>(y) * width + x] += weight; });
  return coverage;
}

std::vector<float> missing_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners) {
  std::vector<float> lost = view_coverage(rig, plan, owners);
  const int width = plan.view().width;
  for (size_t i = 0; i < lost.size(); i++) {
    const bool owned = owners.at(static_cast<int>(i % width), static_cast<int>(i / width)) != FaceIdMap::kNone;
    lost[i] = owned ? std::max(0.f, 1 - lost[i]) : NAN;
  }
  return lost;
}

std::vector<CameraFootprint> camera_footprints(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners) {
  std::vector<CameraFootprint> places;
  for (const CameraIndex camera : plan.contributors()) {
    CameraFootprint place{camera, {0, 0}, 0};
    for_valid_weights(rig, plan, owners, camera, [&](int x, int y, float weight) {
      place.middle += static_cast<double>(weight) * Vec2(x, y);
      place.weight += weight;
    });
    if (!(place.weight > 0)) continue;
    place.middle /= place.weight;
    places.push_back(place);
  }
  return places;
}

MeanCoverage mean_coverage(const Rig& rig, const ViewPlan& plan, int columns, int rows, const CameraSet& without) {
  const int width = plan.view().width, height = plan.view().height;
  const auto place = [](int i, int count, int size) { return (2 * i + 1) * size / (2 * count); };
  std::vector<FaceIdMap> owners;
  owners.reserve(rows);
  for (int j = 0; j < rows; j++) {
    const int y = place(j, rows, height);
    owners.emplace_back(plan, Rect{0, y, width, y + 1});
  }
  const bool beside_mesh = plan.view().blending.is_mesh();
  MeanCoverage sum;
  for (const CameraIndex camera : plan.contributors()) {
    if (std::ranges::binary_search(without, camera)) continue;
    const Rect rect = plan.camera_rect(camera);
    const CameraCorners corners(plan, camera);
    const CameraProjection projection(plan, camera, rig.cameras[camera]);
    for (const FaceIdMap& row : owners) {
      const int y = row.region().y0;
      if (y < rect.y0 || y >= rect.y1) continue;
      for (int i = 0; i < columns; i++) {
        const int x = place(i, columns, width);
        if (x < rect.x0 || x >= rect.x1) continue;
        const float weight = corners.weight_at(plan, row, x, y);
        Vec2 pixel;
        if (!(weight > 0) || !projection.project(plan.rays().at(x, y), plan.inverse_at(x, y), pixel)) continue;
        sum.seen += weight;
        if (beside_mesh && !plan.faces()[row.at(x, y)].has_corners()) sum.extrapolated += weight;
      }
    }
  }
  const double pixels = static_cast<double>(columns) * rows;
  return {sum.seen / pixels, sum.extrapolated / pixels};
}

std::vector<PixelShare> pixel_shares(const Rig& rig, const ViewPlan& plan, int x, int y) {
  const Rect pixel{x, y, x + 1, y + 1};
  const FaceIdMap owners(plan, pixel);
  std::vector<PixelShare> shares;
  for (const CameraIndex camera : plan.contributors()) {
    if (intersect(plan.camera_rect(camera), pixel).empty()) continue;
    const float weight = pixel_weights(plan, owners, camera, pixel)[0];
    if (weight > 0)
      shares.push_back({camera, weight, valid_weights(plan, owners, camera, rig.cameras[camera], pixel)[0] > 0});
  }
  std::sort(shares.begin(), shares.end(), [](const auto& a, const auto& b) { return a.weight > b.weight; });
  return shares;
}

std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras) {
  std::vector<std::vector<CameraIndex>> neighbours(num_cameras);
  for (const MeshFace& face : mesh.faces)
    for (int i = 0; i < face.corners(); i++)
      for (int k = 0; k < face.corners(); k++)
        if (i != k) neighbours[face.camera[i]].push_back(face.camera[k]);

  // Each camera takes the colour that the fewest of its earlier neighbours have. The search starts at a different
  // colour for each camera, so that all colours are used.
  std::vector<size_t> chosen(num_cameras);
  std::vector<CameraColour> colours(num_cameras);
  for (size_t i = 0; i < num_cameras; i++) {
    std::array<int, kPalette.size()> taken{};
    for (const CameraIndex neighbour : neighbours[i])
      if (neighbour < i) taken[chosen[neighbour]]++;
    chosen[i] = i % kPalette.size();
    for (size_t k = 0; k < kPalette.size(); k++) {
      const size_t candidate = (i + k) % kPalette.size();
      if (taken[candidate] < taken[chosen[i]]) chosen[i] = candidate;
    }
    colours[i] = kPalette[chosen[i]];
  }
  return colours;
}

Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay) {
  if (underlay &&
      (underlay->family() != PixelFamily::kRgb || underlay->width() != view.width || underlay->height() != view.height))
    throw Error("the underlay of a contribution map must be an RGB image of the view's size");
  const ViewPlan plan(rig, mesh, view);
  const FaceIdMap owners(plan, {0, 0, view.width, view.height});
  const std::vector<CameraColour> colours = camera_colours(mesh, rig.cameras.size());

  std::vector<float> sum(static_cast<size_t>(view.width) * view.height * 3);
  for (const CameraIndex camera : plan.contributors())
    for_valid_weights(rig, plan, owners, camera, [&](int x, int y, float weight) {
      float* const out = &sum[(static_cast<size_t>(y) * view.width + x) * 3];
      out[0] += weight * colours[camera].r;
      out[1] += weight * colours[camera].g;
      out[2] += weight * colours[camera].b;
    });

  Image map(PixelFamily::kRgb, view.width, view.height);
  const float* in = sum.data();
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++, in += 3) {
      const int32_t owner = owners.at(x, y);
      if (owner == FaceIdMap::kNone) continue;
      const FacePlan& face = plan.faces()[owner];
      const float line = face.has_corners() ? outline(plan, face, x, y) : 0;
      const float light = underlay ? map_brightness(luma(*underlay, x, y)) : 1.f;
      for (int c = 0; c < 3; c++) {
        const float v = in[c] * light * (1 - line) + kMapLine * line;
        map.pixel(x, y)[c] = static_cast<uint8_t>(std::clamp(v + 0.5f, 0.f, 255.f));
      }
    }
  return map;
}

namespace {

constexpr int kRows = 12, kMaxColumns = 4 * kRows;
constexpr int kFineRows = 97, kMaxFineColumns = 4 * kFineRows;
constexpr float kBright = 0.25f;
constexpr int kHalvings = 12;

Viewpoint far_from(const Viewpoint& viewpoint) {
  Viewpoint far = viewpoint;
  far.focus_distance = kMaxFocus;
  far.aperture = 0;
  return far;
}

// Extrapolated pixels do not count: they are less accurate.
View inside_mesh(View view) {
  view.blending.extrapolates = false;
  return view;
}

// Returns the number of rows of a raster, at most `most`, for about `most_columns` columns. Fewer columns at the same
// number of rows would be a narrower view.
int raster_rows(int most, int most_columns, double aspect) {
  constexpr int kLeast = 6;
  return std::clamp(static_cast<int>(most_columns / aspect), kLeast, most);
}

Vec3 middle_of(const Rig& rig, const MeshFace& face) {
  Vec3 middle(0);
  for (const CameraIndex camera : face.camera) middle += rig.cameras[camera].pose.position / 3.0;
  return middle;
}

const MeshFace* nearest_face(const Rig& rig, const Mesh& mesh, const Vec3& position) {
  const MeshFace* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const MeshFace& face : mesh.faces) {
    if (face.corners() < 3) continue;
    if (const double distance = glm::length(middle_of(rig, face) - position); distance < least) {
      least = distance;
      nearest = &face;
    }
  }
  return nearest;
}

// Returns true if the cameras surround a scene, so that their mean axis is meaningless.
bool is_omnidirectional(const Rig& rig) {
  constexpr double kMinMean = 0.3;
  Vec3 sum(0);
  for (const Camera& camera : rig.cameras) sum += camera.pose.forward();
  return glm::length(sum) < kMinMean * static_cast<double>(rig.cameras.size());
}

}  // namespace

VisibleFraction::VisibleFraction(const Rig& rig) : rig_(rig), mesh_(build_mesh(rig)) {}

double VisibleFraction::operator()(const Viewpoint& viewpoint, double aspect) const {
  const int rows = raster_rows(kRows, kMaxColumns, aspect);
  const int columns = std::max(static_cast<int>(std::lround(rows * aspect)), 1);
  return mean_coverage(rig_, ViewPlan(rig_, mesh_, inside_mesh(make_view(far_from(viewpoint), columns, rows))), columns,
                       rows)
      .seen;
}

// Enlarge the raster by one pixel on each side of the view, so that corners between raster points are not dark.
bool VisibleFraction::sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const {
  const int rows = raster_rows(kFineRows, kMaxFineColumns, aspect);
  const int columns = std::max(static_cast<int>(std::lround((rows - 1) * aspect)) + 1, 2);
  Viewpoint v = viewpoint;
  const double edge = std::tan(v.fov_y_deg * (M_PI / 360)) * rows / (rows - 3);
  v.fov_y_deg = std::atan(edge) * (360 / M_PI);
  const View near = inside_mesh(make_view(clamped(v), columns, rows)),
             far = inside_mesh(make_view(clamped(far_from(v)), columns, rows));
  // The outermost views of a set see the least.
  const int last = set.place(0).count() - 1;
  for (const int eye : {0, last / 2, last}) {
    View view = set.view(near, set.place(eye));
    // Near objects are displaced more in cameras beside the eye.
    for (const View* focused : {&far, &near}) {
      view.focus = focused->focus;
      view.blending = focused->blending;
      const ViewPlan plan(rig_, mesh_, view);
      const std::vector<float> seen = view_coverage(rig_, plan, FaceIdMap(plan, {0, 0, columns, rows}));
      if (std::ranges::any_of(seen, [](float share) { return share < kBright; })) return false;
    }
    if (last == 0) break;
  }
  return true;
}

Viewpoint VisibleFraction::home(double aspect, double focus_distance, const ViewSet& set) const {
  Viewpoint v = default_viewpoint(rig_, focus_distance);
  const MeshFace* const face = nearest_face(rig_, mesh_, v.pose.position);
  if (face && is_omnidirectional(rig_)) {
    // If the cameras surround a scene, a camera of the face gives the right direction.
    v.pose.orientation = rig_.cameras[face->camera[0]].pose.orientation;
    v = clamped(v);
  }
  const Vec3 inside = face ? middle_of(rig_, *face) - v.pose.position : Vec3(0), right = v.pose.right();
  const bool is_set = set.place(0).count() > 1;
  v.pose.position += is_set ? inside - glm::dot(inside, right) * right : inside;
  const auto with_fov = [&v](double fov_y_deg) {
    Viewpoint other = v;
    other.fov_y_deg = fov_y_deg;
    return other;
  };
  if (sees_all(v, aspect, set)) return v;
  double seen = kMinFovDeg, dark = v.fov_y_deg;
  if (!sees_all(with_fov(seen), aspect, set)) return v;  // for example a ring of cameras
  for (int i = 0; i < kHalvings; i++) {
    const double middle = (seen + dark) / 2;
    (sees_all(with_fov(middle), aspect, set) ? seen : dark) = middle;
  }
  return with_fov(seen);
}

}  // namespace lf
