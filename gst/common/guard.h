// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <exception>
#include <type_traits>
#include <utility>

#include <gst/gst.h>

// Converts C++ exceptions to GStreamer errors. GStreamer is written in C, so an exception must not leave a function
// that GStreamer calls. Wrap each such function that may throw in lf::callback<>, for example `klass->change_state =
// callback<change_state>`. If the function throws, the wrapper posts an error message and returns a failure value, such
// as GST_FLOW_ERROR.
namespace lf {

// Holds the object lock of a GstObject until unlock() or the end of the scope.
class ObjectLock {
 public:
  explicit ObjectLock(gpointer object) : object_(GST_OBJECT(object)) { GST_OBJECT_LOCK(object_); }
  ~ObjectLock() { unlock(); }
  ObjectLock(const ObjectLock&) = delete;
  ObjectLock& operator=(const ObjectLock&) = delete;
  void unlock() {
    if (object_) GST_OBJECT_UNLOCK(object_);
    object_ = nullptr;
  }

 private:
  GstObject* object_;
};

// Posts the current exception as an error message. `object` is the element, or one of its pads. Call this in an
// exception handler.
void post_current_exception(gpointer object);

// Posts the current exception as a warning, at most once per second and element, for failures that lose only one
// buffer. Call this in an exception handler.
void warn_of_current_exception(gpointer object);

template <typename F>
GstFlowReturn guard_buffer(gpointer object, F f) {
  try {
    return f();
  } catch (...) {
    warn_of_current_exception(object);
    return GST_FLOW_OK;
  }
}

template <typename T, typename F>
T guarded(gpointer object, T failed, F f) {
  try {
    return f();
  } catch (...) {
    post_current_exception(object);
    return failed;
  }
}

template <typename T>
constexpr T failed_result = {};
template <>
inline constexpr GstFlowReturn failed_result<GstFlowReturn> = GST_FLOW_ERROR;
template <>
inline constexpr GstStateChangeReturn failed_result<GstStateChangeReturn> = GST_STATE_CHANGE_FAILURE;
template <>
inline constexpr GstPadProbeReturn failed_result<GstPadProbeReturn> = GST_PAD_PROBE_DROP;
template <>
inline constexpr GstClockTime failed_result<GstClockTime> = GST_CLOCK_TIME_NONE;

template <auto f>
struct Callback;
template <typename Result, typename Object, typename... Rest, Result (*f)(Object*, Rest...)>
struct Callback<f> {
  static Result call(Object* object, Rest... rest) {
    try {
      return f(object, rest...);
    } catch (...) {
      post_current_exception(object);
    }
    if constexpr (!std::is_void_v<Result>) return failed_result<Result>;
  }
};

// Wraps `f` as a virtual function, pad function, probe or signal handler of a GObject.
template <auto f>
inline constexpr auto callback = &Callback<f>::call;

// Calls f() in another thread, with a reference to the element.
template <typename F>
void call_async(GstElement* element, F f) {
  gst_element_call_async(
      element, [](GstElement* on, gpointer data) { guarded(on, 0, [=] { return (*static_cast<F*>(data))(), 0; }); },
      new F(std::move(f)), [](gpointer data) { delete static_cast<F*>(data); });
}

// Adds a probe that calls f(pad, info), which returns a GstPadProbeReturn. Returns the id of the probe.
template <typename F>
gulong add_probe(GstPad* pad, int type, F f) {
  return gst_pad_add_probe(
      pad, static_cast<GstPadProbeType>(type),
      [](GstPad* at, GstPadProbeInfo* info, gpointer data) {
        return guarded(at, GST_PAD_PROBE_DROP, [=] { return (*static_cast<F*>(data))(at, info); });
      },
      new F(std::move(f)), [](gpointer data) { delete static_cast<F*>(data); });
}

}  // namespace lf
