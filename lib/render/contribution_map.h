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

// These tell which cameras make which pixel of a view: what a person looks at to understand a picture, and what tests
// count.

// What a camera can give to each pixel: its weight where it sees the point on the focal surface, 0 where that is
// lost. Per pixel of `rect` (row-major, rect.width() * rect.height() values). `rect` inside owners.region().
std::vector<float> valid_weights(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const Rect& rect);

// The sum of valid_weights() over all cameras, per pixel of the view: 1 where nothing is lost, 0 outside the mesh.
// `owners.region()` contains the rectangles of all contributors; pixels outside them are 0.
std::vector<float> view_coverage(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners);

// The weight that is lost, 0..1, per pixel of the view; NaN outside the mesh, where nobody has any. `owners` as above.
std::vector<float> lost_weights(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners);

// Where in a view a camera is at work.
struct CameraPlace {
  CameraIndex camera;
  Vec2 middle;    // the mean of its pixels, each by what the camera gives to it
  double weight;  // sum of valid_weights(), in pixels; above 0
};
// The cameras that give something to the view, ascending. `owners` as above.
std::vector<CameraPlace> camera_places(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners);

// The mean of view_coverage() over `columns` times `rows` pixels of the view, evenly spaced: exact for the view's width
// and height. `without`: cameras that give nothing, ascending.
double mean_coverage(const Rig& rig, const ViewPlan& plan, int columns, int rows, const CameraSet& without = {});

struct PixelShare {
  CameraIndex camera;
  float weight;
  bool sees;  // whether the camera sees what is in focus there; else its weight is lost
};
// The cameras that make the pixel (x, y) of the view, the heaviest first; none outside the mesh.
std::vector<PixelShare> pixel_shares(const Rig& rig, const ViewPlan& plan, int x, int y);

struct CameraColour {
  uint8_t r, g, b;
  bool operator==(const CameraColour&) const = default;
};
// One colour per camera of the rig, such that cameras that share a face differ (as long as none has eight neighbours or
// more, all of other colours). A function of the mesh alone.
std::vector<CameraColour> camera_colours(const Mesh& mesh, size_t num_cameras);

// The level of lines in a contribution map, and how bright its colours are over a picture of that luma, 0..255: they
// stay readable over black, the picture over white.
inline constexpr float kMapLine = 20;
inline float map_light(float luma) { return 0.35f + 0.65f * luma / 255; }

// The overlay of the paper's Figure 10: every pixel of the view in the colours of the cameras that make it, mixed by
// their weights; faces outlined. Weight that is lost and pixels without an owner are dark. `underlay` (RGB, of the
// view's size) shows through by its luma where it is given.
Image contribution_map(const Rig& rig, const Mesh& mesh, const View& view, const Image* underlay = nullptr);

// How much of a view an array can fill: what keeps somebody who flies from ending in the dark. Immutable; thread-safe.
class VisibleShare {
 public:
  // Throws Error as build_mesh() does.
  explicit VisibleShare(const Rig& rig);

  // The share of the view's pixels, 0..1, that cameras can see, estimated on a coarse raster. Lines of sight are
  // followed to far away rather than to the focal plane, so that it does not depend on the focus. `aspect`: the view's
  // width over its height. Cost: that of a ViewPlan.
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // The viewpoint to begin with: default_viewpoint(), but inside of the nearest triangle of cameras, of which three
  // make each pixel, rather than on an edge between two; with the axis of a camera of that triangle where the cameras
  // look all ways, as around a scene; and with the widest field of view, up to that of
  // default_viewpoint(), that leaves no pixel dark, at `focus_distance` (see there) and far away. Cost: that of a dozen
  // ViewPlans. `set`: what is put in place of the view; none of its eyes then looks into the dark, and they stand as
  // far to the left of the array's middle as to the right.
  Viewpoint home(double aspect, double focus_distance = 0, const ViewSet& set = {}) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect, const ViewSet& set) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
