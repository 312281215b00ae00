// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>

#include <gst/base/gstaggregator.h>

#include "gst/gst_test.h"

namespace lf::test {

// A GstAggregator for the parts of lfcompositor that work in one. What its base class asks of it goes to the functions
// that are set.
struct Hooks {
  std::function<void()> aggregate = [] {};  // every pad has a buffer, which is dropped then
  std::function<void()> negotiate = [] {};
  std::function<GstFlowReturn(GstCaps* downstream, GstCaps** caps)> update_caps;
  std::function<bool(GstCaps* caps)> negotiated;
  std::function<bool(GstQuery* query)> allocation;
};

// Owned by the caller, floating. `hooks` must outlive it.
GstElement* new_hooked_aggregator(Hooks* hooks);

}  // namespace lf::test
