// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lftypefind.h"

#include <optional>

#include "common.h"
#include "wire/unit.h"

namespace {

std::optional<lf::wire::UnitHeader> peek(GstTypeFind* find, gint64 offset) {
  const guint8* data = gst_type_find_peek(find, offset, lf::wire::kUnitHeaderBytes);
  if (!data) return std::nullopt;
  return lf::wire::peek_unit({data, lf::wire::kUnitHeaderBytes});
}

// Certain where a second unit follows or the stream ends with the first.
void find_units(GstTypeFind* find, gpointer user_data) {
  const auto kind = static_cast<lf::wire::UnitKind>(GPOINTER_TO_INT(user_data));
  const std::optional<lf::wire::UnitHeader> first = peek(find, 0);
  if (!first || first->kind != kind) return;
  const bool alone = gst_type_find_get_length(find) == first->size;
  const std::optional<lf::wire::UnitHeader> second = alone ? first : peek(find, static_cast<gint64>(first->size));
  gst_type_find_suggest_simple(find, second && second->kind == kind ? GST_TYPE_FIND_MAXIMUM : GST_TYPE_FIND_LIKELY,
                               kind == lf::wire::UnitKind::kRequest ? LF_REQUEST_MEDIA_TYPE : LF_ANSWER_MEDIA_TYPE,
                               "parsed", G_TYPE_BOOLEAN, FALSE, nullptr);
}

gboolean register_kind(GstPlugin* plugin, const char* media_type, const char* extension, lf::wire::UnitKind kind) {
  GstCaps* caps = gst_caps_new_empty_simple(media_type);
  const gboolean ok = gst_type_find_register(plugin, media_type, GST_RANK_PRIMARY, find_units, extension, caps,
                                             GINT_TO_POINTER(static_cast<int>(kind)), nullptr);
  gst_caps_unref(caps);
  return ok;
}

}  // namespace

gboolean lf_typefind_register(GstPlugin* plugin) {
  return register_kind(plugin, LF_REQUEST_MEDIA_TYPE, "lfq", lf::wire::UnitKind::kRequest) &&
         register_kind(plugin, LF_ANSWER_MEDIA_TYPE, "lfa", lf::wire::UnitKind::kAnswer);
}
