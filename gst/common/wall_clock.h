// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// A clock for pipelines that exchange capture times with other hosts. Hosts exchange these times as time of day, which
// chrony or PTP synchronises. However, a pipeline that ran on the realtime clock would stall when that clock is set
// back. Therefore this clock starts at the time of day and never jumps, and times are converted when they enter or
// leave the host.
//
// The caller owns the clock.
GstClock* new_wall_clock();

// Returns the time of day minus the time of `clock`, in nanoseconds. The offset is 0 for a clock from new_wall_clock()
// until the system clock is set to another time, and always 0 for other clocks. Changes below a millisecond are
// ignored.
GstClockTimeDiff wall_offset(GstClock* clock);
// Returns the offset of the element's clock, or 0 without a clock. The first element that notices a step of the system
// clock posts a warning.
GstClockTimeDiff wall_offset(GstElement* element);

}  // namespace lf
