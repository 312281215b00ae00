// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include <gst/gst.h>

namespace lf {

// What QoS events say: which requests' pictures would come too late to be shown. Such an event is of one view, which
// lfcompositor writes into it: nodes answer several. Thread-safe.
class QosWatch {
 public:
  // The view that a QoS event names.
  static std::optional<uint32_t> view_of(GstEvent* event);
  // Writes the name of a view into the event, or into a copy where others have the event, too. Takes and gives a
  // reference.
  static GstEvent* name_view(GstEvent* event, uint32_t view_id);

  struct Late {
    GstClockTimeDiff jitter;  // nanoseconds by which pictures are late
    gdouble proportion;       // time that frames take over time there is
  };
  // Takes note of a QoS event that names its view. `live`: it comes no sooner if some are left out.
  void see(GstEvent* event, bool live);
  // Whether what is to be shown at this running time comes too late.
  std::optional<Late> late(uint32_t view_id, GstClockTime running_time) const;
  void clear();

 private:
  struct View {
    GstClockTime earliest;  // running time
    gdouble proportion;
  };
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
};

}  // namespace lf
