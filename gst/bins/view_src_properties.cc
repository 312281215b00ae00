// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <array>
#include <string>

#include "bins/lfviewsrc_private.h"
#include "bins/property_copy.h"
#include "common/access.h"
#include "compositor/lfcompositor.h"
#include "fragment/lffragment.h"
#include "viewrequest/lfviewrequest.h"
#include "viewrequest/view_control.h"

namespace {

// Of one viewer and no other.
constexpr std::array kOwnProperties = {"location", "loop", "num-buffers"};

bool is_own(const char* name) {
  return std::ranges::any_of(kOwnProperties, [name](const char* own) { return g_str_equal(own, name); }) ||
         std::ranges::any_of(lf::kViewFields, [name](const lf::ViewField& f) { return g_str_equal(f.name, name); });
}

}  // namespace

static LfViewSrcSettings& settings_of(LfViewSrc* self) { return *self->settings; }
using Properties = lf::Properties<settings_of>;

std::string lf_view_src_rig(LfViewSrc* self) { return Properties::now(self).rig; }
LfViewSrcHosts lf_view_src_hosts(LfViewSrc* self) { return Properties::now(self); }
bool lf_view_src_is_live(LfViewSrc* self) { return Properties::now(self).is_live; }
std::string lf_view_src_record(LfViewSrc* self) { return Properties::now(self).record; }

static GstElement* find_node(LfViewSrc* self) { return gst_bin_get_by_name(GST_BIN(self), "node"); }

void lf_view_src_set_node(LfViewSrc* self) {
  GstElement* node = find_node(self);
  if (!node) return;
  const LfViewSrcSettings settings = Properties::now(self);
  const auto text_or_null = [](const std::string& text) { return text.empty() ? nullptr : text.c_str(); };
  g_object_set(node, "is-live", settings.is_live, "rig", text_or_null(settings.rig), "record",
               text_or_null(settings.record), "renderer", static_cast<gint>(settings.renderer), "trusted",
               settings.trusted, nullptr);
  gst_object_unref(node);
}

void lf_view_src_follow_access(LfViewSrc* self, const lf::ViewerChain& viewer) {
  GstElement* node = find_node(self);
  if (!node) return;
  gint access = 0;
  g_object_get(node, "access", &access, nullptr);
  gst_object_unref(node);
  if (access != static_cast<gint>(lf::Access::kSelf)) g_object_set(viewer.view(), "access", access, nullptr);
}

static void set_by_uri(LfViewSrc* self, bool by_uri) {
  const lf::ObjectLock lock(self);
  self->by_uri = by_uri;
}

// While it runs a node may have other cameras, and not take the rig: then nobody does. False if so.
static bool give_rig(LfViewSrc* self, const gchar* path) {
  if (GstElement* node = find_node(self)) {
    g_object_set(node, "rig", path, nullptr);
    g_autofree gchar* taken = nullptr;
    g_object_get(node, "rig", &taken, nullptr);
    gst_object_unref(node);
    if (g_strcmp0(taken, path) != 0) return false;
  }
  for (auto& [name, viewer] : self->inside->viewers) {
    g_object_set(viewer->chain.view(), "rig", path, nullptr);
    g_object_set(viewer->chain.compositor(), "rig", path, nullptr);
  }
  return true;
}

static void give_live(LfViewSrc* self, gboolean live) {
  for (auto& [name, viewer] : self->inside->viewers) viewer->chain.set_live(live);
  lf_view_src_set_node(self);
}

static GstElement* owner_of(LfViewSrc* self, GParamSpec* copy) {
  return lf::is_copy(copy, LF_TYPE_VIEW_REQUEST) ? self->view : self->compositor;
}

static void lf_view_src_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  if (lf::is_copy(pspec)) {
    if (GstElement* owner = owner_of(self, pspec)) g_object_set_property(G_OBJECT(owner), pspec->name, value);
    return;
  }
  const std::lock_guard lock(self->inside->mutex);
  if (lf::is_named(pspec, "rig") && !give_rig(self, g_value_get_string(value))) return;
  Properties::set(object, id, value, pspec);
  if (lf::is_named(pspec, "rig")) set_by_uri(self, false);
  if (lf::is_named(pspec, "is-live")) give_live(self, g_value_get_boolean(value));
  if (lf::is_named(pspec, "record") || lf::is_named(pspec, "renderer") || lf::is_named(pspec, "trusted"))
    lf_view_src_set_node(self);
}

static void lf_view_src_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!lf::is_copy(pspec)) return Properties::get(object, id, value, pspec);
  if (GstElement* owner = owner_of(LF_VIEW_SRC(object), pspec))
    g_object_get_property(G_OBJECT(owner), pspec->name, value);
}

void lf_view_src_copy_settings(LfViewSrc* self, const lf::ViewerChain& to) {
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(self), &count);
  for (guint i = 0; i < count; i++) {
    GParamSpec* spec = specs[i];
    if (!lf::is_copy(spec) || !(spec->flags & G_PARAM_WRITABLE) || is_own(spec->name)) continue;
    const bool of_view = lf::is_copy(spec, LF_TYPE_VIEW_REQUEST);
    GValue value = G_VALUE_INIT;
    g_object_get_property(G_OBJECT(self), spec->name, &value);
    g_object_set_property(G_OBJECT(of_view ? to.view() : to.compositor()), spec->name, &value);
    g_value_unset(&value);
  }
  lf_view_src_follow_access(self, to);
}

static GstURIType lf_view_src_uri_type(GType) { return GST_URI_SRC; }

static const gchar* const* lf_view_src_protocols(GType) {
  static const gchar* const protocols[] = {"lf", nullptr};
  return protocols;
}

static gchar* lf_view_src_uri(GstURIHandler* handler) {
  const std::string rig = lf_view_src_rig(LF_VIEW_SRC(handler));
  if (rig.empty()) return nullptr;
  g_autofree gchar* whole = g_canonicalize_filename(rig.c_str(), nullptr);
  g_autofree gchar* escaped = g_uri_escape_string(whole, G_URI_RESERVED_CHARS_ALLOWED_IN_PATH, FALSE);
  return g_strconcat("lf://", escaped, nullptr);
}

static gboolean lf_view_src_set_uri(GstURIHandler* handler, const gchar* uri, GError** error) {
  g_autofree gchar* path = gst_uri_get_location(uri);
  if (!path || path[0] != '/') {
    g_set_error(error, GST_URI_ERROR, GST_URI_ERROR_BAD_URI, "%s: must be lf:///path/of/rig.json", uri);
    return FALSE;
  }
  const std::lock_guard lock(LF_VIEW_SRC(handler)->inside->mutex);
  g_object_set(handler, "rig", path, nullptr);
  set_by_uri(LF_VIEW_SRC(handler), true);
  return TRUE;
}

void lf_view_src_uri_handler_init(gpointer iface, gpointer) {
  GstURIHandlerInterface* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = lf_view_src_uri_type;
  handler->get_protocols = lf_view_src_protocols;
  handler->get_uri = lf::callback<lf_view_src_uri>;
  handler->set_uri = lf::callback<lf_view_src_set_uri>;
}

static gboolean lf_view_src_set_view(LfViewSrc* self, const GstStructure* structure) {
  gboolean done = FALSE;
  if (self->view) g_signal_emit_by_name(self->view, "set-view", structure, &done);
  return done;
}

static gboolean lf_view_src_focus_at(LfViewSrc* self, gdouble x, gdouble y) {
  gboolean done = FALSE;
  if (self->view) g_signal_emit_by_name(self->view, "focus-at", x, y, &done);
  return done;
}

void lf_view_src_install_actions(GObjectClass* klass) {
  /**
   * LfViewSrc::set-view:
   * @src: the element
   * @view: as of lfviewrequest
   *
   * Moves the view of `src`, as the same action of lfviewrequest does. That of `src_0` is moved by its child "view_0".
   *
   * Returns: %FALSE if nothing of @view is known.
   */
  g_signal_new_class_handler("set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_src_set_view>), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN,
                             1, GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);
  /**
   * LfViewSrc::focus-at:
   * @src: the element
   * @x: pixels of the view, of a set of the whole picture, from the middle of its first one
   * @y: the same
   *
   * Focuses the view of `src` at a pixel, as the same action of lfviewrequest does.
   *
   * Returns: %FALSE if that can't be.
   */
  g_signal_new_class_handler("focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_src_focus_at>), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN,
                             2, G_TYPE_DOUBLE, G_TYPE_DOUBLE);
}

lf::PropertyTable<LfViewSrcSettings>& LfViewSrcSettings::properties() {
  using S = LfViewSrcSettings;
  static lf::PropertyTable<S> table = {
      lf::property<&S::rig>(
          lf::kWhilePlaying, "rig", "Rig",
          "Rig file (rig.json) of the array; required. Set while running, it is read again and serves from the next "
          "request on, if it has the same cameras with the same sources"),
      lf::inherited_property<S, &S::nodes>(
          lf::kWhileReady, "nodes", "Nodes",
          "Hosts that the cameras are on (lfnodesink): HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE,..., with the ports "
          "for requests there and for answers here, and the address of this machine that those come in at (none: any). "
          "They are live (empty: all cameras are on this machine)"),
      lf::inherited_property<S, &S::listen>(
          lf::kWhileReady, "listen", "Listen",
          "UDP port, ADDRESS:PORT of this machine or GROUP:PORT of a multicast group where viewers on other hosts ask "
          "for views, which are shown in place of views of its own: view 0 by src, view 1 by src_0, and so on (none: "
          "viewers are here)"),
      lf::inherited_property<S, &S::key_file>(
          lf::kWhileReady, "key-file", "Key file",
          "With nodes or listen: file with the secret that all hosts share, 32 or more random characters (none: "
          "whoever is on the network can see and steer)"),
      lf::inherited_property<S, &S::peers>(
          lf::kWhileReady, "peers", "Peers",
          "With listen: names, addresses and networks (10.0.0.0/24) that requests are taken from, with commas between "
          "(none: with a key-file all that have it; else the first address of this machine that asks)"),
      lf::property<&S::is_live>(lf::kWhileReady, "is-live", "Is live",
                                "Pictures come in time with the clock, of frames that live cameras make, in place of "
                                "as fast as they are taken"),
      lf::property<&S::record>(
          lf::kWhileReady, "record", "Record",
          "Folder that the cameras are recorded into from the start to the stop, with a rig.json to play them by; it "
          "must not have one already. Of nodes: see lfnodesink (none: not recorded)"),
      lf::property<&S::renderer>(lf::kWhilePlaying, "renderer", "Renderer",
                                 "What draws the sums of cameras of this machine, as of lfcameranode",
                                 LF_TYPE_FRAGMENT_RENDERER),
      lf::property<&S::trusted>(
          lf::kWhileReady, "trusted", "Trusted",
          "Whether the rig file may run any element: without it, sources that describe elements can "
          "have sources, converters and decoders of a short list only"),
  };
  return table;
}

void lf_view_src_install_properties(GObjectClass* klass) {
  const guint first_copy = Properties::install(klass);
  klass->set_property = lf::callback<lf_view_src_set_property>;
  klass->get_property = lf::callback<lf_view_src_get_property>;
  const guint next = lf::install_copies(klass, first_copy, LF_TYPE_VIEW_REQUEST,
                                        {"rig", "view-id", "is-live", "navigation-from", "access"}, {"num-buffers"});
  constexpr lf::CopyDefault kLatency[] = {{"latency", LF_COMPOSITOR_LATENCY}};
  lf::install_copies(klass, next, LF_TYPE_COMPOSITOR, {"rig", "view-id"}, {"latency"}, kLatency);
}
