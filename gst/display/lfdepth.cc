// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lfdepth
 * @title: lfdepth
 * @short_description: converts a picture of a light field to the depths of its pixels
 *
 * lfdepth converts each picture of lfviewsrc or lfcompositor to a depth picture with the same size, view and time. A
 * light field is thus a source of colour and depth (RGB-D), for programs that expect a depth camera. The values are
 * distances along the optical axis of the view, in millimetres. 0 means that the depth is unknown, and 65535 means
 * 65.5 m or more. If the rig has another unit than metres, the values are thousandths of this unit.
 *
 * The depths are those of the focal surface that the picture shows. The compositor finds this surface by comparing the
 * cameras, so depths can be wrong in regions without detail. If the property focus is plane, every pixel has the depth
 * of the focal plane.
 *
 * The element reads the meta "lightfield-view" of the pictures, not their pixels. Place it before elements that change
 * the size of the pictures or drop metas. Pictures with several views (`views` of lfviewsrc) are refused.
 *
 * ## Colour and depth in two windows
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json ! tee name=t ! queue ! videoconvert ! autovideosink \
 *   t. ! queue ! lfdepth ! videoconvert ! autovideosink
 * ]|
 */
#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/common.h"
#include "compositor/view_meta.h"
#include "view/depth_image.h"

G_DECLARE_FINAL_TYPE(LfDepth, lf_depth, LF, DEPTH, GstBaseTransform)

struct _LfDepth {
  GstBaseTransform parent;
  GstVideoInfo info;  // of the output
};

G_DEFINE_TYPE(LfDepth, lf_depth, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(lfdepth, "lfdepth", GST_RANK_NONE, lf_depth_get_type())

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("video/x-raw(ANY)"));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("GRAY16_LE")));

// Both sides have the same size and frame rate. The input may have any format, in any memory.
static GstCaps* lf_depth_transform_caps(GstBaseTransform*, GstPadDirection direction, GstCaps* caps, GstCaps* filter) {
  GstCaps* other = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    const GstStructure* given = gst_caps_get_structure(caps, i);
    GstStructure* structure = gst_structure_new_empty("video/x-raw");
    for (const char* field : {"width", "height", "framerate", "pixel-aspect-ratio"})
      if (const GValue* value = gst_structure_get_value(given, field)) gst_structure_set_value(structure, field, value);
    if (direction == GST_PAD_SINK) {
      gst_structure_set(structure, "format", G_TYPE_STRING, "GRAY16_LE", nullptr);
      other = gst_caps_merge_structure(other, structure);
    } else {
      other = gst_caps_merge_structure_full(other, structure, gst_caps_features_new_any());
    }
  }
  return lf::filter_caps(other, filter);
}

static gboolean lf_depth_set_caps(GstBaseTransform* base, GstCaps*, GstCaps* out) {
  return gst_video_info_from_caps(&LF_DEPTH(base)->info, out);
}

static gboolean lf_depth_transform_size(GstBaseTransform* base, GstPadDirection direction, GstCaps*, gsize size,
                                        GstCaps*, gsize* other) {
  *other = direction == GST_PAD_SINK ? GST_VIDEO_INFO_SIZE(&LF_DEPTH(base)->info) : size;
  return TRUE;
}

static uint16_t millimetres(float depth) { return static_cast<uint16_t>(std::lround(std::min(1000 * depth, 65535.f))); }

static GstFlowReturn lf_depth_transform(GstBaseTransform* base, GstBuffer* in, GstBuffer* out) {
  LfDepth* self = LF_DEPTH(base);
  GstCustomMeta* meta = gst_buffer_get_custom_meta(in, LF_VIEW_META);
  if (!meta) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("A picture has no description of its view (%s). Place lfdepth directly behind lfviewsrc or "
                       "lfcompositor.",
                       LF_VIEW_META),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const std::optional<lf::View> view = lf::view_of_picture(gst_custom_meta_get_structure(meta));
  if (!view) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("A picture shows several views. lfdepth needs pictures of a single view: set views=mono at "
                       "lfviewsrc or lfviewrequest."),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const gint width = GST_VIDEO_INFO_WIDTH(&self->info), height = GST_VIDEO_INFO_HEIGHT(&self->info);
  if (view->width != width || view->height != height) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("A picture of %dx%d pixels was scaled to %dx%d. Place lfdepth before the element that scales.",
                       view->width, view->height, width, height),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  GstVideoFrame frame;
  if (!gst_video_frame_map(&frame, &self->info, out, GST_MAP_WRITE)) return GST_FLOW_ERROR;
  const lf::DepthImage image = lf::depth_image(*view);
  for (gint y = 0; y < height; y++) {
    auto* const row = reinterpret_cast<uint16_t*>(static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)) +
                                                  y * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0));
    std::transform(image.depths.begin() + static_cast<ptrdiff_t>(y) * width,
                   image.depths.begin() + static_cast<ptrdiff_t>(y + 1) * width, row,
                   [](float depth) { return GUINT16_TO_LE(millimetres(depth)); });
  }
  gst_video_frame_unmap(&frame);
  return GST_FLOW_OK;
}

static void lf_depth_class_init(LfDepthClass* klass) {
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field depth", "Filter/Converter/Video",
                                        "Converts a picture of a light field to the depths of its pixels",
                                        "gst-lightfield developers");
  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = lf::callback<lf_depth_transform_caps>;
  transform_class->set_caps = lf::callback<lf_depth_set_caps>;
  transform_class->transform_size = lf::callback<lf_depth_transform_size>;
  transform_class->transform = lf::callback<lf_depth_transform>;
}

static void lf_depth_init(LfDepth* self) { gst_video_info_init(&self->info); }
