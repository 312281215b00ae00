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

// A viewer's message on the data channel "control", in the format of webrtcsink: {"id": 7, "mid": null, "request":
// {"type": "navigationEvent", "event": {"event": "MouseMove", "x": 1, "y": 2, "modifier_state": "button1-mask"}}} or
// {"type": "customUpstreamEvent", "structureName": "lightfield-view-request", "structure": {"x": 0.1}}. The structure
// "lightfield-pixel", {"x": 20, "y": 10}, is not sent to lfviewrequest. It asks which cameras contribute to that pixel.
struct ControlMessage {
  static constexpr size_t kMaxBytes = 4096;
  static constexpr size_t kMaxFields = 16;
  static constexpr double kMaxPicture = 1 << 20;  // maximum of pixel coordinates and wheel steps

  struct Pixel {
    int x, y;
  };
  std::optional<uint64_t> id;  // number of the message, if present, also for invalid messages
  EventPtr event;              // event to send upstream; null: see pixel and error
  std::optional<Pixel> pixel;
  std::string error;
};

// `max_aperture`: maximum aperture, metres; larger values are errors. Never throws.
ControlMessage parse_control_message(std::string_view text, double max_aperture);

// Returns {"type": "ControlResponseMessage", "id": 7, "error": null}; `error` "": none.
std::string control_response(uint64_t id, const std::string& error);

// Returns {"type": "InfoMessage", "mid": "video0", "info": {...}}, the server's information for the page.
std::string info_message(const nlohmann::json& info);

}  // namespace lf::serve
