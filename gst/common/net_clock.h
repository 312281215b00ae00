// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <string>

namespace lf {

// The clock of a pipeline on another machine, followed or given (GstNetClientClock, GstNetTimeProvider), as properties
// of an element that plain gst-launch-1.0 takes its clock from. Thread-safe.
class NetClock {
 public:
  enum Property { kAddress, kPort, kNumProperties };
  // As properties first_id, first_id + 1, ... of the class.
  static void install(GObjectClass* klass, guint first_id);
  void set(Property property, const GValue* value);
  void get(Property property, GValue* value);

  ~NetClock() { stop(); }
  // Call around the parent class's change_state. before() is false after posting the reason on the bus.
  bool before(GstElement* element, GstStateChange transition);
  void after(GstElement* element, GstStateChange transition);
  // For the element's provide_clock: the clock followed, with a reference; null where none is.
  GstClock* provide();

 private:
  bool follow(GstElement* element);
  bool serve(GstElement* element);
  void stop();

  std::mutex mutex_;
  std::string address_;
  gint port_ = 0;
  GstClock* followed_ = nullptr;
  GstObject* server_ = nullptr;
};

}  // namespace lf
