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

// What a viewer says on the data channel "control", in the format of webrtcsink: {"id": 7, "mid": null, "request":
// {"type": "navigationEvent", "event": {"event": "MouseMove", "x": 1, "y": 2, "modifier_state": "button1-mask"}}} or
// {"type": "customUpstreamEvent", "structureName": "lightfield-view-request", "structure": {"x": 0.1}}. One structure
// is none of lfviewrequest: "lightfield-pixel", {"x": 20, "y": 10}, asks which cameras make that pixel.
struct ControlMessage {
  static constexpr size_t kMaxBytes = 4096;
  static constexpr size_t kMaxFields = 16;        // fields of a structure
  static constexpr double kMaxPicture = 1 << 20;  // pixels and steps of a wheel

  struct Pixel {
    int x, y;
  };
  std::optional<uint64_t> id;  // number of the message, where it has one, sound or not
  EventPtr event;              // the event to send upstream; null: see pixel and error
  std::optional<Pixel> pixel;  // the pixel that is asked about
  std::string error;
};

// `max_aperture`: metres; views of larger ones are refused. Never throws.
ControlMessage parse_control_message(std::string_view text, double max_aperture);

// {"type": "ControlResponseMessage", "id": 7, "error": null}; `error` "": none.
std::string control_response(uint64_t id, const std::string& error);

// {"type": "InfoMessage", "mid": "video0", "info": {...}}: what the server tells.
std::string info_message(const nlohmann::json& info);

}  // namespace lf::serve
