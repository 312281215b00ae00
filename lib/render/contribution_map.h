// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "image/image.h"
#include "render/ownership.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/navigator.h"
#include "view/view.h"

namespace lf {

// Functions that show the cameras of each pixel, for diagnosis and for tests.

// Returns the camera's weight in each pixel of `rect`, row-major; 0 where the camera does not see the focal surface.
// `rect` must be inside owners.region().
std::vector<float> valid_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect);

// Returns the sum of valid_weights() over all cameras, per pixel of the view: 1 where no weight is missing, 0 outside
// the mesh. `owners.region()` must contain the rectangles of all contributors. Pixels outside these rectangles are 0.
std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns the missing weight, 0 to 1, per pixel of the view; NaN outside the mesh. `owners` as above.
std::vector<float> missing_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

struct CameraFootprint {
  CameraIndex camera;
  Vec2 middle;    // mean of its pixels, weighted by valid_weights()
  double weight;  // sum of valid_weights(), in pixels; above 0
};
// Returns the footprints of the contributing cameras, ascending. `owners` as above.
std::vector<CameraFootprint> camera_footprints(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns the mean of view_coverage() over columns x rows evenly spaced pixels of the view. The result is exact for the
// view's width and height. `without`: cameras to ignore, ascending.
double mean_coverage(const Rig& rig, const ViewPlan& plan, int columns, int rows, const CameraSet& without = {});

struct PixelShare {
  CameraIndex camera;
  float weight;
  bool sees;  // false: its weight is missing
};
// Returns the cameras that contribute to pixel (x, y) of the view, by descending weight; empty outside the mesh.
std::vector<PixelShare> pixel_shares(const Rig& rig, const ViewPlan& plan, int x, int y);

struct CameraColour {
  uint8_t r, g, b;
  bool operator==(const CameraColour&) const = default;
};
// Returns one colour for each camera of the rig. Cameras that share a face differ, unless one has eight or more
// neighbours of different colours. The result depends only on the mesh.
std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras);

// Level of the outlines in a contribution map, and brightness of its colours over an underlay with this luma (0 to
// 255): the colours stay readable over black, and the underlay over white.
inline constexpr float kMapLine = 20;
inline float map_brightness(float luma) { return 0.35f + 0.65f * luma / 255; }

// Draws the overlay of the paper's Figure 10: each pixel has the mixture of its cameras' colours, by weight, with faces
// outlined. Missing weight and pixels without an owner are dark. `underlay` (optional, RGB, of the view's size)
// modulates the brightness. Throws Error if the underlay has another format or size.
Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay = nullptr);

// Estimates which part of a view an array can fill, to keep a moving viewer out of empty regions. Immutable;
// thread-safe.
class VisibleFraction {
 public:
  // Throws Error like build_mesh().
  explicit VisibleFraction(const Rig& rig);

  // Returns the fraction of the view's pixels, 0 to 1, that cameras can see, estimated on a coarse raster. Lines of
  // sight are followed to far away, so that the result does not depend on the focus. `aspect`: width / height of the
  // view. Cost: one ViewPlan.
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // Returns the initial viewpoint. It is default_viewpoint(), moved into the nearest triangle of cameras, so that three
  // cameras contribute to each pixel. If the cameras face all directions, as around a scene, the view axis is the axis
  // of a camera of this triangle. The field of view is the widest, up to the one of default_viewpoint(), without dark
  // pixels at `focus_distance` (see there) and far away. `set`: the views to be shown instead of a single view; none of
  // their eyes sees dark pixels, and they are centred horizontally on the array. Cost: a dozen ViewPlans.
  Viewpoint home(double aspect, double focus_distance = 0, const ViewSet& set = {}) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
