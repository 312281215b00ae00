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

// What a camera has to know to take part in a view: the paper's three random access cameras.
enum class Access {
  kSelf,    // its own and its neighbours' places: it finds out what to do from the view request
  kWarp,    // its own lens: it is told triangles and matrices
  kPixels,  // nothing: it is told which of its image's pixels to send, as they are
};

}  // namespace lf

namespace lf::wire {

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

// Commands as units of application/x-lightfield-request, see spec.md. Stateless; every length and number is checked
// before it is used.

// The bytes of a command. Throw Error naming the field if they could not be decoded again.
std::vector<uint8_t> encode_command(const WarpCommand& command);
std::vector<uint8_t> encode_command(const PixelCommand& command);
// Nothing for bytes that are not exactly one valid command of that kind; `reason` (may be null) then says why.
std::optional<WarpCommand> decode_warp_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);
std::optional<PixelCommand> decode_pixel_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Which cameras a unit of the request stream is for, by its type; nothing for types that are not known.
std::optional<Access> access_of_type(uint8_t type);
// These encode and decode a request of any kind, as the functions of that kind do.
std::vector<uint8_t> encode_any_request(const AnyRequest& request);
std::optional<AnyRequest> decode_any_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
