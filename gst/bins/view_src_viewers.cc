// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>

#include "base/error.h"
#include "bins/lfviewsrc_private.h"
#include "bins/property_copy.h"
#include "common/common.h"
#include "compositor/lfcompositor.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_src_debug);
#define GST_CAT_DEFAULT lf_view_src_debug

// The viewer whose pictures leave by the pad `name`. Throws Error.
static std::shared_ptr<LfViewSrcViewer> add_viewer(LfViewSrc* self, const std::string& name) {
  auto& inside = *self->inside;
  const std::string ending = name.substr(sizeof("src") - 1);
  const auto viewer = std::make_shared<LfViewSrcViewer>(GST_BIN(self), inside.next_view_id++, ending);
  inside.viewers[name] = viewer;
  const std::string rig = lf_view_src_text(self, &self->rig);
  if (!rig.empty()) {
    g_object_set(viewer->chain.view(), "rig", rig.c_str(), nullptr);
    g_object_set(viewer->chain.compositor(), "rig", rig.c_str(), nullptr);
  }
  viewer->chain.set_live(lf_view_src_is_live(self));
  return viewer;
}

static GstPad* add_ghost_pad(LfViewSrc* self, const LfViewSrcViewer& viewer, const char* name,
                             const char* template_name) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), template_name);
  GstPad* target = viewer.chain.pictures();
  GstPad* pad = gst_ghost_pad_new_from_template(name, target, templ);
  gst_object_unref(target);
  if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  return pad;
}

static GstPad* lf_view_src_new_pad(GstElement* element, GstPadTemplate*, const gchar* wanted, const GstCaps*) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  auto& inside = *self->inside;
  std::string name = wanted ? wanted : "";
  for (guint number = 0; name.empty() || (!wanted && inside.viewers.contains(name)); number++)
    name = "src_" + std::to_string(number);
  if (!self->view || inside.viewers.contains(name)) return nullptr;
  try {
    const std::shared_ptr<LfViewSrcViewer> viewer = add_viewer(self, name);
    lf_view_src_copy_settings(self, viewer->chain);
    if (inside.cameras) viewer->pads = inside.cameras->connect(viewer->chain);
    GstPad* pad = add_ghost_pad(self, *viewer, name.c_str(), "src_%u");
    viewer->chain.follow_bin();
    return pad;
  } catch (const std::exception& error) {
    GST_ERROR_OBJECT(self, "no pad %s: %s", name.c_str(), error.what());
  }
  if (const auto half = inside.viewers.find(name); half != inside.viewers.end()) {
    half->second->chain.take_out();
    half->second->pads.reset();
    inside.viewers.erase(half);
  }
  return nullptr;
}

namespace {

struct Closing {
  std::shared_ptr<LfViewSrcViewer> viewer;
  GstPad* pad;
};

void close_viewer(GstElement*, gpointer data) {
  auto& [viewer, pad] = *static_cast<Closing*>(data);
  viewer->chain.close([&] { viewer->pads.reset(); });
  gst_pad_set_active(pad, FALSE);
}

void free_closing(gpointer data) {
  Closing* closing = static_cast<Closing*>(data);
  gst_object_unref(closing->pad);
  delete closing;
}

}  // namespace

// The viewer stops in another thread: this may be one of its own, in a probe, or somebody may hold its last picture.
static void lf_view_src_release_pad(GstElement* element, GstPad* pad) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  const auto found = self->inside->viewers.find(GST_PAD_NAME(pad));
  if (found == self->inside->viewers.end()) {  // the element itself goes, see dispose
    gst_element_remove_pad(element, pad);
    return;
  }
  Closing* closing = new Closing{found->second, GST_PAD(gst_object_ref(pad))};
  self->inside->viewers.erase(found);
  gst_ghost_pad_set_target(GST_GHOST_PAD(pad), nullptr);
  gst_element_remove_pad(element, pad);
  closing->viewer->chain.take_out();
  gst_element_call_async(element, lf::callback<close_viewer>, closing, free_closing);
}

void lf_view_src_add_main_viewer(LfViewSrc* self) {
  const std::shared_ptr<LfViewSrcViewer> viewer = add_viewer(self, "src");
  self->view = viewer->chain.view();
  self->compositor = viewer->chain.compositor();
  lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->view));
  lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->compositor));
  add_ghost_pad(self, *viewer, "src", "src");
  viewer->chain.follow_bin();
}

// Of what lfcompositor puts out the pictures.
void lf_view_src_install_pads(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_src_new_pad>;
  klass->release_pad = lf::callback<lf_view_src_release_pad>;
  GstElementClass* compositor = GST_ELEMENT_CLASS(g_type_class_ref(LF_TYPE_COMPOSITOR));
  GstCaps* all = gst_pad_template_get_caps(gst_element_class_get_pad_template(compositor, "src"));
  GstCaps* video = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(all); i++) {
    const GstStructure* structure = gst_caps_get_structure(all, i);
    if (gst_structure_has_name(structure, "video/x-raw"))
      gst_caps_append_structure(video, gst_structure_copy(structure));
  }
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, video));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src_%u", GST_PAD_SRC, GST_PAD_REQUEST, video));
  gst_caps_unref(video);
  gst_caps_unref(all);
  g_type_class_unref(compositor);
}
