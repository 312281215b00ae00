// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include <gst/base/gstpushsrc.h>
#include <gst/gst.h>

#include "common/common.h"
#include "common/custom_events.h"
#include "common/gst_pointers.h"
#include "focus/focus_feedback.h"
#include "view/view_request.h"
#include "viewrequest/request_stream.h"
#include "viewrequest/view_control.h"
#include "viewrequest/view_request_settings.h"

G_BEGIN_DECLS

#define LF_TYPE_VIEW_REQUEST (lf_view_request_get_type())
G_DECLARE_FINAL_TYPE(LfViewRequest, lf_view_request, LF, VIEW_REQUEST, GstPushSrc)

// Whether requests are answered in this process, as a bin knows that has the cameras: such requests are not compressed,
// and their quality is 0. Any thread.
void lf_view_request_set_in_process(LfViewRequest* self, gboolean in_process);

GST_ELEMENT_REGISTER_DECLARE(lfviewrequest)

G_END_DECLS

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);

// What the files of lfviewrequest share: lfviewrequest.cc (the element, and when a request leaves and what it says),
// view_control.cc (what moves the view while it runs) and picture_form.cc (the size and rate of pictures).

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

// lfviewrequest.cc
// What mouse and keys are held back by; null if they are not.
std::shared_ptr<const lf::VisibleShare> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                      const std::shared_ptr<const lf::Rig>& rig);

// view_control.cc
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

// picture_form.cc
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
