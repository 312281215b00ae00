// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "composite/resolve.h"
#include "image/image.h"
#include "render/contribution_map.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Measures how much of a view the cameras can see, from request to request. Samples a moving view only now and then.
// Not thread-safe.
class ViewCoverage {
 public:
  static constexpr int kColumns = 32, kRows = 24;  // sample grid
  static constexpr int64_t kInterval = 500'000;    // microseconds

  // Returns the share of the view's pixels that cameras in service see, 0..1. `exact`: for this request; otherwise the
  // result may be up to kInterval old. `now`: microseconds, any clock. `lost`: cameras of the mesh that see nothing,
  // ascending. The rig must not change until clear().
  double share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact, int64_t now);
  void clear() { *this = {}; }

 private:
  MeshCache mesh_;
  View view_;
  CameraSet out_of_service_, lost_;
  double share_ = -1;
  int64_t known_at_ = 0;
};

// The overlay that visualizes the cameras' weights in a picture.
//   kContributions: each pixel in its cameras' colours, mixed by weight, with lines between the faces of the mesh; see
//     contribution_map().
//   kCoverage: the missing weight, in the colours of heat_map().
enum class WeightOverlayMode { kNone, kContributions, kCoverage };

// Draws weight overlays in real time (contribution_map.h is for stills). Weights are computed at every fourth pixel and
// row and interpolated linearly. Not thread-safe.
class WeightOverlay {
 public:
  // As made by resolve().
  struct Picture {
    PixelFamily family = PixelFamily::kNone;
    RgbLayout layout;
    Levels levels;
    uint8_t* plane[3] = {};
    ptrdiff_t stride[3] = {};
  };
  // `seeing`: cameras that have contributed; the weight of all other cameras is missing. Ignores the request's
  // out-of-service cameras. Throws Error as build_mesh() does.
  void draw(WeightOverlayMode what, const Rig& rig, const ViewRequest& request, const CameraRanges& seeing,
            const Picture& picture);

 private:
  static constexpr int kStep = 4;  // pixels between nodes
  struct Node {
    float r = 0, g = 0, b = 0;  // weighted colours, 0..255
    float seen = 0;
    float owned = 0;  // 1: covered by the mesh
  };
  void find_nodes(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners, const CameraRanges& seeing);
  Node at(int x, int y) const;

  MeshCache mesh_;
  std::vector<CameraColour> colours_;
  int columns_ = 0;  // node columns
  std::vector<Node> nodes_;
};

}  // namespace lf
