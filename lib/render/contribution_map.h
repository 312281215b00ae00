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

// The functions in this file show how much each camera contributes to a pixel of a view.

// Returns the weight of `camera` in the colour of each pixel of `rect`, row by row. The weight is 0 where the camera
// does not see the point of the focal surface (the surface in focus), because its image then has no colour for the
// pixel. `owners` is the triangle of each pixel. `rect` must be inside owners.region(). `rig_camera` is the same camera
// in the rig.
std::vector<float> valid_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect);

// Returns for each pixel of the view how much of the blending weight the cameras can provide. The value is 1 if all
// cameras of the pixel see the point in focus. It is 0 if none of them sees the point, and outside the camera mesh. The
// value is the sum of valid_weights() over all cameras.
//
// `owners` is the triangle of each pixel and must include all pixels that the cameras contribute to; the value of other
// pixels is 0.
std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

// Returns for each pixel how much of the blending weight is missing, 0 to 1, because a camera that should contribute
// does not see the point in focus. The value is NaN outside the camera mesh. `owners` is as in view_coverage().
std::vector<float> missing_weights(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

struct CameraFootprint {
  CameraIndex camera;
  Vec2 middle;    // mean position of the pixels, weighted by valid_weights()
  double weight;  // sum of valid_weights(), in pixels; more than 0
};
// Returns where each contributing camera contributes to the view, in ascending order of the cameras. `owners` is as in
// view_coverage().
std::vector<CameraFootprint> camera_footprints(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners);

struct MeanCoverage {
  double seen = 0;          // 0 to 1
  double extrapolated = 0;  // the part of `seen` that lies beside the camera mesh; see render/extrapolation.h
};
// Estimates the mean of view_coverage() from columns x rows evenly spaced pixels, because testing every pixel takes
// long. The result is exact if these numbers are the width and the height of the view. The cameras in `without`
// (ascending) are treated as cameras that see nothing.
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
// Returns a colour for each camera of the rig. Two cameras of the same face (triangle of the camera mesh) have
// different colours. The exception is a camera with eight or more neighbours that already have different colours. The
// colours depend only on the mesh, so they do not change when the view moves.
std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras);

// map_brightness() returns the factor for the colours of a contribution map over a pixel with this luma (0 to 255). The
// factor keeps the colours visible over a black picture, and the details of a white picture visible through the
// colours. kMapLine is the brightness of the outlines of the triangles.
inline constexpr float kMapLine = 20;
inline float map_brightness(float luma) { return 0.35f + 0.65f * luma / 255; }

// Draws a picture of the view in the colours of the contributing cameras, as in Figure 10 of the paper. The colours are
// mixed by weight, and the triangles of the camera mesh are outlined. Pixels with missing weight are darker, and pixels
// outside the mesh are dark. If there is an `underlay`, an RGB picture of the view's size, its luma sets the
// brightness. Throws Error if the underlay has another format or size.
Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay = nullptr);

// Estimates which part of a view the cameras of an array can fill. Immutable and thread-safe.
class VisibleFraction {
 public:
  // Prepares the estimate for a rig. Throws Error like build_mesh().
  explicit VisibleFraction(const Rig& rig);

  // Returns the fraction of the view that the cameras can see, 0 to 1, estimated at a coarse grid of pixels. `aspect`
  // is the width of the view divided by its height. The function tests points at a great distance instead of points in
  // focus, so that the result does not depend on the focus. It takes as long as planning one view (ViewPlan).
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // Returns the viewpoint that every viewer starts with. It is default_viewpoint(), moved into the nearest triangle of
  // cameras so that three cameras contribute to each pixel. If the cameras face all directions, as around a scene, the
  // view axis equals the axis of a camera of the triangle.
  //
  // The field of view is as wide as possible without dark pixels, both at `focus_distance` and far away. It is never
  // wider than the field of default_viewpoint(). `set` describes views that are shown together, such as a stereo pair.
  // None of these views has dark pixels, and the views are centred horizontally on the array. The function takes as
  // long as planning a dozen views (ViewPlan).
  Viewpoint home(double aspect, double focus_distance = 0, const ViewSet& set = {}) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
