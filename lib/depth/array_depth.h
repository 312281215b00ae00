// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/worker_pool.h"
#include "depth/camera_depth.h"
#include "rig/mesh.h"
#include "view/depth_edges.h"
#include "view/view.h"
#include "view/visibility_mask.h"

namespace lf {

// Returns the image of a camera, in memory and with the camera's size, valid until the next call.
using MatchedImages = std::function<ImageView(CameraIndex)>;

// The depths that the cameras of an array see at one time, and the surface of the scene for any view. Each camera has a
// depth map of its own, matched against the cameras around it, so that the surface has sharp edges where the images
// have, and irregular arrays work like grids. Immutable.
class ArrayDepth {
 public:
  // Cameras that a camera is matched with, cameras that its depths are checked with, and cameras that determine the
  // surface of a view, or the sides of pixels at its edges.
  static constexpr int kMatched = 6, kChecked = 6, kCameras = 8, kEdgeCameras = 4;

  static constexpr size_t kCompleted = 2;  // number of cameras; see updated()

  // Estimates the depths of `cameras` (ascending) from their images, in steps: coarse() and finer(). The time is
  // proportional to the number of pixels: about 0.7 s for each camera of 1008x756 pixels in one thread. `parallel`
  // distributes the cameras.
  ArrayDepth(const Rig& rig, const CameraSet& cameras, const MatchedImages& images, double farthest, double nearest,
             const ParallelFor& parallel = serial_for);
  // Finds the depths at an eighth of the resolution, or a quarter for small images, and the range of the scene.
  // `nearest` and `farthest` limit the search, as inverse distances from the cameras in 1/m.
  static ArrayDepth coarse(const Rig& rig, const CameraSet& cameras, const MatchedImages& images, double farthest,
                           double nearest, const ParallelFor& parallel = serial_for);
  // Estimates the depths of the same images at twice the resolution of this object, within the range that was found.
  ArrayDepth finer(const Rig& rig, const MatchedImages& images, const ParallelFor& parallel = serial_for) const;
  // Does the same in a quarter of the time, for live views. Estimates the depths of `first` (ascending) only. The last
  // step only tests depths near the depths of this object. All other cameras keep their depths. updated()
  // completes the estimates.
  ArrayDepth quick_finer(const Rig& rig, const CameraSet& first, const MatchedImages& images,
                         const ParallelFor& parallel = serial_for) const;
  // Returns true at half the resolution of the images (or less for very large images), where finer() must not be
  // called.
  bool is_finest(const Rig& rig) const;
  // Returns the depths at another time, or of other cameras, at the resolution and in the range of this object. A
  // camera whose image and neighbours have changed by no more than noise keeps its depths. For other images, the search
  // starts with the depths before, which takes a third of the time. After quick_finer(), each call completes the
  // estimates of kCompleted cameras. The images of cameras in `unchanged` (ascending) are not fetched, because they are
  // known to be the same as before.
  ArrayDepth updated(const Rig& rig, const CameraSet& cameras, const CameraSet& unchanged, const MatchedImages& images,
                     const ParallelFor& parallel = serial_for) const;

  // The range of the scene that was found.
  const DepthSweep& range() const { return range_; }
  CameraSet cameras() const;
  // Returns false if updated() must still complete estimates of quick_finer().
  bool is_complete() const;
  // Returns true if updated() has kept the depths of all cameras.
  bool shares_all(const ArrayDepth& before) const { return cameras_ == before.cameras_; }

  // Returns the surface of a view, with the size, the step and the plane `from` of a focal map of the view. Each level
  // is the nearest depth at which the depth maps of the kCameras cameras around the view agree, weighted by their
  // confidence. A camera that sees something nearer does not count. Where these cameras see nothing, the next cameras
  // determine the level. Nodes that no camera sees, and only these, have level 0, which is at least as far as all
  // others.
  FocalMap surface(const View& view, const FocalMap& map, const ParallelFor& parallel = serial_for) const;
  // Does the same for a map of the finest step, with distances from the plane through the eye that faces along the
  // view's axis.
  FocalMap surface(const View& view, const ParallelFor& parallel = serial_for) const;

  // Returns the depth edges of a view with a focal map of the finest step, from surface(). Each pixel of a cell with an
  // edge belongs to the nearest of its two sides on which the depth maps of the cameras agree.
  DepthEdges edges(const View& view, const ParallelFor& parallel = serial_for) const;

  // Returns which nodes of a view's focal map a camera sees. Something hides a node if the camera's depth map is nearer
  // there by more than the tolerance of surface(). The test covers the nodes around the pixels of `parts`. All other
  // nodes count as visible. `edges` are the edges of the view, or null. Returns nothing if the camera has no depth map,
  // or the view no focal map. Values of edges outside `parts` are not set.
  std::optional<VisibilityMask> visibility(const View& view, CameraIndex camera, std::span<const Rect> parts,
                                           const DepthEdges* edges = nullptr) const;

 private:
  struct Camera {
    CameraIndex index = 0;
    MatchingImage image;
    CameraDepth depth;
    int unsettled = 0;  // updates that the depths need although the image does not change any more
    bool is_incomplete = false;  // quick_finer() has estimated the depths
  };
  struct WeightedCamera {
    const Camera* camera;
    float weight;
  };
  class DepthAgreement;
  class ViewPoints;

  ArrayDepth() = default;
  // An estimate starts with the depths of `before`, unless this is null. At another resolution, only the cameras in
  // `first` are estimated. At the same resolution, their incomplete estimates are completed.
  struct Start {
    const ArrayDepth* before = nullptr;
    CameraSet first = {};
    bool is_quick = false;
  };
  void estimate(const Rig& rig, const CameraSet& cameras, const CameraSet& unchanged, const MatchedImages& images,
                int divisor, const Start& start, const ParallelFor& parallel);
  // Returns the range that most of the confident depths are in.
  DepthSweep confident_range() const;
  // Returns kCameras cameras in the order of their distance from the eye, starting with number `first` of this order.
  std::vector<WeightedCamera> cameras_around(const Vec3& eye, size_t first = 0) const;

  std::vector<std::shared_ptr<const Camera>> cameras_;
  DepthSweep range_;
  int divisor_ = 1;  // camera pixels for each pixel of the depth maps, along rows and columns
};

}  // namespace lf
