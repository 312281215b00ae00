// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lf::serve {

struct FocusSettings {
  std::string mode = "auto";  // "focus"
  double near = 0, far = 0;   // "focus-near" and "focus-far", metres from the array
  std::string gains;          // "gains"; "": default of lfcompositor
};

struct Limits {
  int viewers = 8;  // maximum number of views; a stereo viewer counts twice
  int address_views = 2;
  int max_width = 1280, max_height = 720;  // maximum size of a view, pixels
  double max_aperture = 0;                 // metres; 0: size of the array
  int framerate = 30;
  int capture_delay_ms = 100;  // minimum age of a requested capture: the latency of the cameras
  double focus = 0;            // initial focus distance, metres; 0: chosen by lfviewrequest
  FocusSettings focus_settings;
  int monitor = 0;         // viewer requests per camera check; 0: never
  int bit_rate = 6000000;  // bits per second of one viewer's video
  double messages_per_second = 240;
  double connects_per_second = 2;  // connects per address, after the first `connect_burst`
  double connect_burst = 40;
  static constexpr double kMostBitsPerPixel = 0.22;  // maximum useful bits per pixel, below `bit_rate`
  static constexpr int kMinSize = 64;                // pixels per side
  static constexpr double kSilence = 5;              // seconds without a packet until a viewer is removed
  static constexpr double kConnect = 15;             // seconds from an offer until the viewer must be connected
  static constexpr double kWrongTokens = 0.2, kWrongTokensAtOnce = 10;  // wrong tokens per address and second
};

// Returns the maximum useful video bit rate of a view, bits per second.
inline int best_bit_rate(int width, int height, const Limits& limits) {
  const double most = Limits::kMostBitsPerPixel * width * height * limits.framerate;
  return static_cast<int>(std::min<double>(limits.bit_rate, std::max(most, 300000.0)));
}

struct ViewParams {
  int width = 640, height = 480;  // per eye, pixels
  double eye_distance = 0;        // metres; 0: one eye
  std::string path;               // camera path (views.json) to play, or ""
  int views() const { return eye_distance > 0 ? 2 : 1; }
};

// Parses the distance between the eyes, metres. "" or null: 0, one eye. Returns std::nullopt for invalid text.
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
// Parses the requested size of a view, pixels. Scales it to the limits with its aspect ratio, with even sides of at
// least kMinSize. "" or null: defaults of ViewSize. Returns std::nullopt for invalid text.
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

// A bucket that fills with `per_second` tokens, up to `burst`. Times are g_get_monotonic_time(), microseconds, and must
// not decrease. Not thread-safe.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) : per_second_(per_second), burst_(burst), tokens_(burst) {}

  // Takes `count` tokens. Returns false and takes nothing if there are fewer.
  bool take(int64_t now, double count = 1);
  // Keeps the existing tokens, up to the new burst.
  void set_rate(double per_second, double burst, int64_t now);
  bool full(int64_t now);

 private:
  void fill(int64_t now);

  double per_second_, burst_, tokens_;
  int64_t filled_ = 0;
};

// A bucket for each of the latest kMaxAddresses addresses. A new address replaces the least recent address. A flood
// from many addresses thus never limits an uninvolved address. Not thread-safe.
class AddressLimit {
 public:
  static constexpr size_t kMaxAddresses = 4096;

  AddressLimit(double per_second, double burst) : per_second_(per_second), burst_(burst) {}

  bool take(const std::string& address, int64_t now) { return bucket(address, now).take(now); }
  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    TokenBucket bucket;
    std::list<std::string>::iterator place;
  };
  TokenBucket& bucket(const std::string& address, int64_t now);

  double per_second_, burst_;
  std::map<std::string, Entry> entries_;
  std::list<std::string> order_;
};

// Assigns seats to viewers and queues waiting viewers. A seat is a view; a stereo viewer takes two. Each address has a
// maximum number of views. Viewers that have not connected yet share at most a quarter of all seats. Beyond that, a
// viewer that has not connected after kConnectTimeout loses its seats first, then one of the address with the most
// unconnected views. Without a free seat, viewers wait in a queue with a ticket that they must present repeatedly. Uses
// no clock and no locks; times are g_get_monotonic_time(), microseconds.
class AdmissionControl {
 public:
  static constexpr int64_t kConnectTimeout = 2000000;  // microseconds until an unconnected viewer may lose its seats
  static constexpr int64_t kTicketTimeout = 3000000;   // microseconds until a ticket that is not presented expires
  static constexpr size_t kMaxQueued = 64;

  AdmissionControl(int seats, int of_address);

  struct Answer {
    enum Verdict { kAdmitted, kAddress, kFull } verdict = kFull;
    std::vector<std::string> leave;  // kAdmitted: sessions that lose their seats, to be closed at once
    std::string ticket;              // kFull: "" if the queue is full, too
    size_t place = 0;
  };
  // Requests seats for `views` of `address`, or a place in the queue. `ticket`: from the previous answer, or "";
  // `new_ticket`: an unguessable ticket, used if one is needed.
  Answer ask(const std::string& address, int views, const std::string& ticket, const std::string& new_ticket,
             int64_t now);
  // Takes the seats. Call after ask() has returned kAdmitted and the sessions in `leave` are closed. `session`: name of
  // the viewer's session.
  void take(const std::string& session, const std::string& address, int views, int64_t now);
  void connected(const std::string& session);
  void leave(const std::string& session);

  int taken() const {
    return sum(held_, [](const Seat&) { return true; });
  }
  int of_address() const { return of_address_; }
  size_t waiting() const { return queue_.size(); }

 private:
  struct Seat {
    std::string address;
    int views;
    int64_t since;
    bool connected;
  };
  struct QueueEntry {
    std::string name, address;
    int64_t shown;
  };
  using SeatMap = std::map<std::string, Seat>;

  template <typename Counts>
  static int sum(const SeatMap& held, const Counts& counts) {
    int views = 0;
    for (const auto& [session, seat] : held) views += counts(seat) ? seat.views : 0;
    return views;
  }
  SeatMap::const_iterator largest_user(const SeatMap& held, const std::string& address, int views) const;
  bool make_room(const std::string& address, int views, int ahead, int64_t now, Answer& answer) const;
  void enqueue(const std::string& address, const std::string& new_ticket, int64_t now, Answer& answer);

  const int admission_, of_address_, unconnected_;
  SeatMap held_;
  std::deque<QueueEntry> queue_;
};

}  // namespace lf::serve
