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

// How much of a view an array's cameras can see, from request to request. A view that moves is looked at now and then.
// Not thread-safe.
class ViewCoverage {
 public:
  static constexpr int kColumns = 32, kRows = 24;  // of pixels of the view that are looked at
  static constexpr int64_t kInterval = 500'000;    // microseconds

  // The share of the request's pixels that cameras in service can see, 0..1: `exact`, or of a view up to kInterval ago.
  // `now`: of any one clock, microseconds. The rig is the same until clear().
  // `lost`: cameras of the mesh that see nothing, ascending.
  double share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact, int64_t now);
  void clear() { *this = {}; }

 private:
  MeshCache mesh_;
  View view_;  // the view that share_ is of
  CameraSet out_of_service_, lost_;
  double share_ = -1;
  int64_t known_at_ = 0;
};

// What a picture shows of its cameras' weights, over what they see.
//   kContributions: each pixel in the colours of the cameras that make it, mixed by their weights, as
//     contribution_map() has them; lines are the edges between faces of the mesh.
//   kCoverage: the weight that is lost, on the scale of heat_map().
enum class ShownWeights { kNone, kContributions, kCoverage };

// Draws weights over pictures while they are made: contribution_map.h, for many pictures a second. Weights are found at
// every fourth pixel of every fourth row and are linear in between. Not thread-safe.
class WeightOverlay {
 public:
  // A picture as resolve() makes it, of the request's view.
  struct Picture {
    PixelFamily family = PixelFamily::kNone;
    RgbLayout layout;
    Levels levels;
    uint8_t* plane[3] = {};
    ptrdiff_t stride[3] = {};
  };
  // `seeing`: the cameras that have given something to the picture; the weight of others is lost. Cameras that the
  // request has out of service are none of the array's. Throws Error as build_mesh() does.
  void draw(ShownWeights what, const Rig& rig, const ViewRequest& request, const CameraRanges& seeing,
            const Picture& picture);

 private:
  static constexpr int kStep = 4;  // pixels between nodes
  struct Node {
    float r = 0, g = 0, b = 0;  // 0..255: colours times weights
    float seen = 0;             // weight that is not lost
    float owned = 0;            // 1: the array has a face there
  };
  void find_nodes(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners, const CameraRanges& seeing);
  Node at(int x, int y) const;

  MeshCache mesh_;
  std::vector<CameraColour> colours_;
  int columns_ = 0;  // of nodes
  std::vector<Node> nodes_;
};

}  // namespace lf
