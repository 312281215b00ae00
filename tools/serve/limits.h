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

// The properties of lfcompositor that control the focus, for all viewers.
struct FocusSettings {
  std::string mode = "auto";
  double near = 0, far = 0;  // properties "focus-near" and "focus-far", metres from the array
  std::string gains;         // property "gains"; empty: its default
};

struct Limits {
  int viewers = 8;  // maximum number of views; a stereo viewer needs two
  int watchers = 100;  // maximum number of viewers of all shared flights together
  int address_views = 2;
  int max_width = 1280, max_height = 720;  // maximum size of a view, pixels
  double max_aperture = 0;                 // metres; 0: size of the array
  int framerate = 30;
  // time between a capture and a request for it, which must exceed the latency of the cameras
  int capture_delay_ms = 100;
  double focus = 0;  // initial focus distance, metres; 0: chosen by lfviewrequest
  FocusSettings focus_settings;
  std::string replica;     // name of this server among several; may be empty
  int monitor = 0;         // requests of a viewer per camera check; 0: no checks
  int bit_rate = 6000000;  // bits per second
  double messages_per_second = 240;
  double connects_per_second = 2;  // connections per address, after the first `connect_burst`
  double connect_burst = 40;
  // bits per pixel above which the video does not improve; limits the bit rate below `bit_rate`
  static constexpr double kMaxBitsPerPixel = 0.22;
  static constexpr int kMinSize = 64;     // pixels per side
  static constexpr double kSilence = 5;   // seconds without a packet until a viewer is removed
  static constexpr double kConnect = 15;  // seconds from the offer within which a viewer must connect
  // Accepted rate of wrong tokens per address and second.
  static constexpr double kWrongTokens = 0.2, kWrongTokensAtOnce = 10;
};

inline int best_bit_rate(int width, int height, const Limits& limits) {
  const double most = Limits::kMaxBitsPerPixel * width * height * limits.framerate;
  return static_cast<int>(std::min<double>(limits.bit_rate, std::max(most, 300000.0)));
}

// A camera path that viewers can watch.
struct CameraPath {
  std::string file;  // views.json
  int width, height;
};

// The view that a browser requests in the URL of its offer.
struct ViewParams {
  int width = 640, height = 480;  // per eye, pixels; the size of the views of `path`, if there is one
  double eye_distance = 0;        // distance between the eyes, metres; 0: a single eye
  std::string path;               // camera path (views.json) to play; may be empty
  int views() const { return eye_distance > 0 ? 2 : 1; }
  // Viewers of the same path share one video. Only a stereo viewer has a separate one, because of its eye distance.
  bool is_shared() const { return !path.empty() && eye_distance == 0; }
};

// Parses the distance between the eyes in metres. An empty or null text means 0, a single eye. Returns std::nullopt if
// the text is invalid.
inline std::optional<double> eye_distance(const char* text) {
  if (!text || !*text) return 0;
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (*end || !(value >= 0) || value > 1e6) return std::nullopt;
  return value;
}

struct ViewSize {
  int width = 640, height = 480;
};
// Parses the requested size of a view in pixels, and scales it to the limits. The aspect ratio is kept, and both sides
// become even and at least kMinSize. Empty or null texts mean the defaults of ViewSize. Returns std::nullopt if a text
// is invalid.
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

// A rate limit that allows short bursts (a token bucket). It receives `per_second` tokens per second, up to `burst`
// tokens, and each action takes one token. Times are g_get_monotonic_time(), microseconds, and must not decrease. Not
// thread-safe.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) : per_second_(per_second), burst_(burst), tokens_(burst) {}

  // Takes `count` tokens. If there are fewer, takes none and returns false.
  bool take(int64_t now, double count = 1);
  // Changes the limits. Existing tokens remain, up to the new burst.
  void set_rate(double per_second, double burst, int64_t now);
  bool full(int64_t now);

 private:
  void fill(int64_t now);

  double per_second_, burst_, tokens_;
  int64_t filled_ = 0;
};

// A separate rate limit for each address, for the latest kMaxAddresses addresses. A new address replaces the least
// recently used one, so a flood from many addresses never limits other addresses. Not thread-safe.
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

// Decides which viewers may watch if there are more viewers than the server can serve. A seat is the right to one view;
// a stereo viewer takes two seats. Each address has a maximum number of views. If no seat is free, viewers get a ticket
// for a place in a queue, and must present the ticket repeatedly to keep this place.
//
// A client that never connects must not keep others out. Viewers that have not connected yet therefore share at most a
// quarter of all seats. If a new viewer would exceed this quarter, a viewer that has not connected after
// kConnectTimeout loses its seats. If there is none, a viewer of the address with the most unconnected views does.
//
// The class reads no clock, so that it can be tested: all times are arguments, in microseconds as from
// g_get_monotonic_time(). Not thread-safe.
class AdmissionControl {
 public:
  // microseconds until an unconnected viewer may lose its seats
  static constexpr int64_t kConnectTimeout = 2000000;
  // microseconds until a ticket expires if it is not presented
  static constexpr int64_t kTicketTimeout = 3000000;
  static constexpr size_t kMaxQueued = 64;

  AdmissionControl(int seats, int of_address);

  struct Answer {
    enum Verdict { kAdmitted, kAddress, kFull } verdict = kFull;
    std::vector<std::string> leave;  // sessions that lose their seats and must be closed at once (kAdmitted)
    std::string ticket;              // ticket in the queue, or empty if the queue is full, too (kFull)
    size_t place = 0;
  };
  // Requests seats for `views` views of `address`, or a place in the queue. `ticket` is the ticket from the previous
  // answer, or empty. `new_ticket` is an unguessable text that becomes the ticket if one is needed.
  Answer ask(const std::string& address, int views, const std::string& ticket, const std::string& new_ticket,
             int64_t now);
  // Takes the seats for a session. Call this after ask() has returned kAdmitted and the sessions in `leave` are closed.
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
