// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <glib-object.h>
#include <gst/gst.h>

#include "common/guard.h"
#include "wire/command_codec.h"

// Helpers that define the GObject properties of an element as the fields of a plain struct, its settings. A
// PropertyTable has one row for each property, with the field, the name, the texts and the range. The initial value of
// the field is the default of the property. The object lock of the element guards its settings.
namespace lf {

inline constexpr auto kWhileReady = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
inline constexpr auto kWhilePlaying =
    GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);

template <typename Settings>
struct Property {
  GParamSpec* spec;
  void (*set)(Settings& settings, const GValue* value);
  void (*get)(const Settings& settings, GValue* value);
};

inline void set_field(std::string& field, const GValue* value) {
  const gchar* text = g_value_get_string(value);
  field = text ? text : "";
}
inline void set_field(bool& field, const GValue* value) { field = g_value_get_boolean(value); }
inline void set_field(gint& field, const GValue* value) { field = g_value_get_int(value); }
inline void set_field(guint& field, const GValue* value) { field = g_value_get_uint(value); }
inline void set_field(gint64& field, const GValue* value) { field = g_value_get_int64(value); }
inline void set_field(guint64& field, const GValue* value) { field = g_value_get_uint64(value); }
inline void set_field(double& field, const GValue* value) { field = g_value_get_double(value); }
template <typename Enum>
requires std::is_enum_v<Enum>
void set_field(Enum& field, const GValue* value) { field = static_cast<Enum>(g_value_get_enum(value)); }

inline void get_field(const std::string& field, GValue* value) {
  g_value_set_string(value, field.empty() ? nullptr : field.c_str());
}
inline void get_field(bool field, GValue* value) { g_value_set_boolean(value, field); }
inline void get_field(gint field, GValue* value) { g_value_set_int(value, field); }
inline void get_field(guint field, GValue* value) { g_value_set_uint(value, field); }
inline void get_field(gint64 field, GValue* value) { g_value_set_int64(value, field); }
inline void get_field(guint64 field, GValue* value) { g_value_set_uint64(value, field); }
inline void get_field(double field, GValue* value) { g_value_set_double(value, field); }
template <typename Enum>
requires std::is_enum_v<Enum>
void get_field(Enum field, GValue* value) { g_value_set_enum(value, static_cast<gint>(field)); }

// Makes the table row of one property. `range` depends on the type of the field: the minimum and the maximum of a
// number, the GType of an enum, nothing for a boolean. For a string, `range` is either nothing or "". If it is "", an
// empty string is returned as "" instead of null.
template <auto field, typename Settings, typename Field, typename... Range>
Property<Settings> make_property(Field Settings::*, GParamFlags flags, const char* name, const char* nick,
                                 const char* blurb, Range... range) {
  const Field initial = Settings{}.*field;
  GParamSpec* spec = nullptr;
  if constexpr (std::is_same_v<Field, std::string>)
    spec = g_param_spec_string(name, nick, blurb, std::get<0>(std::tuple<Range..., const char*>(range..., nullptr)),
                               flags);
  else if constexpr (std::is_same_v<Field, bool>)
    spec = g_param_spec_boolean(name, nick, blurb, initial, flags);
  else if constexpr (std::is_enum_v<Field>)
    spec = g_param_spec_enum(name, nick, blurb, range..., static_cast<gint>(initial), flags);
  else if constexpr (std::is_same_v<Field, gint>)
    spec = g_param_spec_int(name, nick, blurb, range..., initial, flags);
  else if constexpr (std::is_same_v<Field, guint>)
    spec = g_param_spec_uint(name, nick, blurb, range..., initial, flags);
  else if constexpr (std::is_same_v<Field, gint64>)
    spec = g_param_spec_int64(name, nick, blurb, range..., initial, flags);
  else if constexpr (std::is_same_v<Field, guint64>)
    spec = g_param_spec_uint64(name, nick, blurb, range..., initial, flags);
  else
    spec = g_param_spec_double(name, nick, blurb, range..., initial, flags);
  return {spec, [](Settings& settings, const GValue* value) { set_field(settings.*field, value); },
          [](const Settings& settings, GValue* value) {
            get_field(settings.*field, value);
            if constexpr (std::is_same_v<Field, std::string> && sizeof...(range) > 0)
              if ((settings.*field).empty()) g_value_set_static_string(value, "");
          }};
}
// Makes the table row of a property with a field that the settings `S` inherit from a base struct. All arguments are
// the same as for property().
template <typename S, auto field, typename... Range>
Property<S> inherited_property(GParamFlags flags, const char* name, const char* nick, const char* blurb,
                               Range... range) {
  std::remove_reference_t<decltype(std::declval<S>().*field)> S::*own = field;
  return make_property<field>(own, flags, name, nick, blurb, range...);
}
template <auto field, typename... Range>
auto property(GParamFlags flags, const char* name, const char* nick, const char* blurb, Range... range) {
  return make_property<field>(field, flags, name, nick, blurb, range...);
}

// Makes the table row of a property with a fraction, such as a frame rate. Two fields hold its numerator and its
// denominator. The minimum of the fraction is `least_n` / `least_d`.
template <auto numerator, auto denominator, typename Settings>
Property<Settings> make_fraction(gint Settings::*, GParamFlags flags, const char* name, const char* nick,
                                 const char* blurb, gint least_n, gint least_d) {
  const Settings initial;
  return {gst_param_spec_fraction(name, nick, blurb, least_n, least_d, G_MAXINT, 1, initial.*numerator,
                                  initial.*denominator, flags),
          [](Settings& settings, const GValue* value) {
            settings.*numerator = gst_value_get_fraction_numerator(value);
            settings.*denominator = gst_value_get_fraction_denominator(value);
          },
          [](const Settings& settings, GValue* value) {
            gst_value_set_fraction(value, settings.*numerator, settings.*denominator);
          }};
}
template <auto numerator, auto denominator>
auto fraction_property(GParamFlags flags, const char* name, const char* nick, const char* blurb, gint least_n,
                       gint least_d) {
  return make_fraction<numerator, denominator>(numerator, flags, name, nick, blurb, least_n, least_d);
}

// The properties of one class. The table does not change after install(), so it is thread-safe from then on.
template <typename Settings>
class PropertyTable {
 public:
  // A long table has `more` rows from another function.
  PropertyTable(std::initializer_list<Property<Settings>> rows, const std::vector<Property<Settings>>& more = {})
      : rows_(rows) {
    rows_.insert(rows_.end(), more.begin(), more.end());
  }

  // Installs the properties with the ids first_id, first_id + 1, and so on. Returns the first id that is still free.
  guint install(GObjectClass* klass, guint first_id) {
    first_id_ = first_id;
    for (const Property<Settings>& row : rows_) g_object_class_install_property(klass, first_id++, row.spec);
    return first_id;
  }
  void set(Settings& settings, guint id, const GValue* value) const { rows_[id - first_id_].set(settings, value); }
  void get(const Settings& settings, guint id, GValue* value) const { rows_[id - first_id_].get(settings, value); }

 private:
  std::vector<Property<Settings>> rows_;
  guint first_id_ = 0;
};

// Implements set_property and get_property of a class with the table Settings::properties(). settings_of(element) must
// return a reference to the settings of an element. If stats_of is given, the class also has the read-only property
// `stats`. stats_of(element) then returns its current value as a new GstStructure, which the caller owns. If guard_of
// is given, the class also has the property `limits`, of the RequestGuard that guard_of(element) returns.
template <auto settings_of, auto stats_of = nullptr, auto guard_of = nullptr>
struct Properties;
template <typename Settings, typename Element, Settings& (*settings_of)(Element*), auto stats_of, auto guard_of>
struct Properties<settings_of, stats_of, guard_of> {
  static constexpr guint kStats = 1, kFirstSetting = 2;
  static constexpr bool kHasGuard = !std::is_null_pointer_v<decltype(guard_of)>;

  static void set(GObject* object, guint id, const GValue* value, GParamSpec*) {
    Element* self = reinterpret_cast<Element*>(object);
    if constexpr (kHasGuard)
      if (guard_of(self).set(GST_ELEMENT(object), id, value)) return;
    const ObjectLock lock(object);
    Settings::properties().set(settings_of(self), id, value);
  }
  static void get(GObject* object, guint id, GValue* value, GParamSpec*) {
    Element* self = reinterpret_cast<Element*>(object);
    if constexpr (kHasGuard)
      if (guard_of(self).get(id, value)) return;
    if constexpr (!std::is_null_pointer_v<decltype(stats_of)>)
      if (id == kStats) return g_value_take_boxed(value, stats_of(self));
    const ObjectLock lock(object);
    Settings::properties().get(settings_of(self), id, value);
  }
  static Settings now(Element* self) {
    const ObjectLock lock(self);
    return settings_of(self);
  }
  // Installs all properties of the class; call this from its class_init function. The text `stats` describes the
  // property `stats`, and must be given if stats_of is given. Returns the first property id that is still free, for
  // further properties of the class. A class with such properties replaces set_property and get_property by its own
  // functions, which call set() and get() for all other ids.
  static guint install(GObjectClass* klass, const char* stats = nullptr) {
    klass->set_property = callback<set>;
    klass->get_property = callback<get>;
    if (stats)
      g_object_class_install_property(klass, kStats,
                                      g_param_spec_boxed("stats", "Statistics", stats, GST_TYPE_STRUCTURE,
                                                         GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
    if constexpr (kHasGuard) std::remove_reference_t<decltype(guard_of(nullptr))>::install(klass);
    return Settings::properties().install(klass, kFirstSetting);
  }
};

// One value of an enum type: the value, its description and its nick (the name that users write).
template <typename Enum>
struct EnumRow {
  Enum value;
  const char *text, *name;
};
// Registers an enum type for properties, as a part of the API of the plugin. Call this once for each type.
template <typename Enum>
GType register_enum(const char* type_name, std::initializer_list<EnumRow<Enum>> rows) {
  static auto& values = *new std::vector<GEnumValue>;  // never freed: the type system keeps pointers
  for (const EnumRow<Enum>& row : rows) values.push_back({static_cast<gint>(row.value), row.text, row.name});
  values.push_back({0, nullptr, nullptr});
  const GType type = g_enum_register_static(type_name, values.data());
  gst_type_mark_as_plugin_api(type, GstPluginAPIFlags(0));
  return type;
}

inline bool is_named(const GParamSpec* spec, const char* name) { return g_str_equal(spec->name, name); }

}  // namespace lf

// Type of the property "access" of elements that send or answer requests: how much of a view the cameras compute by
// themselves (lf::Access).
#define LF_TYPE_ACCESS (lf_access_get_type())
GType lf_access_get_type(void);

namespace lf {
const char* access_nick(Access access);
}  // namespace lf
