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
  std::string name;  // unique in its file; "view_00", "view_01", ... where the file has none
  double time = 0;   // seconds
  View view;
};

// views.json ("format": "lightfield-views", "version": 1): a camera path. Throws Error naming file and place; a file
// with no views is an error, and so is a time that decreases.
std::vector<NamedView> load_views(const std::string& path);
std::vector<NamedView> parse_views(const std::string& text, const std::string& name);
// Writes model + params and focal_plane, so that a loaded path is saved to the last bit.
void save_views(const std::vector<NamedView>& views, const std::string& path);
std::string views_to_json(const std::vector<NamedView>& views);

// A views file as a stream: when each view is shown and which capture time it asks for, in nanoseconds of running time.
//
// A path whose views have times is shown at these times. Where all views have one time (or there is only one view) the
// file is a list, shown one view per period; every view still asks for the time in the file. Looped, a path begins
// again one last interval after its end (a list one period after), and times go on growing. Thread-safe, except
// set_schedule().
class ViewPlayback {
 public:
  struct Item {
    const View* view;  // owned by the ViewPlayback
    uint64_t time, duration, target_time;
  };

  // Takes at least one view; times are in [0, 1e9] s and do not decrease, as load_views() gives them.
  ViewPlayback(std::vector<NamedView> views, const Schedule& schedule, bool loop);

  // The n-th view to show; nothing after the end.
  std::optional<Item> item(uint64_t n) const;
  bool has_times() const { return has_times_; }
  // Changes the period of a list, and so the times of all its views.
  void set_schedule(const Schedule& schedule) { schedule_ = schedule; }
  uint64_t duration() const;                       // nanoseconds that one pass through the file takes
  uint64_t first_at(uint64_t running_time) const;  // the smallest n of the first pass with item(n).time >= running_time

 private:
  std::vector<NamedView> views_;
  Schedule schedule_;
  bool loop_, has_times_;
};

// The running time that a request is stamped with, how long it stands and what it asks for, nanoseconds. `view` is null
// where it is not from a file.
struct RequestSlot {
  uint64_t pts, duration;
  uint64_t target_time;
  const View* view = nullptr;
};

// Says which request of a viewer is next. Times in nanoseconds. Not thread-safe.
class RequestSchedule {
 public:
  // A request each frame, for ever.
  explicit RequestSchedule(const Schedule& schedule) : schedule_(schedule) {}
  // A request for each view of a file.
  RequestSchedule(const Schedule& schedule, std::vector<NamedView> views, bool loop)
      : schedule_(schedule), playback_(std::in_place, std::move(views), schedule, loop), loop_(loop) {}

  bool from_file() const { return playback_.has_value(); }
  std::optional<uint64_t> end() const;  // running time at which the requests end; nothing: never

  void seek(uint64_t running_time);  // goes on with the request of this running time; for schedules that are not live
  // The next request; nothing after the end.
  std::optional<RequestSlot> next() const;
  // The next request of a live stream at clock time `now`. It is stamped with the running time of its capture and
  // leaves `capture_delay` later, at clock time base_time + pts + capture_delay.
  std::optional<RequestSlot> next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // The request of a slot of next_live() that leaves at clock time `now`, before its turn, for the newest capture that
  // is old enough. As that capture has been asked for before, the request is stamped with the time that would be just
  // old enough.
  RequestSlot ahead_of_turn(const RequestSlot& slot, uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // From the next request on, this many frames per second. False, and nothing changes, once a list of views without
  // times has begun: its views are stamped by their number.
  bool set_rate(const Schedule& schedule);
  // The slot is used: on to the next one.
  void advance(const RequestSlot& slot);
  // turn() is the number of the next slot; pass() goes on to the one after it without a request, if that slot is still
  // next.
  uint64_t turn() const { return index_; }
  void pass(uint64_t turn) { index_ += index_ == turn; }

 private:
  Schedule schedule_;
  std::optional<ViewPlayback> playback_;
  bool loop_ = false;
  uint64_t index_ = 0;  // number of the next view of the file, or of the next frame
  std::optional<uint64_t> last_pts_;
};

// A smooth camera path through key views: at each key's time it is at that key, in between it moves along cubic Hermite
// curves whose velocity at a key is (next - previous) / (their times' difference) (Catmull-Rom with times), so velocity
// is continuous everywhere. Orientations: the same curve through sign-aligned quaternions, normalised. Where every
// key's focal plane faces its view, the logarithm of its distance moves so and the plane keeps facing; otherwise the
// planes' [a, b, c, d] do. The lens' numbers move like the position. Immutable; thread-safe.
class ViewPath {
 public:
  // Takes at least one key; times strictly increase, and all have one size and one lens model. Throws Error naming the
  // key.
  explicit ViewPath(std::vector<NamedView> keys);

  double begin() const { return keys_.front().time; }  // seconds
  double end() const { return keys_.back().time; }
  // The view at a time in seconds: before begin() the first key, after end() the last.
  View at(double time) const;
  // Views at begin(), begin() + 1/rate, ... up to and including end() (to a thousandth of a period), named
  // "view_000000", ...
  std::vector<NamedView> sample(double rate_hz) const;

 private:
  std::vector<NamedView> keys_;
  bool planes_face_ = true;
};

// Depths to focus on, metres from the middle of the array along the mean of its axes; 0 < near <= far.
struct FocusRange {
  double near = 0, far = 0;
};

struct TourOptions {
  int width = 0, height = 0;  // pixels of the views; 0: those of the middle camera
  int frames = 1;             // views of the path, at least 1
  double rate_hz = 15;        // views per second
  bool still = false;         // all views at time 0, for a scene that stands still
  double room = 0;            // metres between the outermost eyes of sets of views that will fly it
};

// The view focused on one plane after the other, from the nearest to the farthest: `planes` of them that face it, even
// in inverse distance, so that what is out of focus moves by the same from each to the next. Distances are from the
// eye. Views are named "view_000000", ... All are at time 0. Throws Error for a range that is none and less than one
// plane; one plane is the nearest.
std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes);

// A smooth closed path that shows what an array can do: from its middle to both sides, forward and back, as far as the
// array still covers the whole view, while the focus moves from near to far and back. It begins at the middle with the
// near focus and reaches the far one half-way. Views look along the mean of the cameras' axes and are a little narrower
// than a camera. Where sets of views are to have room for their eyes it goes less far. Requires at least one camera;
// throws Error if the options are out of range.
std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options);

}  // namespace lf
