// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <initializer_list>
#include <span>
#include <string_view>

// Properties of a bin that are those of an element inside of it.
namespace lf {

// What a child has at first that its class does not say: a truth value, an int or a uint64.
struct CopyDefault {
  const char* name;
  gint64 value;
};

// Installs the properties that the class `child` has of its own, but for `without`, and those of its base classes that
// `with` names, under their names, with their texts, ranges and defaults, those in `defaults` with these, as properties
// first_id, first_id + 1, ... Returns the next id. They are not controllable, because a GstController syncs with the
// element that it is set at alone.
guint install_copies(GObjectClass* klass, guint first_id, GType child, std::initializer_list<std::string_view> without,
                     std::initializer_list<const char*> with = {}, std::span<const CopyDefault> defaults = {});

// Gives a new child these, but for those of type uint64.
void set_defaults(GstElement* child, std::span<const CopyDefault> defaults);

// Whether the property is such a copy; with `child`: of a property of that class.
bool is_copy(GParamSpec* spec, GType child = 0);

// Has `bin` tell of the changes of such properties of `child`, which no one else does.
void forward_notifications(GObject* bin, GObject* child);

}  // namespace lf
