// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "common/buffer_ptr.h"
#include "common/capture_delay.h"
#include "common/common.h"
#include "common/seek_once.h"
#include "focus/focus_feedback.h"
#include "view/asked_of_requests.h"
#include "viewrequest/focus_wait.h"
#include "viewrequest/lfviewrequest.h"
#include "viewrequest/navigation_tap.h"
#include "viewrequest/picture_form.h"
#include "viewrequest/request_outbox.h"
#include "viewrequest/request_relay.h"
#include "viewrequest/request_stream.h"
#include "viewrequest/request_turn.h"
#include "viewrequest/view_control.h"
#include "viewrequest/view_request_settings.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_view_request_debug

// What the files of lfviewrequest share: lfviewrequest.cc (the element), view_request_properties.cc,
// view_request_events.cc (what comes from downstream), view_request_steering.cc (what moves the view while it runs),
// view_request_form.cc (the size and rate of pictures), view_request_turn.cc (when a request leaves, and what it says),
// view_request_send.cc (what leaves beside a request) and view_request_relay.cc (foreign requests).

struct _LfViewRequest {
  GstPushSrc parent;
  struct State {
    explicit State(GstPad* src) : focus_wait(focus, src) {}

    // Any thread.
    lf::RequestTurn turn;
    lf::SeekOnce sought;
    lf::OutOfService out_of_service;
    lf::ExtraRequests extra;
    lf::FocusFeedback focus;
    lf::AutoCaptureDelay auto_delay;
    lf::RequestRelay relay;
    lf::RelayedFocus relayed_focus;
    std::atomic<bool> in_process = false;

    // Under the object lock.
    lf::ViewRequestSettings settings;
    lf::ViewControl control;
    std::unique_ptr<lf::RequestStream> stream;  // null when stopped
    lf::SharedCaps downstream;                  // the video that is accepted behind the compositor; null: not known
    lf::PictureForm form;                       // of the next pictures; views of a file have sizes of their own
    bool follows_caps = false;                  // the form fits `downstream`
    gint requests_left = -1;                    // how many of `num_buffers` are still to be made; -1: no end

    // Streaming thread.
    lf::FocusWait focus_wait;
    lf::RequestOutbox outbox;
    bool warned_commands = false;
    lf::PictureForm agreed;  // the rate of the current caps; 0: none yet

    lf::NavigationTap navigation_tap;  // watches the elements of navigation-from, from start to stop
  } * state;
};

// view_request_properties.cc
void lf_view_request_install_properties(GObjectClass* klass);
// What mouse and keys are held back by; null if they are not.
std::shared_ptr<const lf::VisibleShare> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                      const std::shared_ptr<const lf::Rig>& rig);
// Posts a warning of what is set without effect, but where it is the same as `before`.
void lf_view_request_warn_without_effect(LfViewRequest* self, const std::string& before = "");

// view_request_steering.cc
guint lf_view_request_view_id(LfViewRequest* self);
// The actions set-view and focus-at.
void lf_view_request_install_signals(GObjectClass* klass);
// The view as the properties say. Call with the object lock held, while running.
lf::View lf_view_request_view(LfViewRequest* self);
// Runs `change` on the view under the lock and then tells who watches the properties. Returns what `change` returns.
gboolean lf_view_request_change_view(LfViewRequest* self, const std::function<gboolean(lf::ViewControl&)>& change);
// The focus is found there.
void lf_view_request_set_focus_distance(LfViewRequest* self, double distance);
// Mouse, keys, or an event "lightfield-view-request".
bool lf_view_request_is_steering(GstEvent* event);
// Moves the view as a navigation event or an lightfield-view-request event says; false if nothing comes of the event.
gboolean lf_view_request_steer(LfViewRequest* self, GstEvent* event);

// view_request_turn.cc
// How much later than its capture time a live request leaves: what `capture-delay` says, or what nodes need.
GstClockTime lf_view_request_capture_delay(LfViewRequest* self);
gboolean lf_view_request_unlock(GstBaseSrc* base);
gboolean lf_view_request_unlock_stop(GstBaseSrc* base);
GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out);

// view_request_form.cc
// The functions of GstBaseSrcClass that agree on caps.
void lf_view_request_install_form(GstBaseSrcClass* klass);
// Chooses size and rate again. Call with the object lock held, after a change of the properties, the rig or the caps.
void lf_view_request_choose_form(LfViewRequest* self);
// From the next request on pictures fit these caps, as far as properties leave that open. FALSE if that can't be.
gboolean lf_view_request_follow_caps(LfViewRequest* self, lf::SharedCaps caps);
// Puts the view where it begins. `stream`: a new one that begins; null: the one there is. Not under the object lock.
// Throws Error, and nothing has changed, for a rig whose cameras have no mesh.
void lf_view_request_begin_view(LfViewRequest* self, std::unique_ptr<lf::RequestStream> stream = nullptr);
// Agrees on the rate, if there is another one. Streaming thread.
GstFlowReturn lf_view_request_follow_rate(LfViewRequest* self);

// view_request_events.cc
void lf_view_request_install_events(GstBaseSrcClass* klass);

// view_request_send.cc
// What is to leave right after a request, if anything is: the command for the cameras, `beside`, the requests for the
// other views of its set, which get their numbers here, and extra requests. `stamps`: the request's buffer.
void lf_view_request_send_more(LfViewRequest* self, const lf::ViewRequest& request,
                               const std::shared_ptr<const lf::Rig>& rig, GstBuffer* stamps,
                               std::vector<lf::ViewRequest> beside = {});

// view_request_relay.cc
void lf_view_request_install_relay(GstElementClass* klass);
// The next request that came in, with the cameras that are out of service added; waits for it.
GstFlowReturn lf_view_request_relay(LfViewRequest* self, GstBuffer** out);
