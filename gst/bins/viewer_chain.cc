// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/viewer_chain.h"

#include <algorithm>
#include <string>

#include "base/text.h"
#include "bins/rtp_link.h"
#include "common/common.h"
#include "common/guard.h"
#include "view/view.h"
#include "viewrequest/lfviewrequest.h"

#define LF_TYPE_VIEW_SPLIT (lf_view_split_get_type())
G_DECLARE_FINAL_TYPE(LfViewSplit, lf_view_split, LF, VIEW_SPLIT, GstElement)

// Sends each unit (answer or request) of a stream to the viewer with the view id of the unit. Units of unknown views,
// and units that a viewer rejects, are dropped without an error. The type is not registered, because it is used only
// inside bins.
struct _LfViewSplit {
  GstElement parent;
  GstPad* sink;
};

G_DEFINE_FINAL_TYPE(LfViewSplit, lf_view_split, GST_TYPE_ELEMENT)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_MEDIA_TYPE "; " LF_REQUEST_MEDIA_TYPE));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src_%u", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_ANSWER_MEDIA_TYPE "; " LF_REQUEST_MEDIA_TYPE));

static std::string pad_name(guint view_id) { return "src_" + std::to_string(view_id); }

static GstFlowReturn lf_view_split_chain(GstPad*, GstObject* parent, GstBuffer* unit) {
  const std::optional<uint32_t> view = lf::view_of(unit);
  g_autoptr(GstPad) pad = view ? gst_element_get_static_pad(GST_ELEMENT(parent), pad_name(*view).c_str()) : nullptr;
  if (pad)
    gst_pad_push(pad, unit);
  else
    gst_buffer_unref(unit);
  return GST_FLOW_OK;
}

// Forwards caps events even if one viewer rejects the caps. The default handler of a pad would stop the event then.
static gboolean lf_view_split_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return gst_pad_event_default(pad, parent, event);
  gst_pad_forward(
      pad,
      [](GstPad* src, gpointer caps) -> gboolean {
        gst_pad_push_event(src, gst_event_ref(static_cast<GstEvent*>(caps)));
        return FALSE;
      },
      event);
  gst_event_unref(event);
  return TRUE;
}

static gboolean copy_sticky_event(GstPad*, GstEvent** event, gpointer src) {
  gst_pad_store_sticky_event(GST_PAD(src), *event);
  return TRUE;
}

static LfViewSplit* lf_view_split_new(const std::string& name) {
  return LF_VIEW_SPLIT(g_object_new(LF_TYPE_VIEW_SPLIT, "name", name.c_str(), nullptr));
}

// Adds a source pad for a view. The element owns the pad; gst_element_release_request_pad() removes the pad.
// Thread-safe.
static GstPad* lf_view_split_add_view(LfViewSplit* self, guint view_id) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "src_%u");
  GstPad* pad = gst_pad_new_from_template(templ, pad_name(view_id).c_str());
  gst_pad_set_active(pad, TRUE);
  // The stream lock prevents events between the copy of the sticky events and gst_element_add_pad().
  GST_PAD_STREAM_LOCK(self->sink);
  gst_pad_sticky_events_foreach(self->sink, copy_sticky_event, pad);
  const gboolean added = gst_element_add_pad(GST_ELEMENT(self), pad);
  GST_PAD_STREAM_UNLOCK(self->sink);
  return added ? pad : nullptr;
}

static void lf_view_split_release_pad(GstElement* element, GstPad* pad) {
  gst_pad_set_active(pad, FALSE);
  gst_element_remove_pad(element, pad);
}

static void lf_view_split_class_init(LfViewSplitClass* klass) {
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->release_pad = lf::callback<lf_view_split_release_pad>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field view split", "Filter",
                                        "Routes each unit to the viewer of its view", "gst-lightfield");
}

static void lf_view_split_init(LfViewSplit* self) {
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, lf::callback<lf_view_split_chain>);
  gst_pad_set_event_function(self->sink, lf::callback<lf_view_split_event>);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
}

namespace lf {
namespace {

constexpr int kLeaky = 2;
constexpr guint kFewTurns = 4;
constexpr guint kManyParts = 4096;
constexpr guint kManyBytes = 1 << 26;
constexpr GstClockTime kEarliest = GST_SECOND / 10;  // a picture may wait at least this long for its display

void link(GstElement* from, const char* from_pad, GstElement* to, const char* to_pad) {
  if (!gst_element_link_pads(from, from_pad, to, to_pad))
    throw Error(std::string(GST_OBJECT_NAME(from)) + " can't be linked with " + GST_OBJECT_NAME(to));
}

void link(const PadPtr& src, const PadPtr& sink) {
  if (!src || !sink || gst_pad_link(src.get(), sink.get()) != GST_PAD_LINK_OK)
    throw Error("a viewer can't be linked with the cameras");
}

PadPtr static_pad(GstElement* element, const std::string& name) {
  return PadPtr(gst_element_get_static_pad(element, name.c_str()));
}

// A probe for latency events, which makes the capacity of a live queue as long as the latency of the pipeline. Pictures
// are rendered when their answers arrive, and then wait in this queue until their display time.
GstPadProbeReturn follow_latency(GstPad* pad, GstPadProbeInfo* info, gpointer) {
  GstEvent* event = gst_pad_probe_info_get_event(info);
  if (GST_EVENT_TYPE(event) != GST_EVENT_LATENCY) return GST_PAD_PROBE_OK;
  GstClockTime latency = 0;
  gst_event_parse_latency(event, &latency);
  g_autoptr(GstElement) queue = gst_pad_get_parent_element(pad);
  gint leaky = 0;
  if (queue) g_object_get(queue, "leaky", &leaky, nullptr);
  if (leaky == kLeaky) g_object_set(queue, "max-size-time", std::max(latency, kEarliest), nullptr);
  return GST_PAD_PROBE_OK;
}

// Forwards allocation queries directly to the peer. A tee ignores the allocation pools of its branches (GStreamer
// 1.22), but this tee has only one branch.
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
  // Locks the state: the bin may be changing state, and the element must not start before it is linked.
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
  gst_pad_add_probe(static_pad(to_src_, "src").get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, callback<follow_latency>,
                    nullptr, nullptr);
  pictures_ = add("tee", "pictures");
  g_object_set(view_, "view-id", view_id, nullptr);
  g_object_set(compositor_, "view-id", view_id, nullptr);
  g_object_set(pictures_, "allow-not-linked", TRUE, nullptr);
  gst_pad_add_probe(static_pad(pictures_, "sink").get(), GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM,
                    callback<ask_branch_for_memory>, gst_element_request_pad_simple(pictures_, "src_0"),
                    gst_object_unref);
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
  set.layout = static_cast<ViewSetLayout>(layout);
  make_room_in(GST_ELEMENT(queue), static_cast<guint>(set.place(0).count()));
}

// Allocates no memory, because exceptions must not leave a destructor.
ViewerChain::~ViewerChain() {
  for (GstElement* answers : answers_) gst_object_unref(answers);
  for (GstElement* output : outputs_) gst_object_unref(output);
  for (GstElement* element : {pictures_, to_src_, compositor_, to_cameras_, to_compositor_, requests_, view_})
    gst_object_unref(element);
}

std::vector<GstElement*> ViewerChain::behind_cameras() const {
  std::vector<GstElement*> elements = {pictures_, to_src_};
  elements.insert(elements.end(), outputs_.begin(), outputs_.end());
  elements.push_back(compositor_);
  elements.insert(elements.end(), answers_.begin(), answers_.end());
  return elements;
}

std::vector<GstElement*> ViewerChain::before_cameras() const { return {to_cameras_, to_compositor_, requests_, view_}; }

PadPtr ViewerChain::add_answers(bool drops, const std::string& from) {
  const std::string number = std::to_string(answers_.size());
  GstElement* queue = add("queue", ("answers" + number + (from.empty() ? "" : " of " + from)).c_str());
  answers_.push_back(queue);
  if (drops)
    g_object_set(queue, "leaky", kLeaky, "max-size-buffers", kManyParts, "max-size-bytes", kManyBytes, "max-size-time",
                 guint64{0}, nullptr);
  link(queue, "src", compositor_, ("sink_" + number).c_str());
  return static_pad(queue, "sink");
}

void ViewerChain::drop_answers() {
  for (GstElement* queue : answers_) {
    const PadPtr sink(gst_pad_get_peer(static_pad(queue, "src").get()));
    gst_element_set_state(queue, GST_STATE_NULL);
    gst_bin_remove(bin_, queue);
    gst_element_release_request_pad(compositor_, sink.get());
    gst_object_unref(queue);
  }
  answers_.clear();
}

void ViewerChain::set_queue_of_pictures(GstElement* queue, bool live) {
  g_object_set(queue, "leaky", live ? kLeaky : 0, "max-size-buffers", live ? 0u : 1u, "max-size-bytes", 0u,
               "max-size-time", live ? kEarliest : guint64{0}, nullptr);
}

void ViewerChain::set_live(bool live) {
  live_ = live;
  g_object_set(view_, "is-live", live, nullptr);
  for (GstElement* queue : {to_cameras_, to_compositor_}) g_object_set(queue, "leaky", live ? kLeaky : 0, nullptr);
  set_queue_of_pictures(to_src_, live);
  for (GstElement* queue : outputs_) set_queue_of_pictures(queue, live);
}

PadPtr ViewerChain::add_output(const std::string& compositor_pad) {
  GstElement* queue = add("queue", ("to_" + compositor_pad).c_str());
  outputs_.push_back(queue);
  set_queue_of_pictures(queue, live_);
  gst_pad_add_probe(static_pad(queue, "src").get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, callback<follow_latency>,
                    nullptr, nullptr);
  link(compositor_, compositor_pad.c_str(), queue, "sink");
  gst_element_sync_state_with_parent(queue);
  return static_pad(queue, "src");
}

void ViewerChain::remove_output(GstPad* pad) {
  const ElementPtr queue(gst_pad_get_parent_element(pad));
  if (!queue || std::erase(outputs_, queue.get()) == 0) return;
  const PadPtr src(gst_pad_get_peer(static_pad(queue.get(), "sink").get()));
  gst_element_set_state(queue.get(), GST_STATE_NULL);
  gst_element_release_request_pad(compositor_, src.get());
  gst_bin_remove(bin_, queue.get());
  gst_object_unref(queue.get());
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
  // Blocks messages first, because gst_bin_remove() unlinks the elements while the bin still forwards errors such as
  // not-linked.
  for (GstElement* element : all()) gst_element_set_bus(element, nullptr);
  for (GstElement* element : all()) gst_bin_remove(bin_, element);
}

void ViewerChain::close(const std::function<void()>& leave_cameras) {
  for (GstElement* element : behind_cameras()) gst_element_set_state(element, GST_STATE_NULL);
  leave_cameras();
  for (GstElement* element : before_cameras()) gst_element_set_state(element, GST_STATE_NULL);
}

ViewerRequests::ViewerRequests(GstBin* bin, const HostPort& from, const RtpSecurity& security) : elements_(bin) {
  GstElement* received = add_receiver(elements_, from, "X-LIGHTFIELD-REQUEST", security, "listen");
  split_ = elements_.add(GST_ELEMENT(lf_view_split_new("listen_requests")));
  link(received, "src", split_, "sink");
}

std::unique_ptr<RequestedPads> ViewerRequests::connect(ViewerChain& viewer) {
  // enough for four sets of 16 views, or one of 64, because the size of remote sets is unknown
  constexpr guint kAtOnce = 16;
  viewer.make_room(kAtOnce);
  auto pads = std::make_unique<RequestedPads>();
  GstPad* out = lf_view_split_add_view(LF_VIEW_SPLIT(split_), viewer.view_id());
  if (out) pads->add(split_, GST_PAD(gst_object_ref(out)));
  GstPad* in = gst_element_request_pad_simple(viewer.view(), "sink");
  if (in) pads->add(viewer.view(), in);
  if (!out || !in || gst_pad_link(out, in) != GST_PAD_LINK_OK)
    throw Error("requests of remote hosts can't be linked with a viewer");
  return pads;
}

namespace {

class LocalCameras : public ViewerCameras {
 public:
  explicit LocalCameras(GstBin* bin) : elements_(bin), node_(elements_.add("lfcameranode", "node")) {}

  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) override {
    auto pads = std::make_unique<RequestedPads>();
    lf_view_request_set_in_process(LF_VIEW_REQUEST(viewer.view()), TRUE);
    const std::string ending = viewer.view_id() == 0 ? "" : "_" + std::to_string(viewer.view_id() - 1);
    if (viewer.view_id() != 0)
      if (GstPad* request = gst_element_request_pad_simple(node_, ("request" + ending).c_str()))
        pads->add(node_, request);
    link(viewer.requests(), static_pad(node_, "request" + ending));
    link(static_pad(node_, "src" + ending), viewer.add_answers(false));
    return pads;
  }

 private:
  ScopedElements elements_;
  GstElement* node_;
};

class RemoteCameras : public ViewerCameras {
 public:
  RemoteCameras(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file)
      : network_(bin, nodes, key_file), elements_(bin), requests_(elements_.add("funnel", "all_requests")) {
    link(requests_, "src", network_.requests(), "sink");
    for (size_t i = 0; i < nodes.size(); i++) {
      splits_.push_back(lf_view_split_new("host" + std::to_string(i) + "_answers"));
      link(network_.hosts()[i].answers, "src", elements_.add(GST_ELEMENT(splits_.back())), "sink");
    }
  }

  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) override {
    auto pads = std::make_unique<RequestedPads>();
    lf_view_request_set_in_process(LF_VIEW_REQUEST(viewer.view()), FALSE);
    const auto hold = [](GstPad* pad) { return PadPtr(GST_PAD(gst_object_ref(pad))); };
    link(viewer.requests(), hold(pads->add(requests_, gst_element_request_pad_simple(requests_, "sink_%u"))));
    for (size_t i = 0; i < splits_.size(); i++) {
      const PadPtr answers = hold(lf_view_split_add_view(splits_[i], viewer.view_id()));
      pads->add(GST_ELEMENT(splits_[i]), GST_PAD(gst_object_ref(answers.get())));
      link(answers, viewer.add_answers(true, network_.hosts()[i].name));
    }
    return pads;
  }

 private:
  CameraHosts network_;
  ScopedElements elements_;
  GstElement* requests_;
  std::vector<LfViewSplit*> splits_;
};

}  // namespace

std::unique_ptr<ViewerCameras> make_local_cameras(GstBin* bin) { return std::make_unique<LocalCameras>(bin); }

std::unique_ptr<ViewerCameras> make_remote_cameras(GstBin* bin, const std::vector<NodeAddress>& nodes,
                                                   const std::string& key_file) {
  return std::make_unique<RemoteCameras>(bin, nodes, key_file);
}

}  // namespace lf
