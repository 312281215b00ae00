// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_states.h"

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "common/guard.h"

namespace lf {
namespace {

bool is_decoder(GstElement* child) { return gst_element_is_locked_state(child); }

// Time limit for a child to stop. rtspsrc waits for a server that answers slowly or without end. Cameras stop one after
// another, so after one timeout the limit is shorter for a while.
constexpr std::chrono::milliseconds kPatience{2000}, kLessPatience{200};
constexpr std::chrono::seconds kMoment{20};

std::chrono::milliseconds patience(bool was_late) {
  static std::mutex mutex;
  static std::chrono::steady_clock::time_point late_until;
  const std::lock_guard lock(mutex);
  const auto now = std::chrono::steady_clock::now();
  const auto result = now < late_until ? kLessPatience : kPatience;
  if (was_late) late_until = now + kMoment;
  return result;
}

// Stops a child. On timeout the child is removed from the bin, and a thread that keeps both alive finishes stopping it.
GstStateChangeReturn stop_child(GstBin* bin, GstElement* child, GstState state) {
  struct Stop {
    std::mutex mutex;
    std::condition_variable done;
    std::optional<GstStateChangeReturn> result;
    bool is_late = false;  // the caller has given up waiting
  };
  const auto stop = std::make_shared<Stop>();
  std::thread([stop, state, camera = gst_object_ref(bin), element = GST_ELEMENT(gst_object_ref(child))] {
    const GstStateChangeReturn result = gst_element_set_state(element, state);
    std::unique_lock lock(stop->mutex);
    if (!stop->is_late) {
      gst_object_unref(element);
      gst_object_unref(camera);  // the caller has another reference
      stop->result = result;
      stop->done.notify_all();
      return;
    }
    lock.unlock();
    gst_element_set_state(element, GST_STATE_NULL);
    gst_object_unref(element);
    gst_object_unref(camera);
  }).detach();
  std::unique_lock lock(stop->mutex);
  if (stop->done.wait_for(lock, patience(false), [&] { return stop->result.has_value(); })) return *stop->result;
  stop->is_late = true;
  lock.unlock();
  patience(true);
  g_signal_handlers_destroy(child);  // new pads must not be linked
  gst_bin_remove(bin, child);
  return GST_STATE_CHANGE_SUCCESS;
}

// Sets all children, or only decoders, to `state`. FAILURE where one fails, else NO_PREROLL where one has none.
GstStateChangeReturn set_states(GstBin* bin, GstState state, bool only_decoders) {
  std::vector<GstElement*> children;
  ObjectLock lock(bin);
  for (GList* child = bin->children; child; child = child->next)
    children.push_back(GST_ELEMENT(gst_object_ref(child->data)));
  lock.unlock();
  GstStateChangeReturn result = GST_STATE_CHANGE_SUCCESS;
  for (GstElement* child : children) {
    if (!only_decoders || is_decoder(child)) {
      gst_element_set_base_time(child, gst_element_get_base_time(GST_ELEMENT(bin)));
      gst_element_set_start_time(child, gst_element_get_start_time(GST_ELEMENT(bin)));
      const bool stops = is_decoder(child) && state < GST_STATE(child) && state <= GST_STATE_READY;
      const GstStateChangeReturn one = stops ? stop_child(bin, child, state) : gst_element_set_state(child, state);
      if (result != GST_STATE_CHANGE_FAILURE && one != GST_STATE_CHANGE_ASYNC && one != GST_STATE_CHANGE_SUCCESS)
        result = one;
    }
    gst_object_unref(child);
  }
  return result;
}

// A decoder has come to PAUSED: on to PLAYING, if that is where its camera is.
void continue_decoder(GstElement* camera, gpointer decoder) {
  GST_STATE_LOCK(camera);
  if (GST_STATE_TARGET(camera) == GST_STATE_PLAYING && GST_STATE(camera) >= GST_STATE_PAUSED &&
      gst_object_has_as_parent(GST_OBJECT(decoder), GST_OBJECT(camera)))
    gst_element_set_state(GST_ELEMENT(decoder), GST_STATE_PLAYING);
  GST_STATE_UNLOCK(camera);
}

}  // namespace

void remove_child(GstBin* bin, GstElement* child) {
  if (is_decoder(child))
    stop_child(bin, child, GST_STATE_NULL);
  else
    gst_element_set_state(child, GST_STATE_NULL);
  if (gst_object_has_as_parent(GST_OBJECT(child), GST_OBJECT(bin))) gst_bin_remove(bin, child);
}

void lock_decoder(GstBin* /*bin*/, GstElement* child) {
  if (GST_IS_BIN(child)) gst_element_set_locked_state(child, TRUE);
}

GstStateChangeReturn change_camera_state(GstBin* bin, GstStateChange transition,
                                         GstStateChangeReturn (*chain_up)(GstElement*, GstStateChange)) {
  const GstState next = GST_STATE_TRANSITION_NEXT(transition);
  // Who takes starts first. All else decoders do before GstBin does it with the others.
  const bool decoders_last = next <= GST_STATE_PAUSED && GST_STATE_TRANSITION_CURRENT(transition) < next;
  if (!decoders_last) set_states(bin, next, true);
  GstStateChangeReturn result = chain_up(GST_ELEMENT(bin), transition);
  // GstBin repeats what locked children said the last time. None but they come to a state by and by.
  if (result == GST_STATE_CHANGE_ASYNC) result = GST_STATE_CHANGE_SUCCESS;
  if (!decoders_last || result == GST_STATE_CHANGE_FAILURE) return result;
  const GstStateChangeReturn decoders = set_states(bin, next, true);
  return decoders == GST_STATE_CHANGE_SUCCESS ? result : decoders;
}

GstStateChangeReturn pause_new_children(GstBin* bin) { return set_states(bin, GST_STATE_PAUSED, false); }

GstStateChangeReturn play_new_children(GstBin* bin) { return set_states(bin, GST_STATE_PLAYING, false); }

bool take_decoder_message(GstBin* bin, GstMessage* message) {
  const GstMessageType type = GST_MESSAGE_TYPE(message);
  if (type != GST_MESSAGE_ASYNC_START && type != GST_MESSAGE_ASYNC_DONE) return false;
  if (type == GST_MESSAGE_ASYNC_DONE && GST_IS_ELEMENT(GST_MESSAGE_SRC(message)))
    gst_element_call_async(GST_ELEMENT(bin), callback<continue_decoder>, gst_object_ref(GST_MESSAGE_SRC(message)),
                           gst_object_unref);
  gst_message_unref(message);
  return true;
}

}  // namespace lf
