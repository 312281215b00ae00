// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/navigation_tap.h"

#include "common/guard.h"

namespace lf {
namespace {

// Who listens, as a probe knows it. GStreamer does not wait for a probe that is at work when it is removed.
struct Listener {
  Listener(GstElement* of, void (*call)(GstElement*, GstEvent*)) : navigated(call) { g_weak_ref_init(&element, of); }
  ~Listener() { g_weak_ref_clear(&element); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  GWeakRef element;
  void (*navigated)(GstElement*, GstEvent*);
};

GstPadProbeReturn on_event(GstPad* /*pad*/, GstPadProbeInfo* info, gpointer data) {
  auto& listener = *static_cast<Listener*>(data);
  auto* element = static_cast<GstElement*>(g_weak_ref_get(&listener.element));
  if (!element) return GST_PAD_PROBE_OK;
  guarded(element, 0, [&] { return listener.navigated(element, GST_PAD_PROBE_INFO_EVENT(info)), 0; });
  gst_object_unref(element);
  return GST_PAD_PROBE_OK;
}

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

bool NavigationTap::attach(GstElement* element, const std::string& name, void (*navigated)(GstElement*, GstEvent*)) {
  detach();
  GstElement* source = find_in_pipeline(element, name);
  if (!source) return false;
  lf::ObjectLock lock(source);
  for (GList* item = source->srcpads; item; item = item->next)
    probes_.emplace_back(GST_PAD(gst_object_ref(item->data)), 0);
  lock.unlock();
  gst_object_unref(source);
  for (auto& [pad, id] : probes_)
    id = gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, on_event, new Listener(element, navigated),
                           [](gpointer data) { delete static_cast<Listener*>(data); });
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
