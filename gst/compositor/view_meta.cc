// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/view_meta.h"

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <utility>

#include "base/text.h"
#include "common/common.h"

namespace lf {
namespace {

gboolean set_one_field(GQuark field, const GValue* value, gpointer to) {
  gst_structure_id_set_value(static_cast<GstStructure*>(to), field, value);
  return TRUE;
}

// The meta stays valid, because scaling, conversion and copies do not change the view.
gboolean copy_meta(GstBuffer* to, GstCustomMeta* meta, GstBuffer*, GQuark, gpointer, gpointer) {
  if (gst_buffer_get_custom_meta(to, LF_VIEW_META)) return TRUE;
  GstCustomMeta* copy = gst_buffer_add_custom_meta(to, LF_VIEW_META);
  if (!copy) return FALSE;
  gst_structure_foreach(gst_custom_meta_get_structure(meta), set_one_field, gst_custom_meta_get_structure(copy));
  return TRUE;
}

void set_numbers(GstStructure* structure, const char* field, std::span<const double> numbers) {
  set_array(structure, field, G_TYPE_DOUBLE, numbers, g_value_set_double);
}

void take_structure(GstStructure* to, const char* field, GstStructure* taken) {
  gst_structure_set(to, field, GST_TYPE_STRUCTURE, taken, nullptr);
  gst_structure_free(taken);
}

GstStructure* lens_of(const View& view) {
  GstStructure* lens = gst_structure_new("lightfield-lens", "model", G_TYPE_STRING,
                                         std::string(lens_model_name(view.lens.model())).c_str(), "width", G_TYPE_INT,
                                         view.width, "height", G_TYPE_INT, view.height, nullptr);
  set_numbers(lens, "params", std::span(view.lens.params()).first(static_cast<size_t>(view.lens.num_params())));
  return lens;
}

// The levels stay in the memory of the map, which the bytes keep alive.
GBytes* levels_of(const std::shared_ptr<const FocalMap>& map) {
  return g_bytes_new_with_free_func(
      map->levels.data(), map->levels.size(),
      [](gpointer data) { delete static_cast<std::shared_ptr<const FocalMap>*>(data); },
      new std::shared_ptr<const FocalMap>(map));
}

GstStructure* map_of(const std::shared_ptr<const FocalMap>& map) {
  g_autoptr(GBytes) levels = levels_of(map);
  GstStructure* structure =
      gst_structure_new("lightfield-focal-map", "step", G_TYPE_INT, map->step, "columns", G_TYPE_INT, map->columns,
                        "rows", G_TYPE_INT, map->rows, "inverse-farthest", G_TYPE_DOUBLE, map->farthest,
                        "inverse-nearest", G_TYPE_DOUBLE, map->nearest, "levels", G_TYPE_BYTES, levels, nullptr);
  const double from[] = {map->from.normal.x, map->from.normal.y, map->from.normal.z, map->from.d};
  set_numbers(structure, "from", from);
  return structure;
}

GstStructure* confidence_of(const std::shared_ptr<const FocalMap>& map) {
  g_autoptr(GBytes) values = levels_of(map);
  return gst_structure_new("lightfield-confidence", "step", G_TYPE_INT, map->step, "columns", G_TYPE_INT, map->columns,
                           "rows", G_TYPE_INT, map->rows, "values", G_TYPE_BYTES, values, nullptr);
}

GstStructure* focus_of(const ViewMetaEntry& facts) {
  const ViewRequest& request = facts.request;
  const View& view = request.view;
  const Plane& plane = view.focus.plane;
  const std::shared_ptr<const FocalMap> map = request.on_plane ? nullptr : view.focus.map;
  GstStructure* focus =
      gst_structure_new("lightfield-focus", "mode", G_TYPE_STRING, map ? "surface" : "plane", nullptr);
  const double numbers[] = {plane.normal.x, plane.normal.y, plane.normal.z, plane.d};
  set_numbers(focus, "plane", numbers);
  if (const double slope = glm::dot(plane.normal, view.pose.forward()); slope != 0)
    gst_structure_set(focus, "distance", G_TYPE_DOUBLE, -plane.signed_distance(view.pose.position) / slope, nullptr);
  if (facts.confidence) take_structure(focus, "confidence", confidence_of(facts.confidence));
  if (!map || map->levels.empty()) return focus;
  const auto [farthest, nearest] = std::ranges::minmax(map->levels);
  gst_structure_set(focus, "nearest", G_TYPE_DOUBLE, 1 / map->inverse_of(nearest), "farthest", G_TYPE_DOUBLE,
                    1 / map->inverse_of(farthest), nullptr);
  take_structure(focus, "map", map_of(map));
  return focus;
}

void set_view(GstStructure* structure, const ViewMetaEntry& facts) {
  const ViewRequest& request = facts.request;
  const Vec3& at = request.view.pose.position;
  const Quat& turn = request.view.pose.orientation;
  gst_structure_set(structure, "sequence", G_TYPE_UINT, request.sequence, "complete", G_TYPE_BOOLEAN, facts.complete(),
                    "fragments", G_TYPE_UINT, facts.fragments, "missing", G_TYPE_UINT, facts.missing, "damaged",
                    G_TYPE_UINT, facts.damaged, nullptr);
  const double position[] = {at.x, at.y, at.z}, orientation[] = {turn.w, turn.x, turn.y, turn.z};
  set_numbers(structure, "position", position);
  set_numbers(structure, "orientation", orientation);
  take_structure(structure, "lens", lens_of(request.view));
  if (facts.coverage)
    gst_structure_set(structure, "coverage", G_TYPE_DOUBLE, facts.coverage->seen, "extrapolated", G_TYPE_DOUBLE,
                      facts.coverage->extrapolated, nullptr);
  set_array(structure, "missing-cameras", G_TYPE_UINT, facts.missing_cameras, g_value_set_uint);
  set_array(structure, "missing-nodes", G_TYPE_STRING, facts.missing_nodes,
            [](GValue* value, const std::string& name) { g_value_set_string(value, name.c_str()); });
}

void set_views(GstStructure* structure, std::vector<ViewMetaEntry> views) {
  std::ranges::sort(views, {}, [](const ViewMetaEntry& facts) { return facts.request.place.index; });
  set_array(structure, "views", GST_TYPE_STRUCTURE, views, [](GValue* value, const ViewMetaEntry& facts) {
    const ViewSetPosition& place = facts.request.place;
    GstStructure* one =
        gst_structure_new(LF_VIEW_META, "column", G_TYPE_INT, place.column(), "row", G_TYPE_INT, place.row(), nullptr);
    set_view(one, facts);
    take_structure(one, "focus", focus_of(facts));
    g_value_take_boxed(value, one);
  });
}

uint32_t set_of(const ViewMetaEntry& facts) {
  return facts.request.sequence - static_cast<uint32_t>(facts.request.place.turn());
}

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

// Reads the size of a map, and its nodes from a field of bytes.
bool get_nodes(const GstStructure* structure, const char* field, FocalMap& map) {
  g_autoptr(GBytes) nodes = nullptr;
  if (!gst_structure_get(structure, "step", G_TYPE_INT, &map.step, "columns", G_TYPE_INT, &map.columns, "rows",
                         G_TYPE_INT, &map.rows, field, G_TYPE_BYTES, &nodes, nullptr))
    return false;
  gsize size = 0;
  const auto* bytes = static_cast<const uint8_t*>(g_bytes_get_data(nodes, &size));
  map.levels.assign(bytes, bytes + size);
  return true;
}

std::shared_ptr<const FocalMap> read_map(const GstStructure* structure) {
  auto map = std::make_shared<FocalMap>();
  if (!get_plane(structure, "from", map->from) || !get_nodes(structure, "levels", *map) ||
      !gst_structure_get(structure, "inverse-farthest", G_TYPE_DOUBLE, &map->farthest, "inverse-nearest", G_TYPE_DOUBLE,
                         &map->nearest, nullptr))
    return nullptr;
  return map;
}

std::shared_ptr<const FocalMap> read_confidence(const GstStructure* structure, const View& view) {
  auto map = std::make_shared<FocalMap>();
  map->nearest = 1;
  if (!get_nodes(structure, "values", *map)) return nullptr;
  FocalSurface surface;
  surface.map = map;
  map->from = surface.plane = view.focus.plane;
  validate(surface, view.width, view.height);
  return map;
}

// Reads a picture, or one view of a set.
std::optional<PictureView> read_view(const GstStructure* picture) {
  const GstStructure *lens = part_of(picture, "lens"), *focus = part_of(picture, "focus");
  std::array<double, 3> at{};
  std::array<double, 4> turn{};
  PictureView read;
  View& view = read.view;
  if (!lens || !focus || !get_numbers(picture, "position", at) || !get_numbers(picture, "orientation", turn) ||
      !get_plane(focus, "plane", view.focus.plane))
    return std::nullopt;
  view.pose = {{at[0], at[1], at[2]}, {turn[0], turn[1], turn[2], turn[3]}};
  try {
    if (!get_lens(lens, view)) return std::nullopt;
    if (const GstStructure* map = part_of(focus, "map"); map && !(view.focus.map = read_map(map))) return std::nullopt;
    validate(view);
    if (const GstStructure* confidence = part_of(focus, "confidence"))
      read.confidence = read_confidence(confidence, view);
  } catch (const Error&) {
    return std::nullopt;
  }
  gst_structure_get(picture, "column", G_TYPE_INT, &read.column, "row", G_TYPE_INT, &read.row, nullptr);
  return read;
}

}  // namespace

void register_view_meta() {
  // The meta has no tags, because elements such as videoconvert drop metas with tags that they don't know.
  static const char* const no_tags[] = {nullptr};
  if (!gst_meta_get_info(LF_VIEW_META))
    gst_meta_register_custom(LF_VIEW_META, const_cast<const gchar**>(no_tags), copy_meta, nullptr, nullptr);
}

void ViewMeta::add(ViewMetaEntry facts) {
  if (!views_.empty() && set_of(views_.front()) != set_of(facts)) views_.clear();
  views_.push_back(std::move(facts));
}

void ViewMeta::attach(GstBuffer* picture) {
  if (views_.empty()) return;
  std::vector<ViewMetaEntry> views = std::exchange(views_, {});
  if (gst_buffer_get_custom_meta(picture, LF_VIEW_META)) return;
  GstCustomMeta* meta = gst_buffer_add_custom_meta(picture, LF_VIEW_META);
  if (!meta) return;
  GstStructure* structure = gst_custom_meta_get_structure(meta);
  const ViewMetaEntry& leader = views.front();
  gst_structure_set(structure, "view-id", G_TYPE_UINT, leader.request.view_id, nullptr);
  if (leader.capture_time) gst_structure_set(structure, "capture-time", G_TYPE_UINT64, *leader.capture_time, nullptr);
  set_view(structure, leader);
  take_structure(structure, "focus", focus_of(leader));
  const Blending& blending = leader.request.view.blending;
  gst_structure_set(structure, "aperture", G_TYPE_DOUBLE, blending.aperture, "nearest-cameras", G_TYPE_INT,
                    blending.nearest, nullptr);
  if (views.size() > 1) set_views(structure, std::move(views));
}

void copy_view_meta(GstBuffer* from, GstBuffer* to) {
  if (GstCustomMeta* meta = gst_buffer_get_custom_meta(from, LF_VIEW_META))
    copy_meta(to, meta, from, 0, nullptr, nullptr);
}

std::vector<PictureView> views_of_picture(const GstStructure* picture) {
  std::vector<PictureView> views;
  const GValue* set = gst_structure_get_value(picture, "views");
  const guint count = set && GST_VALUE_HOLDS_ARRAY(set) ? gst_value_array_get_size(set) : 0;
  for (guint i = 0; i < std::max(count, 1u); i++) {
    const GValue* one = count > 0 ? gst_value_array_get_value(set, i) : nullptr;
    if (one && !GST_VALUE_HOLDS_STRUCTURE(one)) return {};
    std::optional<PictureView> view = read_view(one ? gst_value_get_structure(one) : picture);
    if (!view) return {};
    views.push_back(std::move(*view));
  }
  return views;
}

}  // namespace lf
