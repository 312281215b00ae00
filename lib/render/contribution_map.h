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

// Returns the weight of `camera` in each pixel of `rect`, row by row. `rig_camera` is the same camera in the rig. The
// weight is 0 in pixels with a point of the focal surface that the camera does not see. `rect` must be inside
// owners.region().
std::vector<float> valid_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect);

// Returns the coverage of each pixel of the view: the total weight of the cameras that see its point, which is the sum
// of valid_weights() over all cameras. The coverage is 1 if all cameras of the pixel see the point, and 0 outside the
// mesh. `owners.region()` must contain the rectangles of all contributing cameras; pixels outside these rectangles are
// 0.
std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns the missing weight of each pixel of the view, 0 to 1: the total weight of the cameras that should contribute
// but do not see the point. It is NaN outside the mesh. `owners` must satisfy the condition of view_coverage().
std::vector<float> missing_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

struct CameraFootprint {
  CameraIndex camera;
  Vec2 middle;    // mean position of the pixels, weighted by valid_weights()
  double weight;  // sum of valid_weights(), in pixels; more than 0
};
// Returns the footprints of all contributing cameras, in ascending order of their indices. `owners` must satisfy the
// condition of view_coverage().
std::vector<CameraFootprint> camera_footprints(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// The share of a view's pixels that cameras see.
struct MeanCoverage {
  double seen = 0;          // 0 to 1
  double extrapolated = 0;  // the part of `seen` that lies beside the camera mesh; see render/extrapolation.h
};
// Estimates the mean of view_coverage() from columns x rows evenly spaced pixels. If these numbers are the width and
// the height of the view, the result is exact. The cameras in `without` (ascending) are treated as cameras that see
// nothing.
MeanCoverage mean_coverage(const Rig& rig, const ViewPlan& plan, int columns, int rows, const CameraSet& without = {});

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
// Returns one colour for each camera of the rig. Two cameras of the same face (triangle of the mesh) have different
// colours, except if a camera has eight or more neighbours with different colours. The colours depend only on the mesh,
// so they do not change when the view moves.
std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras);

// kMapLine is the brightness of the outlines in a contribution map. map_brightness() returns the factor for the colours
// of the map over a pixel with this luma (0 to 255). With this factor, the colours are visible over a black picture,
// and the details of a white picture are visible through the colours.
inline constexpr float kMapLine = 20;
inline float map_brightness(float luma) { return 0.35f + 0.65f * luma / 255; }

// Draws a map of the cameras that contribute to each pixel of the view, as in Figure 10 of the paper. The colours of
// the cameras are mixed by weight, and faces are outlined. Pixels with missing weight are darker, and pixels without an
// owner (outside the mesh) are dark. If there is an `underlay`, an RGB picture of the view's size, its luma sets the
// brightness. Throws Error if the underlay has another format or size.
Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay = nullptr);

// Estimates which part of a view the cameras of an array can fill. Navigation uses the estimate to keep a moving viewer
// away from viewpoints with empty regions in the picture. Immutable and thread-safe.
class VisibleFraction {
 public:
  // Throws Error like build_mesh().
  explicit VisibleFraction(const Rig& rig);

  // Returns the fraction of the view that the cameras can see, 0 to 1, estimated at a coarse grid of pixels. `aspect`
  // is the width of the view divided by its height. The function tests points at a great distance instead of points on
  // the focal plane, so the result does not depend on the focus. It takes as long as computing one ViewPlan.
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // Returns the viewpoint that every viewer starts with. It is default_viewpoint(), moved into the nearest triangle of
  // cameras so that three cameras contribute to each pixel. If the cameras face all directions, as around a scene, the
  // view axis equals the axis of a camera of the triangle. The field of view is as wide as possible, up to the field of
  // default_viewpoint(), without dark pixels at `focus_distance` and far away. `set` describes views that are shown
  // together, such as a stereo pair. None of these views has dark pixels, and the views are centred horizontally on the
  // array. The function takes as long as computing a dozen ViewPlans.
  Viewpoint home(double aspect, double focus_distance = 0, const ViewSet& set = {}) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
