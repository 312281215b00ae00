// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/picture_caps.h"

#include "common/common.h"

namespace lf {

static constexpr char kPictureCaps[] = "caps";

SharedCaps query_picture_caps(GstPad* src, guint view_id) {
  GstQuery* query = gst_query_new_custom(
      GST_QUERY_CUSTOM, gst_structure_new(LF_PICTURE_CAPS, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr));
  GstCaps* caps = nullptr;
  if (gst_pad_peer_query(src, query))
    gst_structure_get(gst_query_get_structure(query), kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  gst_query_unref(query);
  return share_caps(caps);
}

bool is_picture_caps_query(GstQuery* query, guint* view_id) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, LF_PICTURE_CAPS) &&
         gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id);
}

void answer_picture_caps_query(GstQuery* query, GstCaps* caps) {
  gst_structure_set(gst_query_writable_structure(query), kPictureCaps, GST_TYPE_CAPS, caps, nullptr);
}

GstEvent* picture_caps_event(guint view_id, GstCaps* caps) {
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM,
                              gst_structure_new(LF_PICTURE_CAPS, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, kPictureCaps,
                                                GST_TYPE_CAPS, caps, nullptr));
}

SharedCaps parse_picture_caps(GstEvent* event, guint* view_id) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !gst_event_has_name(event, LF_PICTURE_CAPS)) return nullptr;
  const GstStructure* structure = gst_event_get_structure(event);
  GstCaps* caps = nullptr;
  if (!gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id)) return nullptr;
  gst_structure_get(structure, kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  return share_caps(caps);
}

}  // namespace lf
