// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace lf::serve {

struct UnrefEvent {
  void operator()(GstEvent* event) const { gst_event_unref(event); }
};
using EventPtr = std::unique_ptr<GstEvent, UnrefEvent>;

// A message that a viewer's page sends on the data channel "control", in the format of GStreamer's webrtcsink:
//    {"id": 7, "mid": null, "request": {"type": "navigationEvent",
//     "event": {"event": "MouseMove", "x": 1, "y": 2, "modifier_state": "button1-mask"}}}
//    {"id": 8, "mid": null, "request": {"type": "customUpstreamEvent",
//     "structureName": "lightfield-view-request", "structure": {"x": 0.1}}}
// A structure "lightfield-pixel", {"x": 20, "y": 10}, requests the list of cameras that contribute to this pixel. The
// server answers this message without lfviewrequest.
struct ControlMessage {
  static constexpr size_t kMaxBytes = 4096;
  static constexpr size_t kMaxFields = 16;
  static constexpr double kMaxPicture = 1 << 20;

  struct Pixel {
    int x, y;
  };
  std::optional<uint64_t> id;  // number of the message, if it has one; also set for invalid messages
  EventPtr event;              // event for lfviewrequest; null for questions about a pixel and for invalid messages
  std::optional<Pixel> pixel;
  std::string error;
};

// Parses a message. A requested aperture above `max_aperture` (metres) is an error. Never throws; `error` has the
// reason if the message is invalid.
ControlMessage parse_control_message(std::string_view text, double max_aperture);

// Returns the response to message `id`: {"type": "ControlResponseMessage", "id": 7, "error": null}. An empty `error`
// becomes null.
std::string control_response(uint64_t id, const std::string& error);

std::string info_message(const nlohmann::json& info);

}  // namespace lf::serve
