// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lffragment
 * @title: lffragment
 * @short_description: the random access camera: answers view requests with the sum of what its cameras see
 *
 * Takes the video of one or more cameras of a rig on its `sink_%u` pads and view requests on `request`. Each request is
 * answered on `src` with the sum of what these cameras contribute to the requested view, of as much of the view as they
 * have a weight in; where the request has trials, what they came to goes before it. `lfcompositor` adds the answers of
 * all nodes up. Further requesters use the pads `request_%u`, each paired with a `src_%u`.
 *
 * With `access` the cameras are those of the paper's section 4.2 that know less: they take their part from warp or
 * pixel commands, which `lfviewrequest access=` sends behind its requests, and leave the requests themselves alone. Of
 * `rig` only their lenses count then, or only the sizes of their images.
 *
 * JPEG video is kept as it comes and decoded only where a request looks. Damaged frames are dropped and counted; the
 * one before serves in their place.
 *
 * Live cameras are never waited for: the frame nearest to the requested capture time is used, if it is not farther
 * than `max-skew`. A warning tells when a camera comes to be off by more than a frame. Frames of other cameras
 * (files) are waited for, so that files in give the same files out on every machine, and are read no faster than
 * requests move on. Where requests are sought, they are too.
 *
 * Requests whose pictures would come too late to be shown, as QoS events say that lfcompositor passes on, are answered
 * without fragments.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lffragment name=n rig=rig.json ! c.sink_0  lfcamsrc rig=rig.json camera=0 ! n.sink_0 \
 *   lfcamsrc rig=rig.json camera=1 ! n.sink_1  lfcamsrc rig=rig.json camera=8 ! n.sink_2 \
 *   r. ! queue ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]|
 *
 * ## Element messages
 * With `post-messages` an element message "lightfield-answer" per answer: view-id, sequence (uint), pts (uint64),
 * fragments (uint), bytes, and what it took: wait-ns (for frames of the time asked for), decode-ns, render-ns,
 * encode-ns (uint64).
 */

#include "fragment/lffragment.h"

#include <cstring>

#include "base/error.h"
#include "common/common.h"
#include "fragment/lffragment_private.h"

GST_DEBUG_CATEGORY(lf_fragment_debug);

namespace {

GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink_%u", GST_PAD_SINK, GST_PAD_REQUEST,
    GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_CAMERA_FORMATS
                                        " }") "; image/jpeg; " LF_CARD_VIDEO_CAPS("{ " LF_CAMERA_FORMATS " }")));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate more_request_template =
    GST_STATIC_PAD_TEMPLATE("request_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_CAPS));
GstStaticPadTemplate more_src_template =
    GST_STATIC_PAD_TEMPLATE("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(LF_ANSWER_CAPS));

}  // namespace

// The camera pads' properties, for gst-launch's `sink_0::camera=5`.
static GObject* lf_fragment_child_by_index(GstChildProxy* proxy, guint index) {
  std::vector<lf::PadPtr> pads = lf_fragment_camera_pads(LF_FRAGMENT(proxy));
  return index < pads.size() ? G_OBJECT(pads[index].release()) : nullptr;
}

static guint lf_fragment_children_count(GstChildProxy* proxy) {
  return static_cast<guint>(lf_fragment_camera_pads(LF_FRAGMENT(proxy)).size());
}

static void lf_fragment_child_proxy_init(gpointer iface, gpointer) {
  GstChildProxyInterface* proxy = static_cast<GstChildProxyInterface*>(iface);
  proxy->get_child_by_index = lf::callback<lf_fragment_child_by_index>;
  proxy->get_children_count = lf::callback<lf_fragment_children_count>;
}

G_DEFINE_FINAL_TYPE_WITH_CODE(LfFragment, lf_fragment, GST_TYPE_ELEMENT,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_CHILD_PROXY, lf_fragment_child_proxy_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lffragment, "lffragment", GST_RANK_NONE, LF_TYPE_FRAGMENT,
                                      GST_DEBUG_CATEGORY_INIT(lf_fragment_debug, "lffragment", 0,
                                                              "random access camera"))

static guint number_of(const gchar* name, const gchar* prefix, guint* next) {
  guint number = *next;
  if (name && g_str_has_prefix(name, prefix))
    number = static_cast<guint>(g_ascii_strtoull(name + strlen(prefix), nullptr, 10));
  *next = MAX(*next, number + 1);
  return number;
}

static GstPad* lf_fragment_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar* name,
                                           const GstCaps*) {
  LfFragment* self = LF_FRAGMENT(element);
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(element);
  if (templ == gst_element_class_get_pad_template(klass, "request_%u")) {
    const guint number = number_of(name, "request_", &self->state->next_pair);
    g_autofree gchar* request_name = g_strdup_printf("request_%u", number);
    g_autofree gchar* src_name = g_strdup_printf("src_%u", number);
    return lf_fragment_pair_new(self, templ, request_name, gst_element_class_get_pad_template(klass, "src_%u"),
                                src_name);
  }
  g_autofree gchar* pad_name = g_strdup_printf("sink_%u", number_of(name, "sink_", &self->state->next_camera_pad));
  GstPad* pad = lf_fragment_camera_pad_new(self, templ, pad_name);
  const auto& frames = LF_FRAGMENT_PAD(pad)->input->frames();
  lf::ObjectLock lock(self);
  const lf::CameraFrames::Mode mode = self->state->mode;
  lock.unlock();
  frames->set_mode(mode);
  if (mode == lf::CameraFrames::Mode::kRunning) self->state->node.inputs().add(frames);
  if (lf::is_running(element)) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(element, pad);
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), pad_name);
  return pad;
}

static void lf_fragment_release_pad(GstElement* element, GstPad* pad) {
  LfFragment* self = LF_FRAGMENT(element);
  if (LF_IS_FRAGMENT_PAD(pad)) {
    // Only when its streaming thread is out nothing of it comes back.
    const auto& frames = LF_FRAGMENT_PAD(pad)->input->frames();
    frames->set_mode(lf::CameraFrames::Mode::kStopped);
    gst_pad_set_active(pad, FALSE);
    self->state->node.inputs().remove(frames);
    gst_child_proxy_child_removed(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_PAD_NAME(pad));
    gst_element_remove_pad(element, pad);
    return;
  }
  lf_fragment_pair_release(self, pad);
}

static bool lf_fragment_start(LfFragment* self) {
  const lf::FragmentSettings settings = lf_fragment_settings(self);
  if (settings.rig.empty()) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("No rig file given: set the property \"rig\"."), (nullptr));
    return false;
  }
  auto& state = *self->state;
  try {
    state.node.inputs().set_rig(lf::shared_rig(settings.rig));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
  state.node.set_node_id(settings.node);
  state.node.inputs().forget_family();
  state.guard.clear();
  lf::ObjectLock lock(self);
  for (lf::Requester* requester : state.requesters) {
    requester->ended = false;
    requester->place.clear();
    requester->delay.clear();
    requester->qos.clear();
    requester->kept.rig.reset();
    *requester->kept.cancelled = false;
  }
  lock.unlock();
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  // A camera that the application names counts from the start on: its weight is lost in a sum until it has a frame.
  for (const lf::PadPtr& pad : lf_fragment_camera_pads(self)) {
    LfFragmentPad* camera_pad = LF_FRAGMENT_PAD(pad.get());
    if (camera_pad->settings.camera < 0 || camera_pad->input->assign()) continue;
    lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
    return false;
  }
  return true;
}

static GstStateChangeReturn lf_fragment_change_state(GstElement* element, GstStateChange transition) {
  LfFragment* self = LF_FRAGMENT(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !lf_fragment_start(self)) return GST_STATE_CHANGE_FAILURE;
  // Pads are deactivated by the parent class, which waits for their streaming threads: wake these first.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_fragment_parent_class)->change_state(element, transition);
  if (transition != GST_STATE_CHANGE_PAUSED_TO_READY) return result;
  for (const lf::PadPtr& pad : lf_fragment_camera_pads(self)) LF_FRAGMENT_PAD(pad.get())->input->reset();
  // Downstream's context is not to outlive what it is for. Without the lock, as that takes its time.
  std::vector<lf::NearCompositor> forgotten;
  self->state->card.leave();
  lf_fragment_note_context(self, nullptr);
  const lf::ObjectLock lock(self);
  for (lf::Requester* requester : self->state->requesters) forgotten.push_back(requester->compositor.forget());
  return result;
}

static void lf_fragment_finalize(GObject* object) {
  delete LF_FRAGMENT(object)->state;
  G_OBJECT_CLASS(lf_fragment_parent_class)->finalize(object);
}

static void lf_fragment_class_init(LfFragmentClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  object_class->finalize = lf_fragment_finalize;
  element_class->change_state = lf::callback<lf_fragment_change_state>;
  element_class->request_new_pad = lf::callback<lf_fragment_request_new_pad>;
  element_class->release_pad = lf::callback<lf_fragment_release_pad>;

  lf_fragment_install_properties(object_class);

  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, LF_TYPE_FRAGMENT_PAD);
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field random access camera", "Filter/Video",
      "Answers view requests with the sum of what its cameras contribute to the requested view",
      "gst-lightfield developers");
}

static void lf_fragment_init(LfFragment* self) {
  self->state = lf_fragment_state_new();
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(self);
  lf_fragment_pair_new(self, gst_element_class_get_pad_template(klass, "request"), "request",
                       gst_element_class_get_pad_template(klass, "src"), "src");
}
