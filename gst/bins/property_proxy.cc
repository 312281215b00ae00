// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/property_proxy.h"

#include <algorithm>

namespace lf {
namespace {

GQuark copy_quark() {
  static const GQuark quark = g_quark_from_static_string("lf-property-copy");
  return quark;
}

GParamFlags flags_of(const GParamSpec* spec) {
  constexpr int kNot = G_PARAM_STATIC_STRINGS | G_PARAM_CONSTRUCT | G_PARAM_CONSTRUCT_ONLY | GST_PARAM_CONTROLLABLE;
  return static_cast<GParamFlags>(spec->flags & ~kNot);
}

template <typename Spec, typename Make>
GParamSpec* copy_range(const GParamSpec* spec, Make make) {
  const Spec* s = reinterpret_cast<const Spec*>(spec);
  GParamSpec* writable = const_cast<GParamSpec*>(spec);
  return make(spec->name, g_param_spec_get_nick(writable), g_param_spec_get_blurb(writable), s->minimum, s->maximum,
              s->default_value, flags_of(spec));
}

GParamSpec* copy_of(GParamSpec* spec) {
  const char *name = spec->name, *nick = g_param_spec_get_nick(spec), *blurb = g_param_spec_get_blurb(spec);
  const GParamFlags flags = flags_of(spec);
  if (G_IS_PARAM_SPEC_INT(spec)) return copy_range<GParamSpecInt>(spec, g_param_spec_int);
  if (G_IS_PARAM_SPEC_UINT(spec)) return copy_range<GParamSpecUInt>(spec, g_param_spec_uint);
  if (G_IS_PARAM_SPEC_INT64(spec)) return copy_range<GParamSpecInt64>(spec, g_param_spec_int64);
  if (G_IS_PARAM_SPEC_UINT64(spec)) return copy_range<GParamSpecUInt64>(spec, g_param_spec_uint64);
  if (G_IS_PARAM_SPEC_DOUBLE(spec)) return copy_range<GParamSpecDouble>(spec, g_param_spec_double);
  if (G_IS_PARAM_SPEC_BOOLEAN(spec))
    return g_param_spec_boolean(name, nick, blurb, G_PARAM_SPEC_BOOLEAN(spec)->default_value, flags);
  if (G_IS_PARAM_SPEC_STRING(spec))
    return g_param_spec_string(name, nick, blurb, G_PARAM_SPEC_STRING(spec)->default_value, flags);
  if (G_IS_PARAM_SPEC_ENUM(spec))
    return g_param_spec_enum(name, nick, blurb, spec->value_type, G_PARAM_SPEC_ENUM(spec)->default_value, flags);
  if (G_IS_PARAM_SPEC_BOXED(spec)) return g_param_spec_boxed(name, nick, blurb, spec->value_type, flags);
  if (GST_IS_PARAM_SPEC_FRACTION(spec)) {
    const GstParamSpecFraction* f = GST_PARAM_SPEC_FRACTION(spec);
    return gst_param_spec_fraction(name, nick, blurb, f->min_num, f->min_den, f->max_num, f->max_den, f->def_num,
                                   f->def_den, flags);
  }
  return nullptr;
}

void set_default(GParamSpec* copy, gint64 value) {
  if (G_IS_PARAM_SPEC_BOOLEAN(copy))
    G_PARAM_SPEC_BOOLEAN(copy)->default_value = static_cast<gboolean>(value);
  else if (G_IS_PARAM_SPEC_INT(copy))
    G_PARAM_SPEC_INT(copy)->default_value = static_cast<gint>(value);
  else if (G_IS_PARAM_SPEC_UINT64(copy))
    G_PARAM_SPEC_UINT64(copy)->default_value = static_cast<guint64>(value);
  else
    g_return_if_reached();
}

void pass_on(GObject* bin, GParamSpec* changed) {
  GParamSpec* own = g_object_class_find_property(G_OBJECT_GET_CLASS(bin), changed->name);
  if (own && is_proxy(own)) g_object_notify_by_pspec(bin, own);
}

}  // namespace

guint install_proxies(GObjectClass* klass, guint first_id, GType child, std::initializer_list<std::string_view> without,
                      std::initializer_list<const char*> with, std::span<const ProxyDefault> defaults) {
  GObjectClass* child_class = static_cast<GObjectClass*>(g_type_class_ref(child));
  guint id = first_id, count = 0;
  const auto install = [&](GParamSpec* spec) {
    GParamSpec* copy = copy_of(spec);
    g_return_if_fail(copy);
    for (const ProxyDefault& d : defaults)
      if (g_str_equal(d.name, spec->name)) set_default(copy, d.value);
    g_param_spec_set_qdata(copy, copy_quark(), GSIZE_TO_POINTER(child));
    g_object_class_install_property(klass, id++, copy);
  };
  g_autofree GParamSpec** specs = g_object_class_list_properties(child_class, &count);
  for (guint i = 0; i < count; i++)
    if (specs[i]->owner_type == child && std::ranges::find(without, std::string_view(specs[i]->name)) == without.end())
      install(specs[i]);
  for (const char* name : with) install(g_object_class_find_property(child_class, name));
  g_type_class_unref(child_class);
  return id;
}

void set_defaults(GstElement* child, std::span<const ProxyDefault> defaults) {
  for (const ProxyDefault& d : defaults) g_object_set(child, d.name, static_cast<gint>(d.value), nullptr);
}

bool is_proxy(GParamSpec* spec, GType child) {
  const auto of = reinterpret_cast<GType>(g_param_spec_get_qdata(spec, copy_quark()));
  return child ? of == child : of != 0;
}

void forward_notifications(GObject* bin, GObject* child) {
  g_signal_connect_object(child, "notify", G_CALLBACK(pass_on), bin, G_CONNECT_SWAPPED);
}

}  // namespace lf
