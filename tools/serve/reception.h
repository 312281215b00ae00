// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <vector>

#include "packet_loss.h"

namespace lf::serve {

// What a viewer's reports say of what it has received.
struct Reception {
  std::vector<ReceptionReport> reports;
  double round_trip = 0;  // seconds
};

// Reads the reports out of the statistics that webrtcbin's get-stats gives.
Reception read_reception(const GstStructure* stats);

}  // namespace lf::serve
