// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/viewer_chain.h"

#include <algorithm>

#include "base/error.h"
#include "common/guard.h"
#include "view/view_set.h"

namespace lf {
namespace {

constexpr int kLeaky = 2;           // of queue: the oldest go
constexpr guint kFewTurns = 4;      // of requests
constexpr guint kManyParts = 4096;  // of answers that come in bursts
constexpr guint kManyBytes = 1 << 26;
constexpr GstClockTime kEarliest = GST_SECOND / 10;  // before its time that a picture is made, at least

void link(GstElement* from, const char* from_pad, GstElement* to, const char* to_pad) {
  if (!gst_element_link_pads(from, from_pad, to, to_pad))
    throw Error(std::string(GST_OBJECT_NAME(from)) + " can't be linked with " + GST_OBJECT_NAME(to));
}

// A live picture is made as soon as its answers are there and waits for the time at which it is shown: no longer than
// the pipeline's latency.
GstPadProbeReturn follow_latency(GstPad* pad, GstPadProbeInfo* info, gpointer) {
  GstEvent* event = gst_pad_probe_info_get_event(info);
  if (GST_EVENT_TYPE(event) != GST_EVENT_LATENCY) return GST_PAD_PROBE_OK;
  GstClockTime latency = 0;
  gst_event_parse_latency(event, &latency);
  GstElement* queue = gst_pad_get_parent_element(pad);
  if (!queue) return GST_PAD_PROBE_OK;
  gint leaky = 0;
  g_object_get(queue, "leaky", &leaky, nullptr);
  if (leaky == kLeaky) g_object_set(queue, "max-size-time", std::max(latency, kEarliest), nullptr);
  gst_object_unref(queue);
  return GST_PAD_PROBE_OK;
}

// A tee passes no memory on that its branches offer (GStreamer 1.22), as they would share it. This one has one branch:
// what is behind that is asked in the tee's place.
GstPadProbeReturn ask_branch_for_memory(GstPad*, GstPadProbeInfo* info, gpointer branch) {
  GstQuery* query = GST_PAD_PROBE_INFO_QUERY(info);
  if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION) return GST_PAD_PROBE_OK;
  return gst_pad_peer_query(static_cast<GstPad*>(branch), query) ? GST_PAD_PROBE_HANDLED : GST_PAD_PROBE_DROP;
}

}  // namespace

GstElement* ViewerChain::add(const char* factory, const char* name) {
  GstElement* element = gst_element_factory_make(factory, (name + ending_).c_str());
  if (!element) throw Error(std::string("element ") + factory + " is not installed");
  gst_object_ref(element);
  // The bin may just be starting what is inside: this must not begin before it is linked.
  gst_element_set_locked_state(element, !follows_);
  gst_bin_add(bin_, element);
  return element;
}

ViewerChain::ViewerChain(GstBin* bin, guint view_id, const std::string& ending)
    : bin_(bin), view_id_(view_id), ending_(ending) {
  view_ = add("lfviewrequest", "view");
  requests_ = add("tee", "requests");
  to_cameras_ = add("queue", "to_cameras");
  to_compositor_ = add("queue", "to_compositor");
  for (GstElement* queue : {to_cameras_, to_compositor_}) {
    g_object_set(queue, "max-size-time", guint64{0}, "max-size-bytes", 0u, nullptr);
    make_room_in(queue, 1);
    for (const char* signal : {"notify::views", "notify::columns", "notify::rows"})
      g_signal_connect_object(view_, signal, G_CALLBACK(callback<follow_set>), queue, GConnectFlags(0));
  }
  compositor_ = add("lfcompositor", "compositor");
  to_src_ = add("queue", "to_src");
  GstPad* shown = gst_element_get_static_pad(to_src_, "src");
  gst_pad_add_probe(shown, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, callback<follow_latency>, nullptr, nullptr);
  gst_object_unref(shown);
  pictures_ = add("tee", "pictures");
  g_object_set(view_, "view-id", view_id, nullptr);
  g_object_set(compositor_, "view-id", view_id, nullptr);
  g_object_set(pictures_, "allow-not-linked", TRUE, nullptr);
  GstPad* made = gst_element_get_static_pad(pictures_, "sink");
  gst_pad_add_probe(made, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM, callback<ask_branch_for_memory>,
                    gst_element_request_pad_simple(pictures_, "src_0"), gst_object_unref);
  gst_object_unref(made);
  link(view_, "src", requests_, "sink");
  link(requests_, "src_%u", to_cameras_, "sink");
  link(requests_, "src_%u", to_compositor_, "sink");
  link(to_compositor_, "src", compositor_, "request");
  link(compositor_, "src", to_src_, "sink");
  link(to_src_, "src", pictures_, "sink");
}

void ViewerChain::make_room_in(GstElement* queue, guint requests) {
  g_object_set(queue, "max-size-buffers", kFewTurns * requests, nullptr);
}

void ViewerChain::follow_set(GstElement* view, GParamSpec*, gpointer queue) {
  gint layout = 0;
  ViewSet set;
  g_object_get(view, "views", &layout, "columns", &set.columns, "rows", &set.rows, nullptr);
  set.layout = static_cast<SetLayout>(layout);
  make_room_in(GST_ELEMENT(queue), static_cast<guint>(set.place(0).count()));
}

// Nothing is allocated, as nothing that is thrown would get out of here.
ViewerChain::~ViewerChain() {
  for (GstElement* answers : answers_) gst_object_unref(answers);
  for (GstElement* element : {pictures_, to_src_, compositor_, to_cameras_, to_compositor_, requests_, view_})
    gst_object_unref(element);
}

std::vector<GstElement*> ViewerChain::behind_cameras() const {
  std::vector<GstElement*> elements = {pictures_, to_src_, compositor_};
  elements.insert(elements.end(), answers_.begin(), answers_.end());
  return elements;
}

std::vector<GstElement*> ViewerChain::before_cameras() const { return {to_cameras_, to_compositor_, requests_, view_}; }

GstPad* ViewerChain::add_answers(bool drops, const std::string& from) {
  const std::string number = std::to_string(answers_.size());
  GstElement* queue = add("queue", ("answers" + number + (from.empty() ? "" : " of " + from)).c_str());
  answers_.push_back(queue);
  if (drops)
    g_object_set(queue, "leaky", kLeaky, "max-size-buffers", kManyParts, "max-size-bytes", kManyBytes, "max-size-time",
                 guint64{0}, nullptr);
  link(queue, "src", compositor_, ("sink_" + number).c_str());
  return gst_element_get_static_pad(queue, "sink");
}

void ViewerChain::drop_answers() {
  for (GstElement* queue : answers_) {
    GstPad* src = gst_element_get_static_pad(queue, "src");
    GstPad* sink = gst_pad_get_peer(src);
    gst_element_set_state(queue, GST_STATE_NULL);
    gst_bin_remove(bin_, queue);
    gst_element_release_request_pad(compositor_, sink);
    gst_object_unref(sink);
    gst_object_unref(src);
    gst_object_unref(queue);
  }
  answers_.clear();
}

void ViewerChain::set_live(bool live) {
  g_object_set(view_, "is-live", live, nullptr);
  for (GstElement* queue : {to_cameras_, to_compositor_, to_src_})
    g_object_set(queue, "leaky", live ? kLeaky : 0, nullptr);
  g_object_set(to_src_, "max-size-buffers", live ? 0u : 1u, "max-size-bytes", 0u, "max-size-time",
               live ? kEarliest : guint64{0}, nullptr);
}

std::vector<GstElement*> ViewerChain::all() const {
  std::vector<GstElement*> elements = behind_cameras(), before = before_cameras();
  elements.insert(elements.end(), before.begin(), before.end());
  return elements;
}

void ViewerChain::follow_bin() {
  follows_ = true;
  for (GstElement* element : all()) gst_element_set_locked_state(element, FALSE);
  for (GstElement* element : all()) gst_element_sync_state_with_parent(element);
}

void ViewerChain::take_out() {
  // A bin unlinks what it removes while it still passes on what that says: that nobody takes its buffers any more.
  for (GstElement* element : all()) gst_element_set_bus(element, nullptr);
  for (GstElement* element : all()) gst_bin_remove(bin_, element);
}

void ViewerChain::close(const std::function<void()>& leave_cameras) {
  for (GstElement* element : behind_cameras()) gst_element_set_state(element, GST_STATE_NULL);
  leave_cameras();
  for (GstElement* element : before_cameras()) gst_element_set_state(element, GST_STATE_NULL);
}

}  // namespace lf
