// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "common/capture_delay.h"
#include "common/common.h"
#include "common/gst_wire.h"
#include "fragment/lffragment_private.h"
#include "wire/request_codec.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

static PadPair* lf_fragment_pad_pair_of(GstPad* pad) { return static_cast<PadPair*>(gst_pad_get_element_private(pad)); }

// The other pad of the same pair; null while both are being released.
static PadPtr lf_fragment_other_pad(GstPad* pad) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  return GST_PAD_IS_SRC(pad) ? pair->request.get() : pair->src.get();
}

static gboolean lf_fragment_pair_event(GstPad* pad, GstEvent* event) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (other) return gst_pad_push_event(other.get(), event);
  gst_event_unref(event);
  return FALSE;
}

static gboolean lf_fragment_pair_query(GstPad* pad, GstQuery* query) {
  const PadPtr other = lf_fragment_other_pad(pad);
  return other && gst_pad_peer_query(other.get(), query);
}

// Whether answers stay in this process up to the compositor. Asked once and when downstream has changed.
static bool lf_fragment_compositor_is_near(PadPair* pair, GstPad* src) {
  if (!pair->downstream_is_new.exchange(false)) return pair->in_process;
  pair->in_process = lf::compositor_is_near(src);
  GST_INFO_OBJECT(src, "the compositor is %s", pair->in_process ? "in this process" : "behind a link");
  return pair->in_process;
}

// After a flush, and where a new segment goes back, cameras that are read from files have to follow.
static void lf_fragment_follow_requests(LfFragment* self, GstPad* pad, PadPair* pair, const lf::RequestHeader& head) {
  if (head.target_time == lf::kNoTime) return;
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event, &segment);
    const bool moved = !gst_segment_is_equal(segment, &pair->segment) && head.target_time < pair->last_time;
    if (!pair->live && (pair->flushed || moved))
      lf_fragment_seek_cameras(self, head.target_time, gst_event_get_seqnum(event));
    gst_segment_copy_into(segment, &pair->segment);
    gst_event_unref(event);
  }
  pair->flushed = false;
  pair->last_time = head.target_time;
}

// Viewers that leave the capture delay to the nodes hear of it soon when it grows, else once a second.
static void lf_fragment_tell_delay(LfFragment* self, GstPad* pad, PadPair* pair) {
  if (!pair->live) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const uint64_t now = gst_clock_get_time(clock);
  if (now < pair->looked_at + GST_SECOND / 10) return;
  const uint64_t needed = lf_fragment_needed_delay(self, now);
  if (needed == 0) return;
  pair->looked_at = now;
  if (needed <= pair->told_delay && now < pair->told_at + GST_SECOND) return;
  pair->told_delay = needed;
  pair->told_at = now;
  gst_pad_push_event(pad, lf::capture_delay_event(needed));
}

// Whether the picture would come too late to be shown.
static bool lf_fragment_is_too_late(GstPad* pad, PadPair* pair, const lf::RequestHeader& head, GstClockTime pts) {
  GstEvent* event = head.probe ? nullptr : gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (!event) return false;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, pts);
  gst_event_unref(event);
  return pair->qos.late(head.view_id, time).has_value();
}

static GstFlowReturn lf_fragment_answer(LfFragment* self, GstPad* pad, GstBuffer* buffer) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  const PadPtr src = lf_fragment_other_pad(pad);
  std::string reason;
  const std::optional<lf::wire::AnyRequest> request = lf::decode_any_request_buffer(buffer, &reason);
  const GstClockTime pts = GST_BUFFER_PTS(buffer), duration = GST_BUFFER_DURATION(buffer);
  gst_buffer_unref(buffer);
  if (!src) return GST_FLOW_FLUSHING;
  if (!request) {
    self->node->stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  const lf::RequestHeader& head = lf::wire::head_of(*request);
  lf::FragmentNode::Options options;
  GST_OBJECT_LOCK(self);
  options.codec = self->codec;
  options.strip_pixels = self->strip_pixels;
  options.max_skew = self->max_skew;
  options.resampling = self->resampling;
  const bool on_card = self->renderer == lf::RendererChoice::kGl;
  const bool post = self->post_messages;
  const lf::Access access = self->access;
  const guint threads = self->threads > 0 ? self->threads : g_get_num_processors();
  GST_OBJECT_UNLOCK(self);
  if (lf::wire::access_of(*request) != access) return GST_FLOW_OK;  // for cameras of another kind
  lf_fragment_follow_requests(self, pad, pair, head);
  lf_fragment_tell_delay(self, pad, pair);
  if (on_card) {
    std::string news;
    options.card = self->card->open(news);
    if (!news.empty()) GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("%s.", news.c_str()), (nullptr));
  }
  options.in_process = lf_fragment_compositor_is_near(pair, src.get());
  options.live = pair->live;
  options.parallel = [self, threads](size_t count, const std::function<void(size_t)>& task) {
    (*self->workers)->run(threads, count, task);
  };
  options.base_time = gst_element_get_base_time(GST_ELEMENT(self));
  lf::FragmentNode::Reply reply = lf_fragment_is_too_late(pad, pair, head, pts)
                                      ? self->node->skip(*request)
                                      : self->node->answer(*request, pair->requester, options, pair->memory->take());
  if (!reply.warning.empty())
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", head.view_id, reply.warning.c_str()), (nullptr));
  for (lf::ByteBuffer* before : {&reply.brightness, &reply.moments}) {
    if (before->empty()) continue;
    GstBuffer* moments = lf::wrap_bytes(std::move(*before));
    GST_BUFFER_PTS(moments) = pts;
    GST_BUFFER_DURATION(moments) = duration;
    self->node->stats().bytes += gst_buffer_get_size(moments);
    const GstFlowReturn flow = gst_pad_push(src.get(), moments);
    if (flow != GST_FLOW_OK) return flow;
  }
  GstBuffer* out = lf::wrap_answer(std::move(reply.bytes), pair->memory);
  GST_BUFFER_PTS(out) = pts;
  GST_BUFFER_DURATION(out) = duration;
  self->node->stats().answers++;
  self->node->stats().fragments += reply.fragments;
  if (post) {
    const lf::NodeStats::Stages& s = reply.stages;
    gst_element_post_message(
        GST_ELEMENT(self),
        gst_message_new_element(
            GST_OBJECT(self),
            gst_structure_new("lightfield-answer", "view-id", G_TYPE_UINT, head.view_id, "sequence", G_TYPE_UINT,
                              head.sequence, "pts", G_TYPE_UINT64, pts, "fragments", G_TYPE_UINT,
                              static_cast<guint>(reply.fragments), "bytes", G_TYPE_UINT64,
                              static_cast<guint64>(gst_buffer_get_size(out)), "wait-ns", G_TYPE_UINT64, s.wait,
                              "decode-ns", G_TYPE_UINT64, s.decode, "render-ns", G_TYPE_UINT64, s.render, "encode-ns",
                              G_TYPE_UINT64, s.encode, nullptr)));
  }
  self->node->stats().bytes += gst_buffer_get_size(out);
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", head.view_id, head.sequence,
                 reply.fragments, gst_buffer_get_size(out));
  return gst_pad_push(src.get(), out);
}

static GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  return lf::guarded(parent, GST_FLOW_ERROR, [=] { return lf_fragment_answer(LF_FRAGMENT(parent), pad, buffer); });
}

// The cameras end with the last requester.
static void lf_fragment_finish_if_all_ended(LfFragment* self) {
  GST_OBJECT_LOCK(self);
  bool any = false, all = self->mode == lf::CameraFrames::Mode::kRunning;
  for (PadPair* pair : *self->pairs) {
    any = any || pair->ended;
    all = all && (pair->ended || !gst_pad_is_linked(pair->request.get().get()));
  }
  GST_OBJECT_UNLOCK(self);
  if (any && all) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kFinished);
}

static void lf_fragment_pair_ended(LfFragment* self, PadPair* pair) {
  GST_OBJECT_LOCK(self);
  pair->ended = true;
  GST_OBJECT_UNLOCK(self);
  lf_fragment_finish_if_all_ended(self);
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
      gst_event_unref(event);
      event = gst_event_new_caps(caps);
      gst_caps_unref(caps);
      pair->downstream_is_new = true;
      break;
    }
    case GST_EVENT_SEGMENT:
      pair->live = lf_fragment_upstream_is_live(pad);
      pair->downstream_is_new = true;
      break;
    case GST_EVENT_EOS: lf_fragment_pair_ended(self, pair); break;
    // First downstream, so that nobody gets an answer for which nothing was waited.
    case GST_EVENT_FLUSH_START: {
      const gboolean ok = lf_fragment_pair_event(pad, event);
      self->node->cancel(pair->requester, true);
      return ok;
    }
    case GST_EVENT_FLUSH_STOP:
      GST_OBJECT_LOCK(self);
      pair->ended = false;
      GST_OBJECT_UNLOCK(self);
      pair->flushed = true;
      pair->qos.clear();
      pair->requester.maker.clear();
      self->node->cancel(pair->requester, false);
      break;
    default: break;
  }
  return lf_fragment_pair_event(pad, event);
}

// Everything from downstream (QoS, navigation, latency) concerns the requester, never the cameras: what they take
// belongs to the capture, not to the request path.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE) pair->downstream_is_new = true;
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) pair->qos.see(event, pair->live);
  return lf_fragment_pair_event(pad, event);
}

static gboolean lf_fragment_src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_CAPS) return gst_pad_query_default(pad, parent, query);
  return lf_fragment_pair_query(pad, query);
}

static gboolean lf_fragment_request_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_CAPS:
    case GST_QUERY_ACCEPT_CAPS: return gst_pad_query_default(pad, parent, query);
    case GST_QUERY_ALLOCATION: return FALSE;
    default: return lf_fragment_pair_query(pad, query);
  }
}

static GstIterator* lf_fragment_internal_links(GstPad* pad, GstObject*) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (!other) return nullptr;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other.get());
  GstIterator* iterator = gst_iterator_new_single(GST_TYPE_PAD, &value);
  g_value_unset(&value);
  return iterator;
}

GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request_template, const gchar* request_name,
                             GstPadTemplate* src_template, const gchar* src_name) {
  static const GQuark quark = g_quark_from_static_string("lf-fragment-pair");
  GstPad* request = gst_pad_new_from_template(request_template, request_name);
  GstPad* src = gst_pad_new_from_template(src_template, src_name);
  const auto pair = std::make_shared<PadPair>(request, src);
  lf::accept_unit_caps(request);
  gst_pad_set_chain_function(request, lf::callback<lf_fragment_request_chain>);
  gst_pad_set_event_function(request, lf::callback<lf_fragment_request_event>);
  gst_pad_set_query_function(request, lf::callback<lf_fragment_request_query>);
  gst_pad_set_event_function(src, lf::callback<lf_fragment_src_event>);
  gst_pad_set_query_function(src, lf::callback<lf_fragment_src_query>);
  for (GstPad* pad : {src, request}) {
    gst_pad_set_iterate_internal_links_function(pad, lf::callback<lf_fragment_internal_links>);
    gst_pad_set_element_private(pad, pair.get());
    g_object_set_qdata_full(G_OBJECT(pad), quark, new std::shared_ptr<PadPair>(pair),
                            [](gpointer data) { delete static_cast<std::shared_ptr<PadPair>*>(data); });
  }
  lf::ObjectLock lock(self);
  self->pairs->insert(pair.get());
  lock.unlock();
  for (GstPad* pad : {src, request}) {
    if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
  return request;
}

void lf_fragment_pair_release(LfFragment* self, GstPad* request) {
  PadPair* pair = lf_fragment_pad_pair_of(request);
  const PadPtr src = lf_fragment_other_pad(request);
  GST_OBJECT_LOCK(self);
  self->pairs->erase(pair);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_active(src.get(), FALSE);  // an answer made without waiting goes nowhere
  self->node->cancel(pair->requester, true);
  gst_pad_set_active(request, FALSE);
  gst_element_remove_pad(GST_ELEMENT(self), src.get());
  gst_element_remove_pad(GST_ELEMENT(self), request);
  lf_fragment_finish_if_all_ended(self);
}
