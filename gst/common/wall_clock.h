// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Hosts exchange capture times as time of day, which chrony or PTP synchronises. A pipeline on the realtime clock would
// stall if that clock is set back. Therefore pipelines run on a clock that starts at the time of day and never jumps.
// Times are converted when they enter or leave the host.
//
// Returns a new clock that the caller owns.
GstClock* new_wall_clock();

// Returns time of day minus clock time, nanoseconds. 0 until the system clock is set, and for all other clocks. Changes
// below a millisecond are ignored.
GstClockTimeDiff wall_offset(GstClock* clock);
// Returns the offset of the element's clock; 0 without a clock. The first element that detects a step posts a warning.
GstClockTimeDiff wall_offset(GstElement* element);

}  // namespace lf
