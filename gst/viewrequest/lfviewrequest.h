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
#include "focus/depth_feedback.h"
#include "view/view_request.h"
#include "viewrequest/request_stream.h"
#include "viewrequest/view_control.h"
#include "viewrequest/view_request_settings.h"

#define LF_TYPE_VIEW_REQUEST (lf_view_request_get_type())
G_DECLARE_FINAL_TYPE(LfViewRequest, lf_view_request, LF, VIEW_REQUEST, GstPushSrc)

// Tells the element whether all nodes are in this process. If so, compressed answers would only waste time, so requests
// have the quality 0 (uncompressed). Thread-safe.
void lf_view_request_set_in_process(LfViewRequest* self, gboolean in_process);

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);

// The state of an lfviewrequest. Three files share it: lfviewrequest.cc (the element and its requests), view_control.cc
// (navigation) and view_request_settings.cc (size and rate of pictures).

struct _LfViewRequest {
  GstPushSrc parent;
  struct State {
    explicit State(GstPad* src) : focus_wait(focus, src) {}

    // Thread-safe:
    lf::RequestPacer turn;
    lf::SeekFilter seek_filter;
    lf::OutOfServiceRegistry out_of_service;
    lf::ExtraRequests extra;
    lf::DepthFeedback focus;
    lf::AutoCaptureDelay auto_delay;
    lf::RequestRelay relay;
    lf::RelayedDepths relayed_focus;
    std::atomic<bool> in_process = false;
    std::atomic<bool> posted_error = false;  // since the last start

    // Guarded by the object lock:
    lf::ViewRequestSettings settings;
    lf::ViewControl control;
    std::unique_ptr<lf::RequestStream> stream;
    lf::SharedCaps downstream;  // video caps accepted downstream of the compositor; null: unknown
    lf::PictureFormat form;     // format of the next pictures, except for views of a file
    bool follows_caps = false;
    gint requests_left = -1;  // remaining requests of `num_buffers`; -1: unlimited

    // Streaming thread:
    lf::FocusWait focus_wait;
    lf::RequestOutbox outbox;
    bool warned_commands = false;
    lf::PictureFormat agreed;

    lf::NavigationTap navigation_tap;  // watches the element of the property navigation-element, from start to stop
  } * state;
};

// Defined in lfviewrequest.cc: Returns the function that limits navigation by mouse and keys to viewpoints where
// cameras see the scene. Returns null if navigation has no limit.
std::shared_ptr<const lf::VisibleFraction> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                         const std::shared_ptr<const lf::Rig>& rig);

// Defined in view_control.cc:
lf::ViewRequestSettings lf_view_request_settings(LfViewRequest* self);
guint lf_view_request_view_id(LfViewRequest* self);
void lf_view_request_install_signals(GObjectClass* klass);
// Returns the view of the current properties. Call with the object lock held, while running.
lf::View lf_view_request_view(LfViewRequest* self);
// Moves the view: calls `change` with the object lock held, and then emits `notify` for all properties with a new
// value. Returns the result of `change`.
gboolean lf_view_request_change_view(LfViewRequest* self, const std::function<gboolean(lf::ViewControl&)>& change);
void lf_view_request_set_focus_distance(LfViewRequest* self, double distance);
bool lf_view_request_is_navigation(GstEvent* event);
// Applies a navigation or lightfield-view-request event to the view. Returns false if the event has no effect.
gboolean lf_view_request_navigate(LfViewRequest* self, GstEvent* event);

// Defined in view_request_settings.cc: Installs the functions of GstBaseSrcClass that negotiate caps.
void lf_view_request_install_format(GstBaseSrcClass* klass);
// Updates size and rate after a change of properties, rig or caps. Call with the object lock held.
void lf_view_request_choose_format(LfViewRequest* self);
// Makes the next pictures fit these caps as far as the properties allow. Returns FALSE if they cannot fit.
gboolean lf_view_request_follow_caps(LfViewRequest* self, lf::SharedCaps caps);
// Moves the view to its start position. `stream` replaces the current request stream (null: keep the current stream).
// Call without the object lock. Throws Error, without changes, if the cameras of the rig cannot be connected to a mesh.
void lf_view_request_begin_view(LfViewRequest* self, std::unique_ptr<lf::RequestStream> stream = nullptr);
// Negotiates the rate if it has changed. Streaming thread.
GstFlowReturn lf_view_request_follow_rate(LfViewRequest* self);
