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

// The functions in this file show how much each camera contributes to a pixel. They are for diagnosis and for tests.

// Returns the camera's weight in each pixel of `rect`, row by row. The weight is 0 where the camera does not see the
// focal surface. `rect` must be inside owners.region().
std::vector<float> valid_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect);

// Returns the sum of valid_weights() over all cameras for each pixel of the view. The sum is 1 where no weight is
// missing, and 0 outside the mesh. `owners.region()` must contain the rectangles of all contributors; pixels outside
// these rectangles are 0.
std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns the missing weight for each pixel of the view, 0 to 1, or NaN outside the mesh. `owners` must be as for
// view_coverage().
std::vector<float> missing_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

struct CameraFootprint {
  CameraIndex camera;
  Vec2 middle;    // mean position of the pixels, weighted by valid_weights()
  double weight;  // sum of valid_weights(), in pixels; more than 0
};
// Returns the footprints of the contributing cameras, ascending by camera. `owners` must be as for view_coverage().
std::vector<CameraFootprint> camera_footprints(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns the mean of view_coverage() over columns x rows evenly spaced pixels. The result is exact for the view's
// width and height. Cameras in `without` (ascending) count as missing.
double mean_coverage(const Rig& rig, const ViewPlan& plan, int columns, int rows, const CameraSet& without = {});

struct PixelShare {
  CameraIndex camera;
  float weight;
  bool sees;  // false if the camera does not see the point, so that its weight is missing
};
// Returns the cameras that contribute to pixel (x, y) of the view, by descending weight. The result is empty outside
// the mesh.
std::vector<PixelShare> pixel_shares(const Rig& rig, const ViewPlan& plan, int x, int y);

struct CameraColour {
  uint8_t r, g, b;
  bool operator==(const CameraColour&) const = default;
};
// Returns one colour for each camera of the rig. Cameras that share a face get different colours, unless a camera has
// eight or more neighbours of different colours. The result depends only on the mesh.
std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras);

// Brightness of the outlines in a contribution map, and the factor of its colours over a picture with this luma (0 to
// 255). The colours then stay readable over black, and the picture stays readable where it is white.
inline constexpr float kMapLine = 20;
inline float map_brightness(float luma) { return 0.35f + 0.65f * luma / 255; }

// Draws the overlay of the paper's Figure 10. Each pixel shows the mixture of its cameras' colours by weight, and faces
// are outlined. Missing weight and pixels without an owner are dark. If there is an `underlay` (an RGB picture of the
// view's size), its luma sets the brightness. Throws Error if the underlay has another format or size.
Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay = nullptr);

// Estimates which part of a view an array can fill, so that a moving viewer can be kept out of empty regions. Immutable
// and thread-safe.
class VisibleFraction {
 public:
  // Throws Error like build_mesh().
  explicit VisibleFraction(const Rig& rig);

  // Returns the fraction of the view's pixels that cameras can see, 0 to 1, estimated on a coarse raster. `aspect` is
  // width / height of the view. Lines of sight are followed to a great distance, so the result does not depend on the
  // focus. Costs one ViewPlan.
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // Returns the viewpoint that every viewer starts with. It is default_viewpoint(), moved into the nearest triangle of
  // cameras so that three cameras contribute to each pixel. If the cameras face all directions, as around a scene, the
  // view axis equals the axis of a camera of the triangle. The field of view is as wide as possible, up to the field of
  // default_viewpoint(), without dark pixels at `focus_distance` and far away. `set` describes views that are shown
  // together, such as a stereo pair. None of their eyes sees dark pixels, and they are centred horizontally on the
  // array. Costs a dozen ViewPlans.
  Viewpoint home(double aspect, double focus_distance = 0, const ViewSet& set = {}) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
