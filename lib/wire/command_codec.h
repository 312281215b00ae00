// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "render/view_plan.h"
#include "view/view_request.h"

namespace lf {

// Says how much of its contribution to a view a camera computes by itself. The three levels are the three kinds of
// random access camera in the paper.
enum class Access {
  kSelf,    // knows its pose and its neighbours' poses, and plans from the view request
  kWarp,    // has only its lens parameters, and receives triangles and matrices from the client
  kPixels,  // delivers unprocessed pixels of its image; the client renders the view
};

}  // namespace lf

namespace lf::wire {

// Commands are requests for cameras that cannot plan their contribution from a ViewRequest, because they do not know
// the rig. A WarpCommand contains explicit homographies, a PixelCommand contains regions of pixels (section 4.2 of the
// paper). One command serves all cameras that contribute to the view, and each camera takes its own part. A command is
// self-contained, like a view request.

struct WarpCommand : RequestHeader {
  ViewWarp warp;
  bool operator==(const WarpCommand&) const = default;
};

struct PixelCommand : RequestHeader {
  struct Region {
    CameraIndex camera = 0;
    Rect rect;  // part of the camera's image; not empty, x0 and y0 are even
    bool operator==(const Region&) const = default;
  };
  int view_width = 0, view_height = 0;
  std::vector<Region> regions;  // ascending by camera
  bool operator==(const PixelCommand&) const = default;
};

// Holds a request of any kind, in the order of Access.
using AnyRequest = std::variant<ViewRequest, WarpCommand, PixelCommand>;

inline const RequestHeader& head_of(const AnyRequest& request) {
  return std::visit([](const RequestHeader& head) -> const RequestHeader& { return head; }, request);
}
inline Access access_of(const AnyRequest& request) { return static_cast<Access>(request.index()); }
inline std::pair<int, int> view_size(const AnyRequest& request) {
  if (const auto* view = std::get_if<ViewRequest>(&request)) return {view->view.width, view->view.height};
  if (const auto* warp = std::get_if<WarpCommand>(&request)) return {warp->warp.width, warp->warp.height};
  const auto& pixels = std::get<PixelCommand>(request);
  return {pixels.view_width, pixels.view_height};
}

// The functions below convert commands to and from units of type application/x-lightfield-request; see spec.md. They
// check all lengths and values before use.

// Throw Error with the invalid field if the result could not be decoded.
std::vector<uint8_t> encode_command(const WarpCommand& command);
std::vector<uint8_t> encode_command(const PixelCommand& command);
// Return nullopt unless `bytes` is exactly one valid command of that kind. `reason`, unless null, then receives an
// explanation.
std::optional<WarpCommand> decode_warp_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);
std::optional<PixelCommand> decode_pixel_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Returns the access of the cameras that a request unit of this type is for, or nullopt for an unknown type.
std::optional<Access> access_of_type(uint8_t type);
std::vector<uint8_t> encode_any_request(const AnyRequest& request);
std::optional<AnyRequest> decode_any_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
