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

// Read a views file ("format": "lightfield-views", "version": 1), which holds a camera path. Both functions throw Error
// if the file is invalid or has no views, or if a time decreases. The message has the file name and the place.
std::vector<NamedView> load_views(const std::string& path);
std::vector<NamedView> parse_views(const std::string& text, const std::string& name);
// Writes views with model, params and focal_plane, so that no information of a loaded path is lost.
void save_views(const std::vector<NamedView>& views, const std::string& path);
std::string views_to_json(const std::vector<NamedView>& views);

// Plays a views file: assigns each view a presentation time and the capture time to request. All times are nanoseconds
// of running time.
//
// If the views have different times, the file is a path, and each view is presented at its time. If all views have the
// same time, the file is a list: the views follow each other at the frame rate, and all show the capture time from the
// file. When looped, a path restarts one interval after its end (the interval before its last view), a list after one
// period; times continue to increase. Thread-safe, except for set_schedule().
class ViewPlayback {
 public:
  // A view to play: when to present it, for how long, and the capture time to request, in nanoseconds.
  struct Item {
    const View* view;
    uint64_t time, duration, target_time;
  };

  // Prepares the views of a file for playback. Requires at least one view and non-decreasing times within 0 to 1e9 s,
  // as load_views() guarantees.
  ViewPlayback(std::vector<NamedView> views, const Schedule& schedule, bool loop);

  // Returns the n-th view, or nothing after the end.
  std::optional<Item> item(uint64_t n) const;
  bool has_times() const { return has_times_; }
  // Changes the frame rate of a list, and so the times of all its views.
  void set_schedule(const Schedule& schedule) { schedule_ = schedule; }
  uint64_t duration() const;                       // nanoseconds of one pass through the file
  uint64_t first_at(uint64_t running_time) const;  // smallest n of the first pass with item(n).time >= running_time

 private:
  std::vector<NamedView> views_;
  Schedule schedule_;
  bool loop_, has_times_;
};

// A request that is due for sending: its timestamp (running time), duration and capture time, in nanoseconds. `view` is
// null unless the view comes from a file.
struct RequestSlot {
  uint64_t pts, duration;
  uint64_t target_time;
  const View* view = nullptr;
};

// Decides when a viewer sends requests, and chooses their capture times. All times are nanoseconds. Not thread-safe.
class RequestSchedule {
 public:
  explicit RequestSchedule(const Schedule& schedule) : schedule_(schedule) {}
  RequestSchedule(const Schedule& schedule, std::vector<NamedView> views, bool loop)
      : schedule_(schedule), playback_(std::in_place, std::move(views), schedule, loop), loop_(loop) {}

  bool from_file() const { return playback_.has_value(); }
  std::optional<uint64_t> end() const;  // running time of the end; nothing if there is no end

  void seek(uint64_t running_time);  // continues with the request at this running time; not for live schedules
  // Returns the next request, or nothing after the end.
  std::optional<RequestSlot> next() const;
  // Returns the next request of a live stream, at clock time `now`. Its timestamp `pts` is the running time of the
  // capture that it requests. It must be sent when this capture is `capture_delay` old, at the clock time base_time +
  // pts + capture_delay.
  std::optional<RequestSlot> next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // Returns a request to send at clock time `now`, before the slot from next_live() is due, for example because the
  // user has moved the view. The request shows the newest capture that is at least `capture_delay` old. An earlier
  // request had the same capture, so the timestamp is the latest time with a capture of this age.
  RequestSlot early_request(const RequestSlot& slot, uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // Changes the frame rate from the next request on. Returns false and changes nothing if a list of views has already
  // begun, because the timestamps of a list are computed from the view numbers.
  bool set_rate(const Schedule& schedule);
  void advance(const RequestSlot& slot);
  // turn() returns the number of the next slot. pass(turn) skips this slot without a request. It has no effect if
  // another slot is next by now.
  uint64_t turn() const { return index_; }
  void pass(uint64_t turn) { index_ += index_ == turn; }

 private:
  Schedule schedule_;
  std::optional<ViewPlayback> playback_;
  bool loop_ = false;
  uint64_t index_ = 0;  // number of the next view of the file, or of the next frame
  std::optional<uint64_t> last_pts_;
};

// A smooth camera path through key views. Positions, lens parameters and orientations follow cubic Hermite curves
// (Catmull-Rom with times): the velocity at a key is (next - previous) / (difference of their times), so it is
// continuous. Orientations are interpolated as quaternions, which are first aligned in sign and finally normalised. If
// all focal planes are perpendicular to their optical axes, the logarithm of the focus distance is interpolated and the
// plane stays perpendicular. Otherwise, the coefficients [a, b, c, d] of the plane are interpolated. Immutable and
// thread-safe.
class ViewPath {
 public:
  // Prepares the curve through the keys. Requires at least one key, strictly increasing times, and the same size and
  // lens model for all keys. Otherwise throws Error with the name of the key.
  explicit ViewPath(std::vector<NamedView> keys);

  double begin() const { return keys_.front().time; }  // seconds
  double end() const { return keys_.back().time; }
  // Returns the view at a time in seconds. Before begin(), this is the first key; after end(), the last key.
  View at(double time) const;
  // Returns views at begin(), begin() + 1/rate, ... up to and including end() (to a thousandth of a period). Their
  // names are "view_000000", "view_000001", ...
  std::vector<NamedView> sample(double rate_hz) const;

 private:
  std::vector<NamedView> keys_;
  bool planes_face_ = true;
};

// A range of focus distances, in metres from the middle of the array along its mean axis. 0 < near <= far.
struct FocusRange {
  double near = 0, far = 0;
};

struct TourOptions {
  int width = 0, height = 0;  // pixels; 0: image size of the middle camera
  int frames = 1;             // at least 1
  double rate_hz = 15;
  bool still = false;  // all views have time 0, because the scene is static
  double room = 0;     // width of the row of eyes that will follow the path, in metres, for view sets
};

// Returns a focus sweep: copies of the view that are focused on `planes` planes, from the nearest to the farthest. The
// inverse distances of the planes are uniform, so that the blur of other objects changes by equal steps. The views are
// named "view_000000" and so on, and have time 0. A single plane is at the nearest distance. Throws Error if the range
// is invalid or planes < 1.
std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes);

// Returns a closed path that demonstrates an array. It moves from the middle to both sides, forward and back, as far as
// the cameras cover the whole view. The focus moves from near to far and back. All views look along the mean camera
// axis and are slightly narrower than a camera. If view sets will follow the path, TourOptions::room shortens the
// movement so that the outer eyes are covered as well. Requires at least one camera; throws Error if an option is out
// of range.
std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options);

}  // namespace lf
