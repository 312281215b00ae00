// SPDX-License-Identifier: LGPL-2.1-or-later
#include "playout_delay.h"

#include <gst/rtp/gstrtphdrext.h>

#include <cstring>

namespace lf::serve {
namespace {

// Least and most delay, 12 bits each, in steps of 10 ms: none.
constexpr gsize kBytes = 3;

struct PlayoutDelay {
  GstRTPHeaderExtension parent;
};
struct PlayoutDelayClass {
  GstRTPHeaderExtensionClass parent_class;
};
G_DEFINE_TYPE(PlayoutDelay, playout_delay, GST_TYPE_RTP_HEADER_EXTENSION)

void playout_delay_init(PlayoutDelay*) {}

void playout_delay_class_init(PlayoutDelayClass* klass) {
  GstRTPHeaderExtensionClass* extension = &klass->parent_class;
  extension->get_supported_flags = [](GstRTPHeaderExtension*) {
    return GstRTPHeaderExtensionFlags(GST_RTP_HEADER_EXTENSION_ONE_BYTE | GST_RTP_HEADER_EXTENSION_TWO_BYTE);
  };
  extension->get_max_size = [](GstRTPHeaderExtension*, const GstBuffer*) { return kBytes; };
  extension->write = [](GstRTPHeaderExtension*, const GstBuffer*, GstRTPHeaderExtensionFlags, GstBuffer*, guint8* data,
                        gsize size) -> gssize {
    if (size < kBytes) return -1;
    std::memset(data, 0, kBytes);
    return kBytes;
  };
  gst_rtp_header_extension_class_set_uri(extension, kPlayoutDelayUri);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Playout delay", GST_RTP_HDREXT_ELEMENT_CLASS,
                                        "Has pictures shown as soon as they are decoded", "gst-lightfield");
}

}  // namespace

void add_playout_delay(GstElement* payloader, guint id) {
  GstRTPHeaderExtension* extension = GST_RTP_HEADER_EXTENSION(g_object_new(playout_delay_get_type(), nullptr));
  gst_rtp_header_extension_set_id(extension, id);
  g_signal_emit_by_name(payloader, "add-extension", extension);
}

}  // namespace lf::serve
