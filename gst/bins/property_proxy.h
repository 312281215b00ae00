// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <initializer_list>
#include <span>
#include <string_view>

// Proxies: properties of a bin that forward to a child element, so that the bin need not declare them again.
namespace lf {

// A default of the bin that replaces the default of the child's class.
struct ProxyDefault {
  const char* name;
  gint64 value;
};

// Installs proxies with the ids first_id, first_id + 1, and so on, and returns the next free id. There is a proxy for
// each property that the class `child` itself declares, except `without`, and for the inherited properties in `with`.
// Names, blurbs, ranges and defaults are copied from the child; `defaults` replaces defaults. Proxies are not
// controllable, because a GstController syncs only the element that it is attached to.
guint install_proxies(GObjectClass* klass, guint first_id, GType child, std::initializer_list<std::string_view> without,
                      std::initializer_list<const char*> with = {}, std::span<const ProxyDefault> defaults = {});

// Sets these defaults on a new child. Defaults of type uint64 are skipped.
void set_defaults(GstElement* child, std::span<const ProxyDefault> defaults);

// Returns true if the property is a proxy (and, if `child` is given, a proxy of a property of that class).
bool is_proxy(GParamSpec* spec, GType child = 0);

// Emits `notify` on `bin` when a proxied property of `child` changes.
void forward_notifications(GObject* bin, GObject* child);

}  // namespace lf
