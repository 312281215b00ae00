// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/view_meta.h"

#include <algorithm>
#include <span>
#include <utility>

#include "common/custom_events.h"

namespace lf {
namespace {

gboolean set_one_field(GQuark field, const GValue* value, gpointer to) {
  gst_structure_id_set_value(static_cast<GstStructure*>(to), field, value);
  return TRUE;
}

// The meta stays valid, because scaling, conversion and copies do not change the view.
gboolean copy_view_meta(GstBuffer* to, GstCustomMeta* meta, GstBuffer*, GQuark, gpointer, gpointer) {
  if (gst_buffer_get_custom_meta(to, LF_VIEW_META)) return TRUE;
  GstCustomMeta* copy = gst_buffer_add_custom_meta(to, LF_VIEW_META);
  if (!copy) return FALSE;
  gst_structure_foreach(gst_custom_meta_get_structure(meta), set_one_field, gst_custom_meta_get_structure(copy));
  return TRUE;
}

void set_numbers(GstStructure* structure, const char* field, std::span<const double> numbers) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_DOUBLE);
  for (const double number : numbers) {
    g_value_set_double(&value, number);
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, field, &array);
}

void set_names(GstStructure* structure, const char* field, const std::vector<std::string>& names) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_STRING);
  for (const std::string& name : names) {
    g_value_set_string(&value, name.c_str());
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, field, &array);
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
  GBytes* levels = levels_of(map);
  GstStructure* structure =
      gst_structure_new("lightfield-focal-map", "step", G_TYPE_INT, map->step, "columns", G_TYPE_INT, map->columns,
                        "rows", G_TYPE_INT, map->rows, "inverse-farthest", G_TYPE_DOUBLE, map->farthest,
                        "inverse-nearest", G_TYPE_DOUBLE, map->nearest, "levels", G_TYPE_BYTES, levels, nullptr);
  g_bytes_unref(levels);
  const double from[] = {map->from.normal.x, map->from.normal.y, map->from.normal.z, map->from.d};
  set_numbers(structure, "from", from);
  return structure;
}

GstStructure* focus_of(const ViewRequest& request) {
  const View& view = request.view;
  const Plane& plane = view.focus.plane;
  const std::shared_ptr<const FocalMap> map = request.on_plane ? nullptr : view.focus.map;
  GstStructure* focus =
      gst_structure_new("lightfield-focus", "mode", G_TYPE_STRING, map ? "surface" : "plane", nullptr);
  const double numbers[] = {plane.normal.x, plane.normal.y, plane.normal.z, plane.d};
  set_numbers(focus, "plane", numbers);
  if (const double slope = glm::dot(plane.normal, view.pose.forward()); slope != 0)
    gst_structure_set(focus, "distance", G_TYPE_DOUBLE, -plane.signed_distance(view.pose.position) / slope, nullptr);
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
  set_cameras(structure, "missing-cameras", facts.missing_cameras);
  set_names(structure, "missing-nodes", facts.missing_nodes);
}

void set_views(GstStructure* structure, std::vector<const ViewMetaEntry*> views) {
  std::ranges::sort(views, {}, [](const ViewMetaEntry* facts) { return facts->request.place.index; });
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, GST_TYPE_STRUCTURE);
  for (const ViewMetaEntry* facts : views) {
    const ViewSetPosition& place = facts->request.place;
    GstStructure* one =
        gst_structure_new(LF_VIEW_META, "column", G_TYPE_INT, place.column(), "row", G_TYPE_INT, place.row(), nullptr);
    set_view(one, *facts);
    g_value_take_boxed(&value, one);
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, "views", &array);
}

uint32_t set_of(const ViewMetaEntry& facts) {
  return facts.request.sequence - static_cast<uint32_t>(facts.request.place.turn());
}

}  // namespace

void register_view_meta() {
  // The meta has no tags, because elements such as videoconvert drop metas with tags that they don't know.
  static const char* const no_tags[] = {nullptr};
  if (!gst_meta_get_info(LF_VIEW_META))
    gst_meta_register_custom(LF_VIEW_META, const_cast<const gchar**>(no_tags), copy_view_meta, nullptr, nullptr);
}

void ViewMeta::add(ViewMetaEntry facts) {
  if (!views_.empty() && set_of(views_.front()) != set_of(facts)) views_.clear();
  views_.push_back(std::move(facts));
}

void ViewMeta::attach(GstBuffer* picture) {
  if (views_.empty()) return;
  const std::vector<ViewMetaEntry> views = std::exchange(views_, {});
  if (gst_buffer_get_custom_meta(picture, LF_VIEW_META)) return;
  GstCustomMeta* meta = gst_buffer_add_custom_meta(picture, LF_VIEW_META);
  if (!meta) return;
  GstStructure* structure = gst_custom_meta_get_structure(meta);
  const ViewMetaEntry& leader = views.front();
  gst_structure_set(structure, "view-id", G_TYPE_UINT, leader.request.view_id, nullptr);
  if (leader.capture_time) gst_structure_set(structure, "capture-time", G_TYPE_UINT64, *leader.capture_time, nullptr);
  set_view(structure, leader);
  take_structure(structure, "focus", focus_of(leader.request));
  const Blending& blending = leader.request.view.blending;
  gst_structure_set(structure, "aperture", G_TYPE_DOUBLE, blending.aperture, "nearest-cameras", G_TYPE_INT,
                    blending.nearest, nullptr);
  if (views.size() == 1) return;
  std::vector<const ViewMetaEntry*> all;
  for (const ViewMetaEntry& facts : views) all.push_back(&facts);
  set_views(structure, std::move(all));
}

}  // namespace lf
