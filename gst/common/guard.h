// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <exception>
#include <type_traits>

#include <gst/gst.h>

// No C++ exception gets into GStreamer's C, which has nothing to stop it: whatever C calls and may throw is called by
// way of lf::callback<>, and becomes an error that is posted, and the answer for "it did not work".
namespace lf {

// Locks an object, until it goes out of scope if not before, whatever is thrown.
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

// Posts an error that says what was thrown, from an element, or from the parent of a pad. To be called in a handler.
void post_current_exception(gpointer object);

// Posts a warning that says what was thrown, at most one a second from each element: only what was being made is lost.
// To be called in a handler.
void warn_of_current_exception(gpointer object);

// What f() returns, which handles one buffer of a stream; if it throws the stream goes on without that.
template <typename F>
GstFlowReturn guarded_buffer(gpointer object, F f) {
  try {
    return f();
  } catch (...) {
    warn_of_current_exception(object);
    return GST_FLOW_OK;
  }
}

// What f() returns, or `failed` with an error posted if it throws.
template <typename T, typename F>
T guarded(gpointer object, T failed, F f) {
  try {
    return f();
  } catch (...) {
    post_current_exception(object);
    return failed;
  }
}

// What a callback returns that did not work.
template <typename T>
constexpr T failed_result = {};  // FALSE, none, null
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

// The function `f` of a GObject, as a virtual function, a pad's function or probe, or a signal's handler.
template <auto f>
inline constexpr auto callback = &Callback<f>::call;

}  // namespace lf
