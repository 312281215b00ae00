// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <variant>
#include <vector>

#include "render/view_warp.h"
#include "view/view_request.h"

namespace lf {

// What a camera has to know to take part in a view: the paper's three random access cameras.
enum class Access {
  kSelf,    // its own and its neighbours' places: it finds out what to do from the view request
  kWarp,    // its own lens: it is told triangles and matrices
  kPixels,  // nothing: it is told which of its image's pixels to send, as they are
};

namespace wire {

// Requests for cameras that are told what to do (the paper's section 4.2), in place of a ViewRequest, from which
// cameras find out themselves. One for all cameras that contribute to the view: each takes its own. Like a view
// request they are complete in themselves.

// The request for cameras that know their lens alone.
struct WarpCommand : RequestHeader {
  ViewWarp warp;
  bool operator==(const WarpCommand&) const = default;
};

// The request for cameras that only have pixels to give.
struct PixelCommand : RequestHeader {
  struct Region {
    CameraIndex camera = 0;
    Rect rect;  // a part of the camera's image, not empty; x0, y0 even
    bool operator==(const Region&) const = default;
  };
  int view_width = 0, view_height = 0;
  std::vector<Region> regions;  // ascending cameras
  bool operator==(const PixelCommand&) const = default;
};

// A request of any kind; kinds are in the order of Access.
using AnyRequest = std::variant<ViewRequest, WarpCommand, PixelCommand>;

inline const RequestHeader& head_of(const AnyRequest& request) {
  return std::visit([](const RequestHeader& head) -> const RequestHeader& { return head; }, request);
}
inline Access access_of(const AnyRequest& request) { return static_cast<Access>(request.index()); }
// Width and height of the view, pixels.
inline std::pair<int, int> view_size(const AnyRequest& request) {
  if (const auto* view = std::get_if<ViewRequest>(&request)) return {view->view.width, view->view.height};
  if (const auto* warp = std::get_if<WarpCommand>(&request)) return {warp->warp.width, warp->warp.height};
  const auto& pixels = std::get<PixelCommand>(request);
  return {pixels.view_width, pixels.view_height};
}

}  // namespace wire
}  // namespace lf
