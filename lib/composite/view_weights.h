// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "composite/resolve.h"
#include "image/image.h"
#include "render/contribution_map.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Measures how much of a view the cameras can see, to warn the user about a view that is mostly empty. Not thread-safe.
class ViewCoverage {
 public:
  static constexpr int kColumns = 32, kRows = 24;
  static constexpr int64_t kInterval = 500'000;  // microseconds between measurements of a moving view

  // Returns the share of the view's pixels that cameras in service can see, from 0 to 1. If `exact` is true, the result
  // is for this request. Otherwise the result may be up to kInterval old. `now` is in microseconds of any clock. `lost`
  // lists the cameras of the mesh that have no images, in ascending order. The rig must not change until clear().
  MeanCoverage share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact, int64_t now);
  void clear() { *this = {}; }

 private:
  MeshCache mesh_;
  View view_;
  CameraSet out_of_service_, lost_;
  std::optional<MeanCoverage> share_;
  int64_t known_at_ = 0;
};

// The overlays that lfcompositor can draw over a picture, to find faults of the array. kContributions: each pixel in
// the colours of its cameras, mixed by weight, with lines between the triangles
//   of the camera mesh; see contribution_map().
// kCoverage: the missing weight (the share of the pixel that no camera could provide), in the colours of
//   heat_map().
enum class WeightOverlayMode { kNone, kContributions, kCoverage };

// Draws weight overlays in real time. Weights are computed at every fourth pixel and row and interpolated in between;
// contribution_map.h computes every pixel of a still. Not thread-safe.
class WeightOverlay {
 public:
  struct Picture {
    PixelFamily family = PixelFamily::kNone;
    RgbLayout layout;
    Levels levels;
    uint8_t* plane[3] = {};
    ptrdiff_t stride[3] = {};
  };
  // Draws the overlay `what` over the picture. `seeing` are the cameras that contributed. All other cameras
  // have missing weight.
  void draw(WeightOverlayMode what, const Rig& rig, const ViewRequest& request, const CameraRanges& seeing,
            const Picture& picture);

 private:
  static constexpr int kStep = 4;  // pixels between nodes
  struct Node {
    float r = 0, g = 0, b = 0;  // weighted colours, 0 to 255
    float seen = 0;
    float owned = 0;  // 1 if covered by the mesh
  };
  void find_nodes(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners, const CameraRanges& seeing);
  Node at(int x, int y) const;

  MeshCache mesh_;
  std::vector<CameraColour> colours_;
  int columns_ = 0;
  std::vector<Node> nodes_;
};

}  // namespace lf
