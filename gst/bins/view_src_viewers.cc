// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>

#include "base/error.h"
#include "bins/lfviewsrc_private.h"
#include "bins/property_copy.h"
#include "common/common.h"
#include "compositor/lfcompositor.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_src_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_view_src_debug

constexpr guint kFirstOfReopened = 1 << 20;

// View 0 by src, view 1 by src_0, and so on. Of a closed viewer there may still be answers, so that who comes by the
// same pad is another view, unless others name it.
static guint choose_view_id(LfViewSrc* self, const std::string& ending) {
  std::set<guint>& used = self->inside->view_ids;
  const guint id = ending.empty() ? 0 : static_cast<guint>(g_ascii_strtoull(ending.c_str() + 1, nullptr, 10)) + 1;
  if (used.insert(id).second || !lf_view_src_hosts(self).listen.empty()) return id;
  guint next = kFirstOfReopened;
  if (*used.rbegin() >= next) next = *used.rbegin() + 1;
  used.insert(next);
  return next;
}

void lf_view_src_connect(LfViewSrc* self, LfViewSrcViewer& viewer) {
  auto& inside = *self->inside;
  if (inside.requests) viewer.requests = inside.requests->connect(viewer.chain);
  if (inside.cameras) viewer.pads = inside.cameras->connect(viewer.chain);
}

// The viewer whose pictures leave by the pad `name`. Throws Error.
static std::shared_ptr<LfViewSrcViewer> add_viewer(LfViewSrc* self, const std::string& name) {
  auto& inside = *self->inside;
  const std::string ending = name.substr(sizeof("src") - 1);
  const auto viewer = std::make_shared<LfViewSrcViewer>(GST_BIN(self), choose_view_id(self, ending), ending);
  inside.viewers[name] = viewer;
  const std::string rig = lf_view_src_rig(self);
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
    lf_view_src_connect(self, *viewer);
    GstPad* pad = add_ghost_pad(self, *viewer, name.c_str(), "src_%u");
    viewer->chain.follow_bin();
    return pad;
  } catch (const std::exception& error) {
    GST_ERROR_OBJECT(self, "no pad %s: %s", name.c_str(), error.what());
  }
  if (const auto half = inside.viewers.find(name); half != inside.viewers.end()) {
    half->second->chain.take_out();
    half->second->requests.reset();
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
  viewer->chain.close([&] {
    viewer->requests.reset();
    viewer->pads.reset();
  });
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

void lf_view_src_install_pads(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_src_new_pad>;
  klass->release_pad = lf::callback<lf_view_src_release_pad>;
  GstElementClass* compositor = GST_ELEMENT_CLASS(g_type_class_ref(LF_TYPE_COMPOSITOR));
  GstCaps* caps = gst_pad_template_get_caps(gst_element_class_get_pad_template(compositor, "src"));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, caps));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src_%u", GST_PAD_SRC, GST_PAD_REQUEST, caps));
  gst_caps_unref(caps);
  g_type_class_unref(compositor);
}
