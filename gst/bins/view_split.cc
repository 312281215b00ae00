// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/view_split.h"

#include <string>

#include "common/common.h"
#include "wire/bytes.h"

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

// The pad of the view that a unit is of; null where there is none, or it is no unit. All units of either stream have
// the view's id in the same place (lib/wire/spec.md).
static GstPad* pad_of(LfViewSplit* self, GstBuffer* unit) {
  guint8 bytes[4];
  if (gst_buffer_extract(unit, 12, bytes, sizeof bytes) != sizeof bytes) return nullptr;
  return gst_element_get_static_pad(GST_ELEMENT(self), pad_name(lf::wire::Reader(bytes).get<uint32_t>()).c_str());
}

static GstFlowReturn lf_view_split_chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  if (GstPad* pad = pad_of(LF_VIEW_SPLIT(parent), buffer)) {
    gst_pad_push(pad, buffer);
    gst_object_unref(pad);
  } else {
    gst_buffer_unref(buffer);
  }
  return GST_FLOW_OK;
}

// By itself a pad keeps caps for itself. Whoever does not take them does not keep them from the others.
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

GstPad* lf_view_split_add_view(LfViewSplit* self, guint view_id) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "src_%u");
  GstPad* pad = gst_pad_new_from_template(templ, pad_name(view_id).c_str());
  gst_pad_set_active(pad, TRUE);
  // No event passes between what is copied and what the pad gets itself.
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
                                        "Gives each unit to the viewer of its view", "gst-lightfield");
}

static void lf_view_split_init(LfViewSplit* self) {
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, lf::callback<lf_view_split_chain>);
  gst_pad_set_event_function(self->sink, lf::callback<lf_view_split_event>);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
}
