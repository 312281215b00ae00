// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gl/gl.h>

#include "fragment/lffragment_private.h"

G_DEFINE_FINAL_TYPE(LfFragmentPad, lf_fragment_pad, GST_TYPE_PAD)

lf::PropertyTable<LfFragmentPadSettings>& LfFragmentPadSettings::properties() {
  static lf::PropertyTable<LfFragmentPadSettings> table = {lf::property<&LfFragmentPadSettings::camera>(
      lf::kWhileReady, "camera", "Camera",
      "Id of this pad's camera in the rig (-1: as the stream of lfcamsrc says, else the pad's number)", -1, G_MAXINT)};
  return table;
}

static LfFragmentPadSettings& settings_of(LfFragmentPad* pad) { return pad->settings; }

static void lf_fragment_pad_finalize(GObject* object) {
  delete LF_FRAGMENT_PAD(object)->input;
  G_OBJECT_CLASS(lf_fragment_pad_parent_class)->finalize(object);
}

static void lf_fragment_pad_class_init(LfFragmentPadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_fragment_pad_finalize;
  lf::Properties<settings_of>::install(object_class);
}

static void lf_fragment_pad_init(LfFragmentPad* pad) { pad->settings = {}; }

static gboolean lf_fragment_camera_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  lf::CameraInputs& inputs = LF_FRAGMENT(parent)->state->node.inputs();
  lf::CameraInput& input = *LF_FRAGMENT_PAD(pad)->input;
  gboolean ok = TRUE;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CUSTOM_DOWNSTREAM_STICKY: {
      const GstStructure* structure = gst_event_get_structure(event);
      guint camera;
      if (gst_structure_has_name(structure, LF_CAMERA_EVENT) && gst_structure_get_uint(structure, "camera", &camera))
        input.name(camera);
      gboolean paced = FALSE;
      if (gst_structure_get_boolean(structure, "paced", &paced) && paced) input.note_paced();
      break;
    }
    case GST_EVENT_CAPS: {
      GstCaps* caps;
      gst_event_parse_caps(event, &caps);
      ok = input.set_caps(caps);
      break;
    }
    case GST_EVENT_SEGMENT: input.start_stream(lf::live_latency(pad)); break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
      if (!gst_event_has_name(event, LF_CAMERA_LOST)) break;
      inputs.give_up(input.frames());
      input.frames()->lose_stream();
      break;
    case GST_EVENT_EOS:
      inputs.give_up(input.frames());
      input.frames()->end_stream();
      break;
    case GST_EVENT_FLUSH_START: input.frames()->set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: input.frames()->set_flushing(false); break;
    default: break;
  }
  gst_event_unref(event);  // a camera's events end here: answers follow the requests
  return ok;
}

// How many frames are kept here as long as requests do not look further back: a pool needs as many more.
static gboolean lf_fragment_propose_allocation(GstPad* pad, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  if (caps && gst_structure_has_name(gst_caps_get_structure(caps, 0), "video/x-raw") &&
      gst_video_info_from_caps(&info, caps)) {
    const size_t kept = lf::live_latency(pad) ? lf::CameraFrames::kLiveFrames : lf::CameraFrames::kFileFrames;
    gst_query_add_allocation_pool(query, nullptr, static_cast<guint>(info.size), static_cast<guint>(kept + 1), 0);
  }
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  gst_query_add_allocation_meta(query, GST_GL_SYNC_META_API_TYPE, nullptr);
  return TRUE;
}

static gboolean lf_fragment_camera_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION) return lf_fragment_propose_allocation(pad, query);
  return gst_pad_query_default(pad, parent, query);
}

static GstFlowReturn lf_fragment_camera_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  return lf::guarded_buffer(parent, [=] {
    lf_fragment_trim_memory(LF_FRAGMENT(parent));
    const GstSegment* segment = nullptr;
    g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
    if (event) gst_event_parse_segment(event, &segment);
    return LF_FRAGMENT_PAD(pad)->input->take(buffer, segment);
  });
}

GstPad* lf_fragment_camera_pad_new(LfFragment* self, GstPadTemplate* templ, const gchar* name) {
  LfFragmentPad* pad = static_cast<LfFragmentPad*>(
      g_object_new(LF_TYPE_FRAGMENT_PAD, "name", name, "direction", templ->direction, "template", templ, nullptr));
  pad->input = new lf::CameraInput(self, pad, self->state->node);
  GST_PAD_SET_ACCEPT_INTERSECT(GST_PAD(pad));  // a card's caps may leave out the kind of texture, where it is 2D
  gst_pad_set_chain_function(GST_PAD(pad), lf::callback<lf_fragment_camera_chain>);
  gst_pad_set_event_function(GST_PAD(pad), lf::callback<lf_fragment_camera_event>);
  gst_pad_set_query_function(GST_PAD(pad), lf::callback<lf_fragment_camera_query>);
  return GST_PAD(pad);
}
