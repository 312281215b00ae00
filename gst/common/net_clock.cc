// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/net_clock.h"

#include <gst/net/net.h>

namespace lf {
namespace {

constexpr GstClockTime kPatience = 5 * GST_SECOND;  // until the other clock is known well enough

}  // namespace

void NetClock::install(GObjectClass* klass, guint first_id) {
  constexpr auto kFlags = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      klass, first_id + kAddress,
      g_param_spec_string(
          "net-clock-address", "Net clock address",
          "Host whose clock, given at net-clock-port, the pipeline is to follow; for trying things out: "
          "with chrony or PTP clockselect does better",
          nullptr, kFlags));
  g_object_class_install_property(
      klass, first_id + kPort,
      g_param_spec_int("net-clock-port", "Net clock port",
                       "UDP port of that clock; without net-clock-address the pipeline's own clock is given to others "
                       "there (0: neither)",
                       0, G_MAXUINT16, 0, kFlags));
}

void NetClock::set(Property property, const GValue* value) {
  std::lock_guard lock(mutex_);
  if (property == kAddress)
    address_ = g_value_get_string(value) ? g_value_get_string(value) : "";
  else
    port_ = g_value_get_int(value);
}

void NetClock::get(Property property, GValue* value) {
  std::lock_guard lock(mutex_);
  if (property == kAddress)
    g_value_set_string(value, address_.empty() ? nullptr : address_.c_str());
  else
    g_value_set_int(value, port_);
}

// The pipeline reads the clock as soon as it has it: it must be right by then.
bool NetClock::follow(GstElement* element) {
  std::unique_lock lock(mutex_);
  if (address_.empty()) return true;
  if (port_ == 0) {
    GST_ELEMENT_ERROR(element, RESOURCE, SETTINGS, ("net-clock-address needs net-clock-port"), (nullptr));
    return false;
  }
  GstClock* clock = gst_net_client_clock_new("net-clock", address_.c_str(), port_, 0);
  const std::string place = address_ + ":" + std::to_string(port_);
  lock.unlock();
  if (!gst_clock_wait_for_sync(clock, kPatience)) {
    gst_object_unref(clock);
    GST_ELEMENT_ERROR(
        element, RESOURCE, OPEN_READ,
        ("no clock answers at %s: is a pipeline playing there that has net-clock-port set?", place.c_str()),
        ("waited for %" GST_TIME_FORMAT, GST_TIME_ARGS(kPatience)));
    return false;
  }
  lock.lock();
  gst_object_replace(reinterpret_cast<GstObject**>(&followed_), GST_OBJECT(clock));
  lock.unlock();
  gst_element_post_message(element, gst_message_new_clock_provide(GST_OBJECT(element), clock, TRUE));
  gst_object_unref(clock);
  return true;
}

bool NetClock::serve(GstElement* element) {
  std::unique_lock lock(mutex_);
  if (!address_.empty() || port_ == 0 || server_) return true;
  GstClock* clock = gst_element_get_clock(element);
  if (!clock) return true;
  server_ = reinterpret_cast<GstObject*>(gst_net_time_provider_new(clock, nullptr, port_));
  gst_object_unref(clock);
  if (server_) return true;
  const gint port = port_;
  lock.unlock();
  GST_ELEMENT_ERROR(element, RESOURCE, OPEN_WRITE, ("net-clock-port %d: can't be listened at; is it in use?", port),
                    (nullptr));
  return false;
}

bool NetClock::before(GstElement* element, GstStateChange transition) {
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) return follow(element);
  return transition != GST_STATE_CHANGE_PAUSED_TO_PLAYING || serve(element);
}

void NetClock::after(GstElement* element, GstStateChange transition) {
  if (transition != GST_STATE_CHANGE_PAUSED_TO_READY) return;
  if (GstClock* clock = provide()) {
    gst_element_post_message(element, gst_message_new_clock_lost(GST_OBJECT(element), clock));
    gst_object_unref(clock);
  }
  stop();
}

void NetClock::stop() {
  std::lock_guard lock(mutex_);
  gst_clear_object(&followed_);
  gst_clear_object(&server_);
}

GstClock* NetClock::provide() {
  std::lock_guard lock(mutex_);
  return followed_ ? GST_CLOCK(gst_object_ref(followed_)) : nullptr;
}

}  // namespace lf
