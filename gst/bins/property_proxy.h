// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <initializer_list>
#include <span>
#include <string_view>

// Bin properties that forward to a child element.
namespace lf {

// Default of a proxy that differs from the default of the child's class: boolean, int or uint64.
struct ProxyDefault {
  const char* name;
  gint64 value;
};

// Installs proxies of properties as ids first_id, first_id + 1, ... The proxies are the properties that the class
// `child` itself declares, except `without`, plus the inherited properties in `with`. Names, blurbs, ranges and
// defaults are copied; `defaults` overrides defaults. Returns the next free id. Proxies are not controllable: a
// GstController syncs only the element that it is attached to.
guint install_proxies(GObjectClass* klass, guint first_id, GType child, std::initializer_list<std::string_view> without,
                      std::initializer_list<const char*> with = {}, std::span<const ProxyDefault> defaults = {});

// Sets defaults on a new child, except defaults of type uint64.
void set_defaults(GstElement* child, std::span<const ProxyDefault> defaults);

// True if the property is a proxy. If `child` is given, the property must be a proxy of a property of that class.
bool is_proxy(GParamSpec* spec, GType child = 0);

// Emits `notify` on `bin` when a proxied property of `child` changes.
void forward_notifications(GObject* bin, GObject* child);

}  // namespace lf
