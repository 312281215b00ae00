// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Hosts agree on capture times by the time of day, which chrony or PTP keeps equal. A pipeline that ran under the
// realtime clock itself would stop when somebody sets that clock back, until it has caught up. So pipelines run under a
// clock that begins as the time of day and goes on steadily, and times are converted where they enter or leave the
// host.
//
// A new one, owned by the caller.
GstClock* new_day_clock();

// Time of day less clock time, nanoseconds: 0 until somebody sets the clock of this machine, and for all other clocks.
// Changes of less than a millisecond are ignored.
GstClockTimeDiff day_offset(GstClock* clock);
// The same of the element's clock; 0 without a clock. The first element that notices a step posts a warning.
GstClockTimeDiff day_offset(GstElement* element);

}  // namespace lf
