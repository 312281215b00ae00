// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/schedule.h"
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

}  // namespace lf
