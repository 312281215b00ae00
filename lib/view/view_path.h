// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/schedule.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

struct NamedView {
  std::string name;  // unique in its file; default: "view_00", "view_01", ...
  double time = 0;   // seconds
  View view;
};

// Read views.json ("format": "lightfield-views", "version": 1), a camera path. Throw Error with file and place if the
// file is invalid, has no views, or a time decreases.
std::vector<NamedView> load_views(const std::string& path);
std::vector<NamedView> parse_views(const std::string& text, const std::string& name);
// Writes model + params and focal_plane, so that saving a loaded path is lossless.
void save_views(const std::vector<NamedView>& views, const std::string& path);
std::string views_to_json(const std::vector<NamedView>& views);

// A views file as a stream: presentation time and requested capture time of each view, in nanoseconds of running time.
//
// A path has views with different times and is presented at these times. If all views have the same time, the file is a
// list: one view per period, each with the capture time from the file. When looped, a path restarts one last interval
// after its end (a list after one period), and times continue to increase. Thread-safe, except set_schedule().
class ViewPlayback {
 public:
  struct Item {
    const View* view;  // owned by the ViewPlayback
    uint64_t time, duration, target_time;
  };

  // Requires at least one view and non-decreasing times in [0, 1e9] s, as load_views() returns.
  ViewPlayback(std::vector<NamedView> views, const Schedule& schedule, bool loop);

  // Returns the n-th view; nothing after the end.
  std::optional<Item> item(uint64_t n) const;
  bool has_times() const { return has_times_; }
  // Changes the period of a list, and with it the times of all views.
  void set_schedule(const Schedule& schedule) { schedule_ = schedule; }
  uint64_t duration() const;                       // nanoseconds of one pass through the file
  uint64_t first_at(uint64_t running_time) const;  // smallest n of the first pass with item(n).time >= running_time

 private:
  std::vector<NamedView> views_;
  Schedule schedule_;
  bool loop_, has_times_;
};

// A request: timestamp (running time), duration and capture time, nanoseconds. `view` is null unless it is from a file.
struct RequestSlot {
  uint64_t pts, duration;
  uint64_t target_time;
  const View* view = nullptr;
};

// Schedule of the requests of a viewer. Times in nanoseconds. Not thread-safe.
class RequestSchedule {
 public:
  explicit RequestSchedule(const Schedule& schedule) : schedule_(schedule) {}
  RequestSchedule(const Schedule& schedule, std::vector<NamedView> views, bool loop)
      : schedule_(schedule), playback_(std::in_place, std::move(views), schedule, loop), loop_(loop) {}

  bool from_file() const { return playback_.has_value(); }
  std::optional<uint64_t> end() const;  // running time of the end; nothing: endless

  void seek(uint64_t running_time);  // continues with the request of this running time; not for live schedules
  // Returns the next request; nothing after the end.
  std::optional<RequestSlot> next() const;
  // Returns the next request of a live stream at clock time `now`. Its timestamp is the running time of its capture. It
  // must be sent `capture_delay` later, at clock time base_time + pts + capture_delay.
  std::optional<RequestSlot> next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // Returns the request of a next_live() slot for sending early, at clock time `now`, with the newest capture that is
  // old enough. That capture was requested before, so the timestamp is the latest time with an old enough capture.
  RequestSlot early_request(const RequestSlot& slot, uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // Changes the frame rate from the next request on. Returns false and changes nothing if a list of views without times
  // has begun, because its timestamps are derived from view numbers.
  bool set_rate(const Schedule& schedule);
  void advance(const RequestSlot& slot);
  // turn() is the number of the next slot. pass() skips that slot without a request, if it is still the next slot.
  uint64_t turn() const { return index_; }
  void pass(uint64_t turn) { index_ += index_ == turn; }

 private:
  Schedule schedule_;
  std::optional<ViewPlayback> playback_;
  bool loop_ = false;
  uint64_t index_ = 0;  // number of the next view of the file, or of the next frame
  std::optional<uint64_t> last_pts_;
};

// A smooth camera path through key views. Between keys, it follows cubic Hermite curves with velocity (next - previous)
// / (difference of their times) at each key (Catmull-Rom with times), so velocity is continuous. Orientations follow
// the same curve through sign-aligned quaternions, normalised. If all focal planes face their views, the logarithm of
// the focus distance is interpolated and the plane keeps facing the view; otherwise the plane coefficients [a, b, c, d]
// are interpolated. Lens parameters are interpolated like positions. Immutable; thread-safe.
class ViewPath {
 public:
  // Requires at least one key, strictly increasing times, and one size and lens model for all keys. Throws Error naming
  // the key.
  explicit ViewPath(std::vector<NamedView> keys);

  double begin() const { return keys_.front().time; }  // seconds
  double end() const { return keys_.back().time; }
  // Returns the view at a time in seconds: the first key before begin(), the last key after end().
  View at(double time) const;
  // Returns views at begin(), begin() + 1/rate, ... up to and including end() (to a thousandth of a period), named
  // "view_000000", ...
  std::vector<NamedView> sample(double rate_hz) const;

 private:
  std::vector<NamedView> keys_;
  bool planes_face_ = true;
};

// Focus distances, metres from the middle of the array along its mean axis; 0 < near <= far.
struct FocusRange {
  double near = 0, far = 0;
};

struct TourOptions {
  int width = 0, height = 0;  // pixels; 0: size of the middle camera
  int frames = 1;             // at least 1
  double rate_hz = 15;        // views per second
  bool still = false;         // all views at time 0, for a static scene
  double room = 0;            // metres between the outermost eyes of view sets that will follow the path
};

// Returns the view focused on `planes` planes that face the view, from the nearest to the farthest. Distances from the
// eye are uniform in inverse distance, so that the shift of objects out of focus changes by equal steps. Views are
// named "view_000000", ... and have time 0. A single plane is the nearest. Throws Error if the range is invalid or
// planes < 1.
std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes);

// Returns a smooth closed path that demonstrates an array: from its middle to both sides, forward and back, as far as
// the array covers the whole view. The focus moves from near at the start to far at half-way, and back. Views look
// along the mean camera axis and are slightly narrower than a camera. TourOptions::room reduces the movement, so that
// all eyes of a set of views are covered. Requires at least one camera; throws Error if an option is out of range.
std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options);

}  // namespace lf
