// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/day_clock.h"

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <utility>

#include "base/text.h"

namespace lf {
namespace {

constexpr GstClockTimeDiff kIgnored = GST_MSECOND;    // steps that are not followed
constexpr GstClockTimeDiff kTold = 20 * GST_MSECOND;  // steps that a person is told of
constexpr GstClockTimeDiff kSure = GST_MSECOND / 10;  // two readings of one clock, with the other in between

GstClockTimeDiff time_of_day() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<GstClockTimeDiff>(GST_TIMESPEC_TO_TIME(now));
}

struct DayClock {
  std::mutex mutex;
  GstClockTimeDiff offset = 0;
  GstClockTimeDiff untold = 0;  // steps that nobody has been told of
};

GQuark quark() {
  static const GQuark quark = g_quark_from_static_string("lightfield-day-clock");
  return quark;
}

DayClock* state_of(GstClock* clock) { return static_cast<DayClock*>(g_object_get_qdata(G_OBJECT(clock), quark())); }

void follow(GstClock* clock, DayClock& state) {
  const auto before = static_cast<GstClockTimeDiff>(gst_clock_get_time(clock));
  const GstClockTimeDiff day = time_of_day();
  const auto after = static_cast<GstClockTimeDiff>(gst_clock_get_time(clock));
  const GstClockTimeDiff offset = day - (before + (after - before) / 2), step = offset - state.offset;
  // A thread that was interrupted between the readings sees a step where there is none.
  if (std::abs(step) <= kIgnored || after - before > std::max(kSure, std::abs(step) / 4)) return;
  state.offset = offset;
  state.untold += step;
}

}  // namespace

GstClock* new_day_clock() {
  gpointer object = g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_MONOTONIC, nullptr);
  GstClock* clock = GST_CLOCK(gst_object_ref_sink(object));
  g_object_set_qdata_full(G_OBJECT(clock), quark(), new DayClock,
                          [](gpointer state) { delete static_cast<DayClock*>(state); });
  for (int tries = 0; tries < 20; tries++) {
    const GstClockTime before = gst_clock_get_internal_time(clock);
    const GstClockTimeDiff day = time_of_day();
    const GstClockTime between = gst_clock_get_internal_time(clock) - before;
    gst_clock_set_calibration(clock, before + between / 2, static_cast<GstClockTime>(day), 1, 1);
    if (static_cast<GstClockTimeDiff>(between) <= kSure) break;
  }
  return clock;
}

GstClockTimeDiff day_offset(GstClock* clock) {
  DayClock* state = state_of(clock);
  if (!state) return 0;
  const std::lock_guard lock(state->mutex);
  follow(clock, *state);
  return state->offset;
}

GstClockTimeDiff day_offset(GstElement* element) {
  g_autoptr(GstClock) clock = gst_element_get_clock(element);
  if (!clock) return 0;
  const GstClockTimeDiff offset = day_offset(clock);
  DayClock* state = state_of(clock);
  if (!state) return offset;
  GstClockTimeDiff step = 0;
  if (const std::lock_guard lock(state->mutex); std::abs(state->untold) >= kTold)
    step = std::exchange(state->untold, 0);
  if (step != 0)
    GST_ELEMENT_WARNING(
        element, CORE, CLOCK,
        ("The clock of this machine was set %s by %s s. Live pictures go on by the new time.",
         step < 0 ? "back" : "forward", format_text("%.3f", static_cast<double>(std::abs(step)) / GST_SECOND).c_str()),
        (nullptr));
  return offset;
}

}  // namespace lf
