// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <initializer_list>
#include <span>
#include <string_view>

// Proxies are properties of a bin that forward to the property of the same name of a child element. A bin such as
// lfviewsrc offers the properties of its children in this way, without declaring them again.
namespace lf {

// A default value of the bin that replaces the default value of the child's class.
struct ProxyDefault {
  const char* name;
  gint64 value;
};

// Installs a proxy for each property that the class `child` itself declares, except for the names in `without`.
// Inherited properties get a proxy only if they are in `with`. Names, blurbs, ranges and defaults are copied from the
// child, and `defaults` replaces some of the defaults. Proxies are not controllable, because a GstController changes
// only properties of the element that it is attached to. The proxies have the ids first_id, first_id + 1, and so on.
// Returns the next free id.
guint install_proxies(GObjectClass* klass, guint first_id, GType child, std::initializer_list<std::string_view> without,
                      std::initializer_list<const char*> with = {}, std::span<const ProxyDefault> defaults = {});

// Sets the properties in `defaults` of a new child, so that the child has the default values that the proxies of the
// bin announce. Properties of type uint64 are skipped.
void set_defaults(GstElement* child, std::span<const ProxyDefault> defaults);

// Returns true if the property of the bin is a proxy. If `child` is given, the function returns true only for proxies
// of that class's properties.
bool is_proxy(GParamSpec* spec, GType child = 0);

// Keeps applications informed: emits `notify` on `bin` whenever a property of `child` changes that has a proxy.
void forward_notifications(GObject* bin, GObject* child);

}  // namespace lf
