// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lflenticular
 * @title: lflenticular
 * @short_description: converts a quilt of views to the image of a lenticular display
 *
 * lflenticular converts a quilt (one picture that contains many views in rows and columns) to the image of a lenticular
 * light field display. lfviewsrc and lfcompositor produce quilts with views=quilt or views=row. A lenticular display
 * has a sheet of slanted cylindrical lenses in front of its pixels. Each lens shows a different subpixel column in each
 * viewing direction. Therefore the element takes each red, green and blue subpixel from the view that is visible in its
 * direction.
 *
 * The image must reach the display without scaling, so the output caps must have the native resolution of the display.
 * Adjust `centre` until the middle view is visible from straight ahead, and set `reversed` if depth appears inverted. A
 * lens that covers N pixels of a row has 3 N subpixels.
 *
 * ## A display of 2560x1600 pixels with lenses 9.3 pixels wide, leaning 12 degrees to the left
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json views=quilt columns=8 rows=6 view-cone=7 width=420 height=262 framerate=5/1 ! \
 *   videoconvert ! lflenticular columns=8 rows=6 lens-pitch=9.3 slant=-12 ! video/x-raw,width=2560,height=1600 ! \
 *   videoconvert ! autovideosink
 * ]|
 */
#include <gst/video/gstvideofilter.h>
#include <gst/video/video.h>

#include <algorithm>
#include <memory>

#include "base/worker_pool.h"
#include "common/common.h"
#include "common/properties.h"
#include "view/view.h"

namespace {

struct Settings : lf::LenticularDisplay {
  gint columns = lf::ViewSet().columns, rows = lf::ViewSet().rows;
  Settings() { lens_pitch = 8; }

  static lf::PropertyTable<Settings>& properties() {
    using S = Settings;
    constexpr double kMaxPixels = 16384, kMaxSlant = 80, kMaxCentre = 1e6;
    static lf::PropertyTable<S> table = {
        lf::property<&S::columns>(lf::kWhilePlaying, "columns", "Columns",
                                  "Number of columns in the input quilt. A quilt is one picture that contains a grid "
                                  "of views, each from a slightly different viewpoint. Use the same number as the "
                                  "source of the quilt, for example the `columns` property of lfviewsrc",
                                  1, lf::ViewSetPosition::kMaxViews),
        lf::property<&S::rows>(lf::kWhilePlaying, "rows", "Rows",
                               "Number of rows in the input quilt. Use the same number as the source of the quilt. "
                               "View 0 is at the bottom left",
                               1, lf::ViewSetPosition::kMaxViews),
        lf::inherited_property<S, &S::lens_pitch>(
            lf::kWhilePlaying, "lens-pitch", "Lens pitch",
            "Width of a lens along a pixel row of the display, in pixels. Data sheets usually state p lenses per inch, "
            "D pixels per inch and the slant a. The width is then D / (p cos a). A wrong width causes bands that move "
            "across the picture",
            0.5, kMaxPixels),
        lf::inherited_property<S, &S::slant>(lf::kWhilePlaying, "slant", "Slant",
                                             "Angle between the lenses and the vertical, in degrees, as in the data "
                                             "sheet of the display. At positive angles, the lenses lean to the right",
                                             -kMaxSlant, kMaxSlant),
        lf::inherited_property<S, &S::centre>(
            lf::kWhilePlaying, "centre", "Centre",
            "Horizontal distance from the centre of the display to the centre of a lens, in lens widths, positive to "
            "the right. Adjust it until the middle view is visible from straight ahead",
            -kMaxCentre, kMaxCentre),
        lf::inherited_property<S, &S::reversed>(lf::kWhilePlaying, "reversed", "Reversed",
                                                "If true, the order of the views behind each lens is reversed. Set "
                                                "this if near objects appear far away, and far objects appear near")};
    return table;
  }
};

}  // namespace

G_DECLARE_FINAL_TYPE(LfLenticular, lf_lenticular, LF, LENTICULAR, GstVideoFilter)

struct _LfLenticular {
  GstVideoFilter parent;
  Settings settings;  // guarded by the object lock
  std::shared_ptr<lf::WorkerPool> workers;
};

G_DEFINE_TYPE(LfLenticular, lf_lenticular, GST_TYPE_VIDEO_FILTER)
GST_ELEMENT_REGISTER_DEFINE(lflenticular, "lflenticular", GST_RANK_NONE, lf_lenticular_get_type())

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("RGB")));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("RGB")));

static Settings& settings_of(LfLenticular* self) { return self->settings; }
using Properties = lf::Properties<settings_of>;

static GstCaps* lf_lenticular_transform_caps(GstBaseTransform*, GstPadDirection, GstCaps* caps, GstCaps* filter) {
  GstCaps* any = gst_caps_copy(caps);
  for (guint i = 0; i < gst_caps_get_size(any); i++) {
    GstStructure* structure = gst_caps_get_structure(any, i);
    gst_structure_set(structure, "width", GST_TYPE_INT_RANGE, 1, G_MAXINT, "height", GST_TYPE_INT_RANGE, 1, G_MAXINT,
                      nullptr);
    gst_structure_remove_field(structure, "pixel-aspect-ratio");
  }
  return lf::filter_caps(any, filter);
}

static GstCaps* lf_lenticular_fixate_caps(GstBaseTransform* base, GstPadDirection direction, GstCaps* caps,
                                          GstCaps* other) {
  other = gst_caps_make_writable(gst_caps_truncate(other));
  gint width = 0, height = 0;
  const GstStructure* given = gst_caps_get_structure(caps, 0);
  if (direction == GST_PAD_SINK && gst_structure_get_int(given, "width", &width) &&
      gst_structure_get_int(given, "height", &height)) {
    const Settings settings = Properties::now(LF_LENTICULAR(base));
    GstStructure* structure = gst_caps_get_structure(other, 0);
    gst_structure_fixate_field_nearest_int(structure, "width", std::max(width / settings.columns, 1));
    gst_structure_fixate_field_nearest_int(structure, "height", std::max(height / settings.rows, 1));
  }
  return gst_caps_fixate(other);
}

static GstFlowReturn lf_lenticular_transform_frame(GstVideoFilter* filter, GstVideoFrame* in, GstVideoFrame* out) {
  LfLenticular* self = LF_LENTICULAR(filter);
  const Settings settings = Properties::now(self);
  const gint width = GST_VIDEO_FRAME_WIDTH(in), height = GST_VIDEO_FRAME_HEIGHT(in);
  if (width % settings.columns != 0 || height % settings.rows != 0) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("A quilt of %dx%d pixels can't have %d columns and %d rows: set columns and rows as in the "
                       "source of the quilt.",
                       width, height, settings.columns, settings.rows),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const lf::Quilt quilt{{.family = lf::PixelFamily::kRgb,
                         .width = width,
                         .height = height,
                         .layout = {},
                         .plane = {static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(in, 0))},
                         .stride = {GST_VIDEO_FRAME_PLANE_STRIDE(in, 0)}},
                        settings.columns,
                        settings.rows};
  lf::interleave_views(settings, quilt, GST_VIDEO_FRAME_WIDTH(out), GST_VIDEO_FRAME_HEIGHT(out),
                       GST_VIDEO_FRAME_PLANE_STRIDE(out, 0), static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(out, 0)),
                       [self](size_t count, const std::function<void(size_t)>& task) {
                         self->workers->run(g_get_num_processors(), count, task);
                       });
  return GST_FLOW_OK;
}

static void lf_lenticular_finalize(GObject* object) {
  std::destroy_at(&LF_LENTICULAR(object)->workers);
  G_OBJECT_CLASS(lf_lenticular_parent_class)->finalize(object);
}

static void lf_lenticular_class_init(LfLenticularClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = lf_lenticular_finalize;
  Properties::install(G_OBJECT_CLASS(klass));
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field lens display", "Filter/Effect/Video",
                                        "Converts a quilt of views to the image of a lenticular display",
                                        "gst-lightfield developers");
  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = lf::callback<lf_lenticular_transform_caps>;
  transform_class->fixate_caps = lf::callback<lf_lenticular_fixate_caps>;
  GST_VIDEO_FILTER_CLASS(klass)->transform_frame = lf::callback<lf_lenticular_transform_frame>;
}

static void lf_lenticular_init(LfLenticular* self) {
  self->settings = Settings();
  std::construct_at(&self->workers, lf::WorkerPool::shared());
}
