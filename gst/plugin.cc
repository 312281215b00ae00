// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "config.h"

GST_ELEMENT_REGISTER_DECLARE(lfcameranode)
GST_ELEMENT_REGISTER_DECLARE(lfcamsrc)
GST_ELEMENT_REGISTER_DECLARE(lfcompositor)
GST_ELEMENT_REGISTER_DECLARE(lffragment)
GST_ELEMENT_REGISTER_DECLARE(lflenticular)
GST_ELEMENT_REGISTER_DECLARE(lfnodesink)
GST_ELEMENT_REGISTER_DECLARE(lfparse)
GST_ELEMENT_REGISTER_DECLARE(lfrtpgate)
GST_ELEMENT_REGISTER_DECLARE(lfrtpseal)
GST_ELEMENT_REGISTER_DECLARE(lfviewrequest)
GST_ELEMENT_REGISTER_DECLARE(lfviewsrc)
GST_ELEMENT_REGISTER_DECLARE(rtplfdepay)
GST_ELEMENT_REGISTER_DECLARE(rtplfpay)
GST_TYPE_FIND_REGISTER_DECLARE(lightfield)

static gboolean plugin_init(GstPlugin* plugin) {
  gboolean ok = TRUE;
  ok &= GST_ELEMENT_REGISTER(lfcameranode, plugin);
  ok &= GST_ELEMENT_REGISTER(lfcamsrc, plugin);
  ok &= GST_ELEMENT_REGISTER(lfcompositor, plugin);
  ok &= GST_ELEMENT_REGISTER(lffragment, plugin);
  ok &= GST_ELEMENT_REGISTER(lflenticular, plugin);
  ok &= GST_ELEMENT_REGISTER(lfnodesink, plugin);
  ok &= GST_ELEMENT_REGISTER(lfparse, plugin);
  ok &= GST_ELEMENT_REGISTER(lfrtpgate, plugin);
  ok &= GST_ELEMENT_REGISTER(lfrtpseal, plugin);
  ok &= GST_ELEMENT_REGISTER(lfviewrequest, plugin);
  ok &= GST_ELEMENT_REGISTER(lfviewsrc, plugin);
  ok &= GST_ELEMENT_REGISTER(rtplfdepay, plugin);
  ok &= GST_ELEMENT_REGISTER(rtplfpay, plugin);
  ok &= GST_TYPE_FIND_REGISTER(lightfield, plugin);
  return ok;
}

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, lightfield, "Real-time, distributed light field camera",
                  plugin_init, PACKAGE_VERSION, "LGPL", PACKAGE_NAME, "https://gst-lightfield.invalid/")
