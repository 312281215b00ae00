// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>

namespace lf::serve {

// How pictures are focused, in lfcompositor's words.
struct FocusOn {
  std::string mode = "auto";  // property "focus" of lfcompositor
  double near = 0, far = 0;   // metres from the array: "focus-near" and "focus-far"
  std::string gains;          // property "gains"; "": as lfcompositor has it
};

// What viewers may ask of the server, and get.
struct Limits {
  int viewers = 8;                         // views in fact: who has two eyes counts twice
  int address_views = 2;                   // views of one address
  int max_width = 1280, max_height = 720;  // largest size of a view, pixels
  double max_aperture = 0;                 // metres; 0: the array's size
  int framerate = 30;
  int capture_delay_ms = 100;  // how old a capture must be before it is asked for: what the cameras take
  double focus = 0;            // metres, of a view to begin with; 0: as lfviewrequest chooses
  FocusOn focus_on;
  int monitor = 0;                   // requests from one camera's turn to be watched to the next; 0: never
  int bit_rate = 6000000;            // bits per second, of one viewer's video
  double messages_per_second = 240;  // messages on a data channel
  double connects_per_second = 2;    // connects of one address, after the first `connect_burst`
  double connect_burst = 40;
  static constexpr double kMostBitsPerPixel = 0.22;  // bits a pixel of video at best, whatever `bit_rate` allows
  static constexpr int kMinSize = 64;                // pixels a side
  static constexpr double kSilence = 5;              // seconds without a packet until a viewer is removed
  static constexpr double kConnect = 15;             // seconds from an offer until its viewer must be connected
  static constexpr double kWrongTokens = 0.2, kWrongTokensAtOnce = 10;  // wrong tokens of one address per second
};

// Bits per second that a view's video gets at best: more of it looks no better.
inline int best_bit_rate(int width, int height, const Limits& limits) {
  const double most = Limits::kMostBitsPerPixel * width * height * limits.framerate;
  return static_cast<int>(std::min<double>(limits.bit_rate, std::max(most, 300000.0)));
}

// What a viewer asks for.
struct Wish {
  int width = 640, height = 480;  // pixels, of an eye
  double eye_distance = 0;        // metres; 0: one eye
  std::string path;               // a views.json to be flown, or ""
  int views() const { return eye_distance > 0 ? 2 : 1; }
};

// Metres between the eyes. "" or null: 0, one eye. Nothing for what is no distance.
inline std::optional<double> eye_distance(const char* text) {
  if (!text || !*text) return 0;
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (*end || !(value >= 0) || value > 1e6) return std::nullopt;
  return value;
}

struct ViewSize {
  int width = 640, height = 480;  // pixels
};
// The size of a view as asked for in pixels: both sides even and within the limits, scaled together so that the picture
// keeps its shape, but no side less than kMinSize. "" or null: ViewSize's. Nothing for what is no number.
inline std::optional<ViewSize> view_size(const char* width, const char* height, const Limits& limits) {
  const auto side = [](const char* text, double otherwise) -> double {
    if (!text || !*text) return otherwise;
    char* end = nullptr;
    const double value = std::strtod(text, &end);
    return *end || !(value > 0) || value > 1e6 ? 0 : value;
  };
  const double w = side(width, ViewSize().width), h = side(height, ViewSize().height);
  if (w == 0 || h == 0) return std::nullopt;
  const double scale = std::min({1.0, limits.max_width / w, limits.max_height / h});
  const auto fitted = [scale](double value, int most) {
    return std::clamp(static_cast<int>(std::lround(value * scale)), Limits::kMinSize, most) & ~1;
  };
  return ViewSize{fitted(w, limits.max_width), fitted(h, limits.max_height)};
}

}  // namespace lf::serve
