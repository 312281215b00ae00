// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>

#include <gst/base/gstqueuearray.h>

#include "common/capture_delay.h"
#include "common/common.h"
#include "common/net_clock.h"
#include "viewrequest/focus_feedback.h"
#include "viewrequest/lfviewrequest.h"
#include "viewrequest/navigation_tap.h"
#include "viewrequest/request_relay.h"
#include "viewrequest/request_stream.h"
#include "viewrequest/view_control.h"
#include "viewrequest/view_request_settings.h"

// What the files of lfviewrequest share: lfviewrequest.cc (the element), view_request_properties.cc,
// view_request_steering.cc (what moves the view while it runs), view_request_turn.cc (when a request leaves, and what
// it says), view_request_focus.cc (where it is in focus), view_request_send.cc (what leaves beside a request) and
// view_request_relay.cc (foreign requests).

struct _LfViewRequest {
  GstPushSrc parent;
  // Under the object lock.
  lf::ViewRequestSettings* settings;
  lf::ViewControl* control;
  lf::NetClock* net_clock;
  lf::NavigationTap* navigation_tap;
  lf::RequestStream* stream;  // null when stopped; what other threads do not ask for is the streaming thread's alone
  std::vector<lf::ViewRequest>* extra;  // that go along with the next request
  lf::OutOfService* out_of_service;     // has a lock of its own
  lf::FocusFeedback* focus_feedback;    // has a lock of its own
  lf::AutoCaptureDelay* auto_delay;     // has a lock of its own
  lf::RequestRelay* relay;              // has a lock of its own
  lf::RelayedFocus* relayed_focus;      // has a lock of its own
  GstPad* sink;                         // of requests to be relayed; null: the element makes its own
  GstCaps* relayed_caps;                // of the sink pad, until they have been passed on
  GstClockID clock_id;
  bool unlocked;
  bool changed;            // the view, since the request before
  bool waits_for_change;   // clock_id ends with it
  bool warned_commands;    // streaming thread
  GstQueueArray* to_send;  // buffers, before the next request; streaming thread
  gint num_buffers;        // the property: requests, which the base class would count together with what goes along
  gint requests_left;      // of these; -1: no end. Streaming thread
  // Not live: whether somebody who finds the focus has been looked for, and is waited for. Streaming thread.
  bool asked_for_focus, awaits_focus;
  bool has_sent;          // a request; streaming thread
  guint32 last_sequence;  // of it
  guint32 seek_seqnum;    // of the latest seek
  // Not live: the seek that is not over, during which nothing leaves (hold_event.h). Under the object lock.
  guint32 held_for;
  GCond held_changed;
};

// view_request_properties.cc
void lf_view_request_install_properties(GObjectClass* klass);
// What mouse and keys are held back by; null if they are not.
std::shared_ptr<const lf::VisibleShare> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                      const std::shared_ptr<const lf::Rig>& rig);

// view_request_steering.cc
// The actions set-view and focus-at.
void lf_view_request_install_signals(GObjectClass* klass);
// As the properties say. With the object lock, while running.
lf::View lf_view_request_view(LfViewRequest* self);
// The view is another one than before: a request that waits for its turn may leave. With the object lock.
void lf_view_request_note_change(LfViewRequest* self);
// Runs `change` on the view under the lock and then tells who watches the properties. Returns what `change` returns.
gboolean lf_view_request_change_view(LfViewRequest* self, const std::function<gboolean(lf::ViewControl&)>& change);
// Mouse, keys, or an event "lf-view-request".
bool lf_view_request_is_steering(GstEvent* event);
// By such an event; false if nothing comes of it.
gboolean lf_view_request_steer(LfViewRequest* self, GstEvent* event);

// view_request_turn.cc
// How much later than its capture time a live request leaves: what `capture-delay` says, or what nodes need.
GstClockTime lf_view_request_capture_delay(LfViewRequest* self);
gboolean lf_view_request_unlock(GstBaseSrc* base);
gboolean lf_view_request_unlock_stop(GstBaseSrc* base);
GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out);

// view_request_focus.cc
// The action focus-at.
gboolean lf_view_request_focus_at(LfViewRequest* self, gdouble x, gdouble y);
// The next requests of this view are focused so; false where cameras are told where to look (access).
bool lf_view_request_take_focus(LfViewRequest* self, lf::FoundFocus focus);
// Files in, files out: where somebody finds the focus of this view, each request has what came of the one before.
GstFlowReturn lf_view_request_wait_for_focus(LfViewRequest* self);

// view_request_send.cc
// What is to leave right after a request, if anything is: the command for the cameras, and extra requests. `stamps`:
// the request's buffer.
void lf_view_request_send_more(LfViewRequest* self, const lf::ViewRequest& request,
                               const std::shared_ptr<const lf::Rig>& rig, GstBuffer* stamps);

// view_request_relay.cc
void lf_view_request_install_relay(GstElementClass* klass);
bool lf_view_request_is_relay(LfViewRequest* self);
// An event to whoever sends the requests that are relayed; takes it. False if nobody takes it there.
bool lf_view_request_push_upstream(LfViewRequest* self, GstEvent* event);
// A latency query of a relay: that of the requests which come in. False if nobody upstream knows it.
bool lf_view_request_relayed_latency(LfViewRequest* self, GstQuery* query);
// Requests of the view get that surface here, because nobody upstream has taken it. False if the relay is not live.
bool lf_view_request_keep_focus(LfViewRequest* self, guint view_id, lf::FoundFocus focus);
// The next request that came in, with the cameras that are out of service added; waits for it.
GstFlowReturn lf_view_request_relay(LfViewRequest* self, GstBuffer** out);
