// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/picture_view.h"

#include <array>
#include <memory>
#include <span>

#include "base/text.h"

namespace lf {
namespace {

// Reads an array of doubles. Returns false if it has not exactly this length.
bool get_numbers(const GstStructure* structure, const char* field, std::span<double> out) {
  const GValue* array = gst_structure_get_value(structure, field);
  if (!array || !GST_VALUE_HOLDS_ARRAY(array) || gst_value_array_get_size(array) != out.size()) return false;
  for (size_t i = 0; i < out.size(); i++) {
    const GValue* number = gst_value_array_get_value(array, static_cast<guint>(i));
    if (!G_VALUE_HOLDS_DOUBLE(number)) return false;
    out[i] = g_value_get_double(number);
  }
  return true;
}

const GstStructure* part_of(const GstStructure* structure, const char* field) {
  const GValue* value = gst_structure_get_value(structure, field);
  return value && GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : nullptr;
}

bool get_plane(const GstStructure* structure, const char* field, Plane& plane) {
  std::array<double, 4> numbers{};
  if (!get_numbers(structure, field, numbers)) return false;
  plane = {{numbers[0], numbers[1], numbers[2]}, numbers[3]};
  return true;
}

bool get_lens(const GstStructure* lens, View& view) {
  const gchar* name = gst_structure_get_string(lens, "model");
  const auto model = lens_model_from_name(name ? name : "");
  std::array<double, Lens::kMaxParams> params{};
  if (!model ||
      !get_numbers(lens, "params", std::span(params).first(static_cast<size_t>(lens_model_num_params(*model)))) ||
      !gst_structure_get(lens, "width", G_TYPE_INT, &view.width, "height", G_TYPE_INT, &view.height, nullptr))
    return false;
  view.lens = Lens(*model, params);
  return true;
}

std::shared_ptr<const FocalMap> read_map(const GstStructure* structure) {
  auto map = std::make_shared<FocalMap>();
  GBytes* levels = nullptr;
  if (!get_plane(structure, "from", map->from) ||
      !gst_structure_get(structure, "step", G_TYPE_INT, &map->step, "columns", G_TYPE_INT, &map->columns, "rows",
                         G_TYPE_INT, &map->rows, "inverse-farthest", G_TYPE_DOUBLE, &map->farthest, "inverse-nearest",
                         G_TYPE_DOUBLE, &map->nearest, "levels", G_TYPE_BYTES, &levels, nullptr))
    return nullptr;
  gsize size = 0;
  const auto* bytes = static_cast<const uint8_t*>(g_bytes_get_data(levels, &size));
  map->levels.assign(bytes, bytes + size);
  g_bytes_unref(levels);
  return map;
}

}  // namespace

std::optional<View> view_of_picture(const GstStructure* picture) {
  const GstStructure *lens = part_of(picture, "lens"), *focus = part_of(picture, "focus");
  std::array<double, 3> at{};
  std::array<double, 4> turn{};
  View view;
  if (gst_structure_has_field(picture, "views") || !lens || !focus || !get_numbers(picture, "position", at) ||
      !get_numbers(picture, "orientation", turn) || !get_plane(focus, "plane", view.focus.plane))
    return std::nullopt;
  view.pose = {{at[0], at[1], at[2]}, {turn[0], turn[1], turn[2], turn[3]}};
  try {
    if (!get_lens(lens, view)) return std::nullopt;
    if (const GstStructure* map = part_of(focus, "map"); map && !(view.focus.map = read_map(map))) return std::nullopt;
    validate(view);
  } catch (const Error&) {
    return std::nullopt;
  }
  return view;
}

}  // namespace lf
