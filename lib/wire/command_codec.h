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

// How a camera takes part in a view, by its knowledge of the rig: the three random access cameras of the paper.
enum class Access {
  kSelf,    // knows its own pose and its neighbours' poses, and plans from the view request
  kWarp,    // knows only its lens, and receives triangles and matrices
  kPixels,  // knows nothing, and is asked for unprocessed pixels of its image
};

}  // namespace lf

namespace lf::wire {

// Requests with explicit homographies or pixel regions (section 4.2 of the paper), for cameras that cannot plan from a
// ViewRequest. A command serves all cameras that contribute to the view; each camera takes its own part. Like a view
// request, a command is self-contained.

struct WarpCommand : RequestHeader {
  ViewWarp warp;
  bool operator==(const WarpCommand&) const = default;
};

struct PixelCommand : RequestHeader {
  struct Region {
    CameraIndex camera = 0;
    Rect rect;  // part of the camera's image, not empty; x0, y0 even
    bool operator==(const Region&) const = default;
  };
  int view_width = 0, view_height = 0;
  std::vector<Region> regions;  // in ascending camera order
  bool operator==(const PixelCommand&) const = default;
};

// A request of any kind, in the order of Access.
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

// Commands as units of application/x-lightfield-request, see spec.md. Stateless; all lengths and values are checked
// before use.

// Return the bytes of a command. Throw Error with the invalid field if the result could not be decoded.
std::vector<uint8_t> encode_command(const WarpCommand& command);
std::vector<uint8_t> encode_command(const PixelCommand& command);
// Return nullopt unless `bytes` is exactly one valid command of that kind; `reason` (may be null) then receives the
// reason.
std::optional<WarpCommand> decode_warp_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);
std::optional<PixelCommand> decode_pixel_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Returns the kind of cameras that a request unit of this type is for, or nullopt for unknown types.
std::optional<Access> access_of_type(uint8_t type);
std::vector<uint8_t> encode_any_request(const AnyRequest& request);
std::optional<AnyRequest> decode_any_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
