// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/wall_clock.h"

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <utility>

#include "base/text.h"

namespace lf {
namespace {

constexpr GstClockTimeDiff kIgnored = GST_MSECOND;               // smaller steps are ignored
constexpr GstClockTimeDiff kMinReportedStep = 20 * GST_MSECOND;
constexpr GstClockTimeDiff kSure = GST_MSECOND / 10;             // maximum time between two readings

GstClockTimeDiff time_of_day() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<GstClockTimeDiff>(GST_TIMESPEC_TO_TIME(now));
}

struct WallClock {
  std::mutex mutex;
  GstClockTimeDiff offset = 0;
  GstClockTimeDiff unreported = 0;
};

GQuark quark() {
  static const GQuark quark = g_quark_from_static_string("lightfield-wall-clock");
  return quark;
}

WallClock* state_of(GstClock* clock) { return static_cast<WallClock*>(g_object_get_qdata(G_OBJECT(clock), quark())); }

void follow(GstClock* clock, WallClock& state) {
  const auto before = static_cast<GstClockTimeDiff>(gst_clock_get_time(clock));
  const GstClockTimeDiff day = time_of_day();
  const auto after = static_cast<GstClockTimeDiff>(gst_clock_get_time(clock));
  const GstClockTimeDiff offset = day - (before + (after - before) / 2), step = offset - state.offset;
  // Ignores a step that may only be an interruption between the readings.
  if (std::abs(step) <= kIgnored || after - before > std::max(kSure, std::abs(step) / 4)) return;
  state.offset = offset;
  state.unreported += step;
}

}  // namespace

GstClock* new_wall_clock() {
  gpointer object = g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_MONOTONIC, nullptr);
  GstClock* clock = GST_CLOCK(gst_object_ref_sink(object));
  g_object_set_qdata_full(G_OBJECT(clock), quark(), new WallClock,
                          [](gpointer state) { delete static_cast<WallClock*>(state); });
  for (int tries = 0; tries < 20; tries++) {
    const GstClockTime before = gst_clock_get_internal_time(clock);
    const GstClockTimeDiff day = time_of_day();
    const GstClockTime between = gst_clock_get_internal_time(clock) - before;
    gst_clock_set_calibration(clock, before + between / 2, static_cast<GstClockTime>(day), 1, 1);
    if (static_cast<GstClockTimeDiff>(between) <= kSure) break;
  }
  return clock;
}

GstClockTimeDiff wall_offset(GstClock* clock) {
  WallClock* state = state_of(clock);
  if (!state) return 0;
  const std::lock_guard lock(state->mutex);
  follow(clock, *state);
  return state->offset;
}

GstClockTimeDiff wall_offset(GstElement* element) {
  g_autoptr(GstClock) clock = gst_element_get_clock(element);
  if (!clock) return 0;
  const GstClockTimeDiff offset = wall_offset(clock);
  WallClock* state = state_of(clock);
  if (!state) return offset;
  GstClockTimeDiff step = 0;
  if (const std::lock_guard lock(state->mutex); std::abs(state->unreported) >= kMinReportedStep)
    step = std::exchange(state->unreported, 0);
  if (step != 0)
    GST_ELEMENT_WARNING(
        element, CORE, CLOCK,
        ("The clock of this machine was set %s by %s s. Live pictures continue with the new time.",
         step < 0 ? "back" : "forward", format_text("%.3f", static_cast<double>(std::abs(step)) / GST_SECOND).c_str()),
        (nullptr));
  return offset;
}

}  // namespace lf
