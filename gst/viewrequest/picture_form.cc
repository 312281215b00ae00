// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/picture_form.h"

#include <algorithm>
#include <memory>

#include "rig/rig.h"

namespace lf {
namespace {

using StructurePtr = std::unique_ptr<GstStructure, void (*)(GstStructure*)>;

StructurePtr structure_ptr(GstStructure* owned) { return {owned, gst_structure_free}; }

void limit_side(GstStructure* wanted, const char* name, int set, int count) {
  if (set > 0)
    gst_structure_set(wanted, name, G_TYPE_INT, set * count, nullptr);
  else
    gst_structure_set(wanted, name, GST_TYPE_INT_RANGE, 1, kMaxImageSize, nullptr);
}

// What the properties allow, of whole pictures.
StructurePtr wanted_form(const PictureForm& set, int columns, int rows) {
  StructurePtr wanted = structure_ptr(gst_structure_new_empty("video/x-raw"));
  limit_side(wanted.get(), "width", set.width, columns);
  limit_side(wanted.get(), "height", set.height, rows);
  gst_structure_set(wanted.get(), "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  if (set.fps_n > 0)
    gst_structure_set(wanted.get(), "framerate", GST_TYPE_FRACTION, set.fps_n, set.fps_d, nullptr);
  else
    gst_structure_set(wanted.get(), "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  return wanted;
}

// Formats, colours and the memory are for lfcompositor to agree on.
StructurePtr size_and_rate_of(const GstStructure* video) {
  StructurePtr copy = structure_ptr(gst_structure_new_empty("video/x-raw"));
  for (const char* name : {"width", "height", "framerate", "pixel-aspect-ratio"})
    if (const GValue* value = gst_structure_get_value(video, name)) gst_structure_set_value(copy.get(), name, value);
  return copy;
}

// One side of a view, as near to `target` as the structure allows for `count` views in a row. 0: no such side.
// `is_set`: the picture has several views.
int choose_side(GstStructure* form, const char* name, int target, int count, bool is_set) {
  const int step = is_set ? 2 * count : 1;
  const bool is_open = !gst_structure_has_field_typed(form, name, G_TYPE_INT);
  gst_structure_fixate_field_nearest_int(form, name, std::clamp(target * count, 1, kMaxImageSize));
  int side = 0;
  gst_structure_get_int(form, name, &side);
  if (is_open && side != target * count) side -= side % step;
  return side % step == 0 ? side / count : 0;
}

int scaled(int side, int numerator, int denominator) {
  const double exact = static_cast<double>(side) * numerator / denominator;
  return std::max(2, 2 * static_cast<int>(exact / 2 + 0.5));
}

std::optional<PictureForm> fit_to_structure(GstStructure* form, const PictureForm& set, const PictureForm& usual,
                                            int columns, int rows) {
  PictureForm fitted = set;
  const bool is_set = columns * rows > 1;
  const bool is_wide_fixed = set.width == 0 && gst_structure_has_field_typed(form, "width", G_TYPE_INT);
  const bool is_high_fixed = set.height == 0 && gst_structure_has_field_typed(form, "height", G_TYPE_INT);
  PictureForm target = usual;
  if (is_high_fixed && !is_wide_fixed) {
    fitted.height = choose_side(form, "height", usual.height, rows, is_set);
    if (fitted.height != usual.height) target.width = scaled(fitted.height, usual.width, usual.height);
  }
  fitted.width = set.width > 0 ? set.width : choose_side(form, "width", target.width, columns, is_set);
  if (set.width == 0 && !is_high_fixed && fitted.width != usual.width)
    target.height = scaled(fitted.width, usual.height, usual.width);
  fitted.height = set.height > 0 ? set.height : choose_side(form, "height", target.height, rows, is_set);
  if (fitted.width <= 0 || fitted.height <= 0) return std::nullopt;
  gst_structure_fixate_field_nearest_fraction(form, "framerate", usual.fps_n, usual.fps_d);
  if (!gst_structure_get_fraction(form, "framerate", &fitted.fps_n, &fitted.fps_d)) return std::nullopt;
  return fitted;
}

}  // namespace

PictureForm with_usual(const PictureForm& set, const PictureForm& usual) {
  PictureForm form = set;
  if (form.width == 0) form.width = usual.width;
  if (form.height == 0) form.height = usual.height;
  if (form.fps_n == 0) form.fps_n = usual.fps_n, form.fps_d = usual.fps_d;
  return form;
}

std::optional<PictureForm> fit_to_caps(const GstCaps* caps, const PictureForm& set, const PictureForm& usual,
                                       int columns, int rows) {
  if (gst_caps_is_any(caps)) return with_usual(set, usual);
  const StructurePtr wanted = wanted_form(set, columns, rows);
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    const GstStructure* offered = gst_caps_get_structure(caps, i);
    if (!gst_structure_has_name(offered, "video/x-raw")) continue;
    const StructurePtr sizes = size_and_rate_of(offered);
    const StructurePtr form = structure_ptr(gst_structure_intersect(sizes.get(), wanted.get()));
    if (!form) continue;
    if (auto fitted = fit_to_structure(form.get(), set, usual, columns, rows)) return fitted;
  }
  return std::nullopt;
}

}  // namespace lf
