// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/loss_fixture.h"

namespace lf::test {
namespace {

struct Source {
  GstBin parent;
  size_t id;
  std::atomic<int> frames;
};
struct SourceClass {
  GstBinClass parent_class;
};

void uri_handler_init(gpointer iface, gpointer) {
  auto* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = [](GType) { return GST_URI_SRC; };
  handler->get_protocols = [](GType) -> const gchar* const* {
    static const gchar* const protocols[] = {"failing", nullptr};
    return protocols;
  };
  handler->get_uri = [](GstURIHandler* self) {
    return g_strdup_printf("failing://%zu", reinterpret_cast<Source*>(self)->id);
  };
  handler->set_uri = [](GstURIHandler* self, const gchar* uri, GError**) -> gboolean {
    reinterpret_cast<Source*>(self)->id = std::strtoul(uri + sizeof("failing://") - 1, nullptr, 10);
    return TRUE;
  };
}

G_DEFINE_TYPE_WITH_CODE(Source, failing_source, GST_TYPE_BIN,
                        G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, uri_handler_init))

GstStaticPadTemplate source_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS("video/x-raw, format=I420, width=64, height=48, framerate=30/1"));

GstPadProbeReturn on_frame(GstPad*, GstPadProbeInfo* info, gpointer data) {
  auto* self = static_cast<Source*>(data);
  FailingDevice& device = failing_device(self->id);
  if (device.stalls) return GST_PAD_PROBE_DROP;
  const int most = device.frames_at_most;
  const bool fails = device.broken || (most > 0 && self->frames >= most);
  self->frames++;
  if (!fails && !device.ends) return GST_PAD_PROBE_OK;
  if (fails) GST_ELEMENT_ERROR(self, RESOURCE, READ, ("Device %zu is gone.", self->id), (nullptr));
  gst_clear_buffer(reinterpret_cast<GstBuffer**>(&info->data));
  GST_PAD_PROBE_INFO_FLOW_RETURN(info) = fails ? GST_FLOW_ERROR : GST_FLOW_EOS;
  return GST_PAD_PROBE_HANDLED;
}

GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto* self = reinterpret_cast<Source*>(element);
  if (transition == GST_STATE_CHANGE_NULL_TO_READY) {
    FailingDevice& device = failing_device(self->id);
    device.opened++;
    self->frames = 0;
    if (device.broken) {
      GST_ELEMENT_ERROR(self, RESOURCE, BUSY, ("Device %zu is busy.", self->id), (nullptr));
      return GST_STATE_CHANGE_FAILURE;
    }
  }
  return GST_ELEMENT_CLASS(failing_source_parent_class)->change_state(element, transition);
}

void failing_source_class_init(SourceClass* klass) {
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &source_template);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Failing camera", "Source/Video", "Fake", "none");
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
}

void failing_source_init(Source* self) {
  GstElement* test = gst_element_factory_make("videotestsrc", nullptr);
  GstElement* filter = gst_element_factory_make("capsfilter", nullptr);
  gst_util_set_object_arg(G_OBJECT(test), "pattern", "white");
  g_object_set(test, "is-live", TRUE, nullptr);
  const CapsPtr caps(gst_static_pad_template_get_caps(&source_template));
  g_object_set(filter, "caps", caps.get(), nullptr);
  gst_bin_add_many(GST_BIN(self), test, filter, nullptr);
  gst_element_link(test, filter);
  const PadPtr target = pad_of(filter, "src");
  gst_pad_add_probe(target.get(), GST_PAD_PROBE_TYPE_BUFFER, on_frame, self, nullptr);
  g_autoptr(GstPadTemplate) pad_template = gst_static_pad_template_get(&source_template);
  gst_element_add_pad(GST_ELEMENT(self), gst_ghost_pad_new_from_template("src", target.get(), pad_template));
}

}  // namespace

void register_failing_camera() {
  gst_element_register(nullptr, "failingcamera", GST_RANK_PRIMARY, failing_source_get_type());
}

}  // namespace lf::test
