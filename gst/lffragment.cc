// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lffragment
 * @title: lffragment
 * @short_description: the random access camera: answers view requests with its cameras' fragments
 *
 * Takes the video of one or more cameras of a rig on its `sink_%u` pads and view requests on `request`. Each request is
 * answered with one buffer on `src`: every camera's own weighted contribution to the requested view, warped through the
 * requested focal plane, in a tight rectangle. `lfcompositor` adds the fragments up. Further requesters use the pads
 * `request_%u`, each paired with a `src_%u`.
 *
 * Live cameras are never waited for: the frame nearest to the requested capture time is used. Frames of other cameras
 * (files) are waited for, so that files in give the same files out on every machine, and are read no faster than
 * requests move on.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lffragment name=n rig=rig.json ! c.sink_0  lfcamsrc rig=rig.json camera=0 ! n.sink_0 \
 *   lfcamsrc rig=rig.json camera=1 ! n.sink_1  lfcamsrc rig=rig.json camera=8 ! n.sink_2 \
 *   r. ! queue ! c.request  lfcompositor name=c ! videoconvert ! autovideosink
 * ]|
 */

#include "lffragment.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <set>

#include "base/error.h"
#include "camera_image.h"
#include "common.h"
#include "fragment_node.h"
#include "gst_wire.h"
#include "wire/request_codec.h"

GST_DEBUG_CATEGORY_STATIC(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

namespace {

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST,
                            GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS ", I420 }")));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE));
GstStaticPadTemplate more_request_template =
    GST_STATIC_PAD_TEMPLATE("request_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE));
GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_MEDIA_TYPE));
GstStaticPadTemplate more_src_template =
    GST_STATIC_PAD_TEMPLATE("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(LF_ANSWER_MEDIA_TYPE));

// One requester: a request pad and the answer pad it pairs with.
struct Lane {
  GstPad* request = nullptr;
  GstPad* src = nullptr;
  lf::FragmentNode::Requester requester;
  bool live = false;   // requests come in real time; known from the segment on
  bool ended = false;  // has sent EOS; under the object lock of the element
};

bool upstream_is_live(GstPad* sink) {
  GstQuery* query = gst_query_new_latency();
  gboolean live = FALSE;
  if (gst_pad_peer_query(sink, query)) gst_query_parse_latency(query, &live, nullptr, nullptr);
  gst_query_unref(query);
  return live;
}

}  // namespace

// ---------------------------------------------------------------------------------------------- camera input pads

struct _LfFragmentPad {
  GstPad parent;
  gint camera;  // id in the rig, -1: told by the stream, else the pad's number
  struct Input {
    std::shared_ptr<lf::CameraFrames> frames;
    std::optional<GstVideoInfo> new_format;         // from the caps, until the next frame
    std::unique_ptr<lf::FrameConverter> converter;
    lf::CameraIndex index = lf::MeshFace::kNone;    // once known
    lf::CameraIndex from_stream = lf::MeshFace::kNone;
    bool live = false;                              // known from the segment on
  }* input;
};

G_DEFINE_FINAL_TYPE(LfFragmentPad, lf_fragment_pad, GST_TYPE_PAD)

enum { PAD_PROP_0, PAD_PROP_CAMERA };

static void lf_fragment_pad_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragmentPad* pad = LF_FRAGMENT_PAD(object);
  if (id == PAD_PROP_CAMERA)
    pad->camera = g_value_get_int(value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
}

static void lf_fragment_pad_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfFragmentPad* pad = LF_FRAGMENT_PAD(object);
  if (id == PAD_PROP_CAMERA)
    g_value_set_int(value, pad->camera);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
}

static void lf_fragment_pad_finalize(GObject* object) {
  delete LF_FRAGMENT_PAD(object)->input;
  G_OBJECT_CLASS(lf_fragment_pad_parent_class)->finalize(object);
}

static void lf_fragment_pad_class_init(LfFragmentPadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf_fragment_pad_set_property;
  object_class->get_property = lf_fragment_pad_get_property;
  object_class->finalize = lf_fragment_pad_finalize;
  g_object_class_install_property(
      object_class, PAD_PROP_CAMERA,
      g_param_spec_int("camera", "Camera",
                       "Id of this pad's camera in the rig (-1: as the stream of lfcamsrc says, else the pad's number)", -1,
                       G_MAXINT, -1,
                       GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}

static void lf_fragment_pad_init(LfFragmentPad* pad) {
  pad->camera = -1;
  pad->input = new _LfFragmentPad::Input;
}

// ------------------------------------------------------------------------------------------------------- element

struct _LfFragment {
  GstElement parent;
  gchar* rig_path;
  guint node_id;
  lf::FragmentNode* node;
  std::set<Lane*>* lanes;  // under the object lock
  lf::CameraFrames::Mode mode;  // of all cameras; under the object lock
  guint next_camera_pad, next_lane;
};

// The camera pads' properties, for gst-launch's `sink_0::camera=5`.
static GObject* lf_fragment_child_by_index(GstChildProxy* proxy, guint index) {
  GObject* child = nullptr;
  GST_OBJECT_LOCK(proxy);
  for (GList* item = GST_ELEMENT(proxy)->sinkpads; item && !child; item = item->next)
    if (LF_IS_FRAGMENT_PAD(item->data) && index-- == 0) child = G_OBJECT(gst_object_ref(item->data));
  GST_OBJECT_UNLOCK(proxy);
  return child;
}

static guint lf_fragment_children_count(GstChildProxy* proxy) {
  guint count = 0;
  GST_OBJECT_LOCK(proxy);
  for (GList* item = GST_ELEMENT(proxy)->sinkpads; item; item = item->next) count += LF_IS_FRAGMENT_PAD(item->data);
  GST_OBJECT_UNLOCK(proxy);
  return count;
}

static void lf_fragment_child_proxy_init(gpointer iface, gpointer) {
  GstChildProxyInterface* proxy = static_cast<GstChildProxyInterface*>(iface);
  proxy->get_child_by_index = lf_fragment_child_by_index;
  proxy->get_children_count = lf_fragment_children_count;
}

G_DEFINE_FINAL_TYPE_WITH_CODE(LfFragment, lf_fragment, GST_TYPE_ELEMENT,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_CHILD_PROXY, lf_fragment_child_proxy_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lffragment, "lffragment", GST_RANK_NONE, LF_TYPE_FRAGMENT,
                                      GST_DEBUG_CATEGORY_INIT(lf_fragment_debug, "lffragment", 0, "random access camera"))

enum { PROP_0, PROP_RIG, PROP_NODE, PROP_STATS };

static GstStructure* lf_fragment_stats(LfFragment* self) {
  const lf::FragmentNode::Stats& s = self->node->stats();
  return gst_structure_new("application/x-lightfield-fragment-stats",                       //
                           "requests", G_TYPE_UINT64, s.requests.load(),                    //
                           "bad-requests", G_TYPE_UINT64, s.bad_requests.load(),            //
                           "rig-mismatches", G_TYPE_UINT64, s.rig_mismatches.load(),        //
                           "answers", G_TYPE_UINT64, s.answers.load(),                      //
                           "fragments", G_TYPE_UINT64, s.fragments.load(),                  //
                           "bytes", G_TYPE_UINT64, s.bytes.load(),                          //
                           "missing-frames", G_TYPE_UINT64, s.missing_frames.load(),        //
                           "wait-ns", G_TYPE_UINT64, s.wait_ns.load(),                      //
                           "render-ns", G_TYPE_UINT64, s.render_ns.load(),                  //
                           "max-skew-ns", G_TYPE_UINT64, s.max_skew_ns.load(), nullptr);
}

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_RIG:
      g_free(self->rig_path);
      self->rig_path = g_value_dup_string(value);
      break;
    case PROP_NODE: self->node_id = g_value_get_uint(value); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

static void lf_fragment_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_RIG: g_value_set_string(value, self->rig_path); break;
    case PROP_NODE: g_value_set_uint(value, self->node_id); break;
    case PROP_STATS: g_value_take_boxed(value, lf_fragment_stats(self)); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

// Which camera this pad has; posts an error and returns false if there is none such or another pad has it.
static bool lf_fragment_assign_camera(LfFragment* self, LfFragmentPad* pad) {
  auto& input = *pad->input;
  if (input.index != lf::MeshFace::kNone) return true;
  const lf::Rig* rig = self->node->rig().get();
  if (!rig) return false;  // the state change has failed with an error already
  const guint number = static_cast<guint>(g_ascii_strtoull(GST_PAD_NAME(pad) + strlen("sink_"), nullptr, 10));
  std::optional<lf::CameraIndex> index;
  guint id = number;
  if (pad->camera >= 0) {
    id = static_cast<guint>(pad->camera);
    index = rig->index_of_id(id);
  } else if (input.from_stream < rig->cameras.size()) {
    index = input.from_stream;
  } else {
    index = rig->index_of_id(id);
  }
  if (!index) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("Pad %s: the rig %s has no camera %u.", GST_PAD_NAME(pad), self->rig_path, id),
                      ("%zu cameras in the rig", rig->cameras.size()));
    return false;
  }
  if (!self->node->add_camera(*index, input.frames)) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("Pad %s: camera %u has a pad already.", GST_PAD_NAME(pad), rig->cameras[*index].id), (nullptr));
    return false;
  }
  input.index = *index;
  return true;
}

// Only at the first frame of a format: which camera it is comes after the caps.
static bool lf_fragment_set_camera_format(LfFragment* self, LfFragmentPad* pad, const GstVideoInfo& info) {
  if (!lf_fragment_assign_camera(self, pad)) return false;
  const lf::Camera& camera = self->node->rig()->cameras[pad->input->index];
  if (info.width != camera.width || info.height != camera.height) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("Pad %s: the video of camera %u has %dx%d pixels, the rig %s says %dx%d.", GST_PAD_NAME(pad),
                       camera.id, info.width, info.height, self->rig_path, camera.width, camera.height),
                      (nullptr));
    return false;
  }
  const lf::PixelFamily family = self->node->agree_on_family(lf::family_of(info));
  pad->input->converter = std::make_unique<lf::FrameConverter>(info, family);
  return true;
}

static gboolean lf_fragment_camera_event(GstPad* gst_pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  LfFragmentPad* pad = LF_FRAGMENT_PAD(gst_pad);
  gboolean ok = TRUE;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CUSTOM_DOWNSTREAM_STICKY: {
      const GstStructure* structure = gst_event_get_structure(event);
      guint camera;
      if (gst_structure_has_name(structure, LF_CAMERA_EVENT) && gst_structure_get_uint(structure, "camera", &camera))
        pad->input->from_stream = camera;
      break;
    }
    case GST_EVENT_CAPS: {
      GstCaps* caps;
      gst_event_parse_caps(event, &caps);
      GstVideoInfo info;
      ok = gst_video_info_from_caps(&info, caps);
      if (ok) pad->input->new_format = info;
      break;
    }
    case GST_EVENT_SEGMENT:
      pad->input->live = upstream_is_live(gst_pad);
      pad->input->frames->start_stream(pad->input->live);
      break;
    case GST_EVENT_EOS:
      if (pad->input->index == lf::MeshFace::kNone) self->node->give_up(pad->input->frames);
      pad->input->frames->end_stream();
      break;
    case GST_EVENT_FLUSH_START: pad->input->frames->set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: pad->input->frames->set_flushing(false); break;
    default: break;
  }
  gst_event_unref(event);  // a camera's events end here: answers follow the requests
  return ok;
}

static gboolean lf_fragment_camera_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION) {
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
    return TRUE;
  }
  return gst_pad_query_default(pad, parent, query);
}

// Running time of a frame's capture: the stamp that lfcamsrc left, else PTS and the rig's time offset.
static uint64_t lf_fragment_capture_time(LfFragment* self, GstPad* pad, GstBuffer* buffer, const lf::Camera& camera,
                                         bool live) {
  static GstStaticCaps reference_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&reference_caps);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference);
  gst_caps_unref(reference);
  if (meta) {
    const GstClockTime base = live ? gst_element_get_base_time(GST_ELEMENT(self)) : 0;
    return meta->timestamp - MIN(meta->timestamp, base);
  }
  uint64_t running = 0;
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment;
    gst_event_parse_segment(event, &segment);
    const guint64 time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    if (GST_CLOCK_TIME_IS_VALID(time)) running = time;
    gst_event_unref(event);
  }
  const gint64 offset = static_cast<gint64>(camera.time_offset * GST_SECOND);
  return offset < 0 && static_cast<uint64_t>(-offset) > running ? 0 : running + static_cast<uint64_t>(offset);
}

static GstFlowReturn lf_fragment_camera_chain(GstPad* gst_pad, GstObject* parent, GstBuffer* buffer) {
  LfFragment* self = LF_FRAGMENT(parent);
  LfFragmentPad* pad = LF_FRAGMENT_PAD(gst_pad);
  auto& input = *pad->input;
  if (input.new_format) {
    input.converter.reset();
    lf_fragment_set_camera_format(self, pad, *input.new_format);
    input.new_format.reset();
  }
  if (!input.converter) {
    gst_buffer_unref(buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  const lf::Camera& camera = self->node->rig()->cameras[input.index];
  const uint64_t time = lf_fragment_capture_time(self, gst_pad, buffer, camera, input.live);
  lf::CameraFrame frame = input.converter->convert(buffer);
  if (!frame.buffer) {
    GST_WARNING_OBJECT(gst_pad, "dropped a frame that can't be mapped");
    return GST_FLOW_OK;
  }
  frame.time = time;
  return input.frames->push(std::move(frame));
}

// ------------------------------------------------------------------------------------------------- request lanes

static Lane* lane_of(GstPad* pad) { return static_cast<Lane*>(gst_pad_get_element_private(pad)); }

static GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  LfFragment* self = LF_FRAGMENT(parent);
  Lane* lane = lane_of(pad);
  std::string reason;
  const std::optional<lf::ViewRequest> request = lf::decode_request_buffer(buffer, &reason);
  const GstClockTime pts = GST_BUFFER_PTS(buffer), duration = GST_BUFFER_DURATION(buffer);
  gst_buffer_unref(buffer);
  if (!request) {
    self->node->stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  std::string warning;
  const lf::wire::Answer answer = self->node->answer(*request, lane->requester, gst_element_get_base_time(GST_ELEMENT(self)),
                                                     lane->live, warning);
  if (!warning.empty()) GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", request->view_id, warning.c_str()), (nullptr));
  GstBuffer* out = lf::encode_answer_buffer(answer);
  GST_BUFFER_PTS(out) = pts;
  GST_BUFFER_DURATION(out) = duration;
  self->node->stats().answers++;
  self->node->stats().fragments += answer.fragments.size();
  self->node->stats().bytes += gst_buffer_get_size(out);
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", request->view_id, request->sequence,
                 answer.fragments.size(), gst_buffer_get_size(out));
  return gst_pad_push(lane->src, out);
}

static void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode) {
  GST_OBJECT_LOCK(self);
  self->mode = mode;
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next) {
    if (!LF_IS_FRAGMENT_PAD(item->data)) continue;
    auto& input = *LF_FRAGMENT_PAD(item->data)->input;
    input.frames->set_mode(mode);
    if (mode == lf::CameraFrames::Mode::kRunning) self->node->expect_input(input.frames);
  }
  GST_OBJECT_UNLOCK(self);
  self->node->set_running(mode == lf::CameraFrames::Mode::kRunning);
}

static void lf_fragment_lane_ended(LfFragment* self, Lane* lane) {
  GST_OBJECT_LOCK(self);
  lane->ended = true;
  const bool all = std::all_of(self->lanes->begin(), self->lanes->end(),
                               [](const Lane* l) { return l->ended || !gst_pad_is_linked(l->request); });
  GST_OBJECT_UNLOCK(self);
  if (!all) return;
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kFinished);
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  Lane* lane = lane_of(pad);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = gst_caps_new_empty_simple(LF_ANSWER_MEDIA_TYPE);
      gst_event_unref(event);
      event = gst_event_new_caps(caps);
      gst_caps_unref(caps);
      break;
    }
    case GST_EVENT_SEGMENT: lane->live = upstream_is_live(pad); break;
    case GST_EVENT_EOS: lf_fragment_lane_ended(self, lane); break;
    default: break;
  }
  return gst_pad_push_event(lane->src, event);
}

// Everything from downstream (QoS, navigation, latency) concerns the requester, never the cameras: what they take
// belongs to the capture, not to the request path.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  return gst_pad_push_event(lane_of(pad)->request, event);
}

static gboolean lf_fragment_src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_CAPS) return gst_pad_query_default(pad, parent, query);
  return gst_pad_peer_query(lane_of(pad)->request, query);
}

static gboolean lf_fragment_request_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_CAPS:
    case GST_QUERY_ACCEPT_CAPS: return gst_pad_query_default(pad, parent, query);
    case GST_QUERY_ALLOCATION: return FALSE;
    default: return gst_pad_peer_query(lane_of(pad)->src, query);
  }
}

static GstIterator* lf_fragment_internal_links(GstPad* pad, GstObject*) {
  GstPad* other = GST_PAD_IS_SRC(pad) ? lane_of(pad)->request : lane_of(pad)->src;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other);
  GstIterator* iterator = gst_iterator_new_single(GST_TYPE_PAD, &value);
  g_value_unset(&value);
  return iterator;
}

static Lane* lf_fragment_new_lane(LfFragment* self, GstPadTemplate* request, const gchar* request_name, GstPadTemplate* src,
                                  const gchar* src_name) {
  Lane* lane = new Lane;
  lane->request = gst_pad_new_from_template(request, request_name);
  lane->src = gst_pad_new_from_template(src, src_name);
  gst_pad_set_chain_function(lane->request, lf_fragment_request_chain);
  gst_pad_set_event_function(lane->request, lf_fragment_request_event);
  gst_pad_set_query_function(lane->request, lf_fragment_request_query);
  gst_pad_set_event_function(lane->src, lf_fragment_src_event);
  gst_pad_set_query_function(lane->src, lf_fragment_src_query);
  for (GstPad* pad : {lane->request, lane->src}) {
    gst_pad_set_iterate_internal_links_function(pad, lf_fragment_internal_links);
    gst_pad_set_element_private(pad, lane);
  }
  GST_OBJECT_LOCK(self);
  self->lanes->insert(lane);
  GST_OBJECT_UNLOCK(self);
  gst_element_add_pad(GST_ELEMENT(self), lane->src);
  gst_element_add_pad(GST_ELEMENT(self), lane->request);
  return lane;
}

// ------------------------------------------------------------------------------------------------- pads come and go

static guint number_of(const gchar* name, const gchar* prefix, guint* next) {
  guint number = *next;
  if (name && g_str_has_prefix(name, prefix))
    number = static_cast<guint>(g_ascii_strtoull(name + strlen(prefix), nullptr, 10));
  *next = MAX(*next, number + 1);
  return number;
}

static GstPad* lf_fragment_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar* name, const GstCaps*) {
  LfFragment* self = LF_FRAGMENT(element);
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(element);
  if (templ == gst_element_class_get_pad_template(klass, "request_%u")) {
    const guint number = number_of(name, "request_", &self->next_lane);
    g_autofree gchar* request_name = g_strdup_printf("request_%u", number);
    g_autofree gchar* src_name = g_strdup_printf("src_%u", number);
    return lf_fragment_new_lane(self, templ, request_name, gst_element_class_get_pad_template(klass, "src_%u"), src_name)->request;
  }
  g_autofree gchar* pad_name = g_strdup_printf("sink_%u", number_of(name, "sink_", &self->next_camera_pad));
  LfFragmentPad* pad = static_cast<LfFragmentPad*>(g_object_new(LF_TYPE_FRAGMENT_PAD, "name", pad_name, "direction",
                                                                templ->direction, "template", templ, nullptr));
  pad->input->frames = std::make_shared<lf::CameraFrames>();
  GST_OBJECT_LOCK(self);
  pad->input->frames->set_mode(self->mode);
  if (self->mode == lf::CameraFrames::Mode::kRunning) self->node->expect_input(pad->input->frames);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_chain_function(GST_PAD(pad), lf_fragment_camera_chain);
  gst_pad_set_event_function(GST_PAD(pad), lf_fragment_camera_event);
  gst_pad_set_query_function(GST_PAD(pad), lf_fragment_camera_query);
  gst_element_add_pad(element, GST_PAD(pad));
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), pad_name);
  return GST_PAD(pad);
}

static void lf_fragment_release_pad(GstElement* element, GstPad* pad) {
  LfFragment* self = LF_FRAGMENT(element);
  if (LF_IS_FRAGMENT_PAD(pad)) {
    auto& input = *LF_FRAGMENT_PAD(pad)->input;
    input.frames->set_flushing(true);
    self->node->give_up(input.frames);
    gst_child_proxy_child_removed(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_PAD_NAME(pad));
    gst_element_remove_pad(element, pad);
    return;
  }
  Lane* lane = lane_of(pad);
  GST_OBJECT_LOCK(self);
  self->lanes->erase(lane);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_active(lane->request, FALSE);
  gst_pad_set_active(lane->src, FALSE);
  gst_element_remove_pad(element, lane->src);
  gst_element_remove_pad(element, lane->request);
  delete lane;
}

// ---------------------------------------------------------------------------------------------------- life cycle

static bool lf_fragment_start(LfFragment* self) {
  if (!self->rig_path) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("No rig file given: set the property \"rig\"."), (nullptr));
    return false;
  }
  try {
    self->node->set_rig(lf::shared_rig(self->rig_path));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
  self->node->set_node_id(self->node_id);
  self->node->forget_family();
  GST_OBJECT_LOCK(self);
  for (Lane* lane : *self->lanes) {
    lane->ended = false;
    lane->requester.mesh.clear();
  }
  GST_OBJECT_UNLOCK(self);
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  return true;
}

static gboolean lf_fragment_forget_frames(GstElement* element, GstPad* pad, gpointer) {
  if (!LF_IS_FRAGMENT_PAD(pad)) return TRUE;
  auto& input = *LF_FRAGMENT_PAD(pad)->input;
  LF_FRAGMENT(element)->node->give_up(input.frames);
  input.frames->clear();
  input.converter.reset();
  input.new_format.reset();
  input.index = input.from_stream = lf::MeshFace::kNone;
  return TRUE;
}

static GstStateChangeReturn lf_fragment_change_state(GstElement* element, GstStateChange transition) {
  LfFragment* self = LF_FRAGMENT(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !lf_fragment_start(self)) return GST_STATE_CHANGE_FAILURE;
  // Pads are deactivated by the parent class, which waits for their streaming threads: wake these first.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_fragment_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    gst_element_foreach_sink_pad(element, lf_fragment_forget_frames, nullptr);
  return result;
}

static void lf_fragment_finalize(GObject* object) {
  LfFragment* self = LF_FRAGMENT(object);
  for (Lane* lane : *self->lanes) delete lane;
  delete self->lanes;
  delete self->node;
  g_free(self->rig_path);
  G_OBJECT_CLASS(lf_fragment_parent_class)->finalize(object);
}

static void lf_fragment_class_init(LfFragmentClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  object_class->set_property = lf_fragment_set_property;
  object_class->get_property = lf_fragment_get_property;
  object_class->finalize = lf_fragment_finalize;
  element_class->change_state = lf_fragment_change_state;
  element_class->request_new_pad = lf_fragment_request_new_pad;
  element_class->release_pad = lf_fragment_release_pad;

  g_object_class_install_property(
      object_class, PROP_RIG,
      g_param_spec_string("rig", "Rig", "Rig file (rig.json) of the whole array; required", nullptr,
                          GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property(
      object_class, PROP_NODE,
      g_param_spec_uint("node", "Node", "Number of this node, carried in its answers", 0, G_MAXUINT, 0,
                        GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property(
      object_class, PROP_STATS,
      g_param_spec_boxed("stats", "Statistics",
                         "Counts of requests, answers, fragments, bytes and frames that were missing; the latest answer's "
                         "time waited for frames and spent rendering, the largest skew of a frame (nanoseconds)",
                         GST_TYPE_STRUCTURE, GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, LF_TYPE_FRAGMENT_PAD);
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field random access camera", "Filter/Video",
      "Answers view requests with the fragments that its cameras contribute to the requested view",
      "gst-lightfield developers");
  gst_type_mark_as_plugin_api(LF_TYPE_FRAGMENT_PAD, GstPluginAPIFlags(0));
}

static void lf_fragment_init(LfFragment* self) {
  self->node = new lf::FragmentNode;
  self->lanes = new std::set<Lane*>;
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(self);
  lf_fragment_new_lane(self, gst_element_class_get_pad_template(klass, "request"), "request",
                       gst_element_class_get_pad_template(klass, "src"), "src");
}
