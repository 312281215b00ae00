// SPDX-License-Identifier: LGPL-2.1-or-later
#include "navigation_tap.h"

#include "guard.h"

namespace lf {
namespace {

GstElement* find_in_pipeline(GstElement* element, const std::string& name) {
  GstObject* top = GST_OBJECT(gst_object_ref(element));
  while (GstObject* parent = gst_object_get_parent(top)) {
    gst_object_unref(top);
    top = parent;
  }
  GstElement* found = GST_IS_BIN(top) ? gst_bin_get_by_name(GST_BIN(top), name.c_str()) : nullptr;
  gst_object_unref(top);
  return found;
}

}  // namespace

bool NavigationTap::attach(GstElement* element, const std::string& name, std::function<void(GstEvent*)> navigated) {
  detach();
  GstElement* source = find_in_pipeline(element, name);
  if (!source) return false;
  navigated_ = std::move(navigated);
  const auto probe = [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
    return guarded(pad, GST_PAD_PROBE_OK, [&] {
      static_cast<NavigationTap*>(data)->navigated_(GST_PAD_PROBE_INFO_EVENT(info));
      return GST_PAD_PROBE_OK;
    });
  };
  lf::ObjectLock lock(source);
  for (GList* item = source->srcpads; item; item = item->next)
    probes_.emplace_back(GST_PAD(gst_object_ref(item->data)), 0);
  lock.unlock();
  gst_object_unref(source);
  for (auto& [pad, id] : probes_) id = gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, probe, this, nullptr);
  return !probes_.empty();
}

void NavigationTap::detach() {
  for (const auto& [pad, id] : probes_) {
    gst_pad_remove_probe(pad, id);
    gst_object_unref(pad);
  }
  probes_.clear();
}

}  // namespace lf
