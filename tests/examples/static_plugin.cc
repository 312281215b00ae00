// SPDX-License-Identifier: LGPL-2.1-or-later
//
// A program with the statically linked plugin has the elements without an installed plugin.
#include <gst/gst.h>

#include <cstdio>
#include <initializer_list>

extern "C" {
GST_PLUGIN_STATIC_DECLARE(lightfield);
}

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  GST_PLUGIN_STATIC_REGISTER(lightfield);
  for (const char* name : {"lffragment", "lfcompositor", "lfviewrequest", "lfviewsrc", "rtplfpay"}) {
    GstElement* element = gst_element_factory_make(name, nullptr);
    if (!element) {
      std::printf("no %s\n", name);
      return 1;
    }
    gst_object_unref(element);
  }
  return 0;
}
