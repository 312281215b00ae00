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

// A bucket that fills with `per_second` tokens, up to `burst`. Times are g_get_monotonic_time(), microseconds, and
// never go back. Without locks.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst) : per_second_(per_second), burst_(burst), tokens_(burst) {}

  // Takes so many tokens; false, and takes nothing, if there are fewer.
  bool take(int64_t now, double count = 1);
  // The tokens that are there stay, up to the new burst.
  void set_rate(double per_second, double burst, int64_t now);
  bool full(int64_t now);

 private:
  void fill(int64_t now);

  double per_second_, burst_, tokens_;
  int64_t filled_ = 0;
};

// A bucket for each of the latest kMaxAddresses addresses. One more takes the place of the address that was not seen
// for the longest time, so that a flood from many addresses never limits an address that took no part in it. Without
// locks.
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
  std::list<std::string> order_;  // addresses, the one seen last at the end
};

// Decides who may watch, and who is next. A seat is a view: who has two eyes takes two. Each address has at most so
// many, and those that have not connected yet have a quarter of all together: where it is used up the address with most
// of it gives, and who has not connected after kPatience gives first. Where there is no seat there is a queue, each
// place with a ticket that is shown again and again. Plain arithmetic without clock or locks; times are
// g_get_monotonic_time(), microseconds.
class Seats {
 public:
  static constexpr int64_t kPatience = 2000000;   // microseconds until one that does not connect holds no seat
  static constexpr int64_t kForgotten = 3000000;  // microseconds until a ticket that is not shown is forgotten
  static constexpr size_t kMostWaiting = 64;

  Seats(int seats, int of_address);

  struct Answer {
    enum Verdict { kSeat, kAddress, kFull } verdict = kFull;
    std::vector<std::string> leave;  // kSeat: the sessions whose seats it gets, to be ended at once
    std::string ticket;              // kFull: "" where the queue is full, too
    size_t place = 0;                // kFull: 1 is next; 0: none
  };
  // Whether `views` of `address` get seats now, or their place in the queue. `ticket`: as it was answered before, or
  // ""; `new_ticket`: one that nobody can guess, given out where it is needed.
  Answer ask(const std::string& address, int views, const std::string& ticket, const std::string& new_ticket,
             int64_t now);
  // Takes the seats. Call after ask() has answered kSeat, and when those who had to leave have. `session`: the viewer's
  // name.
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
  struct Ticket {
    std::string name, address;
    int64_t shown;
  };
  using Held = std::map<std::string, Seat>;  // by the session's name

  template <typename Counts>
  static int sum(const Held& held, const Counts& counts) {
    int views = 0;
    for (const auto& [session, seat] : held) views += counts(seat) ? seat.views : 0;
    return views;
  }
  Held::const_iterator greediest(const Held& held, const std::string& address, int views) const;
  bool make_room(const std::string& address, int views, int ahead, int64_t now, Answer& answer) const;
  void queue_up(const std::string& address, const std::string& new_ticket, int64_t now, Answer& answer);

  const int seats_, of_address_, unconnected_;
  Held held_;
  std::deque<Ticket> queue_;
};

}  // namespace lf::serve
