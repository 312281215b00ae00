// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/guard.h"

#include <new>

namespace lf {
namespace {

// An element, or the one that an object belongs to. Owned by the caller; null if there is none.
GstElement* element_of(gpointer object) {
  if (!object || !GST_IS_OBJECT(object)) return nullptr;
  GstObject* owner = GST_OBJECT(gst_object_ref(object));
  while (owner && !GST_IS_ELEMENT(owner)) {
    GstObject* parent = gst_object_get_parent(owner);
    gst_object_unref(owner);
    owner = parent;
  }
  return GST_ELEMENT(owner);
}

void post(GstElement* element, const char* what) {
  if (!element) return;
  GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s", what), (nullptr));
  gst_object_unref(element);
}

}  // namespace

void post_current_exception(gpointer object) {
  GstElement* element = element_of(object);
  try {
    throw;
  } catch (const std::bad_alloc&) {
    post(element, "There is no memory left.");
  } catch (const std::exception& error) {
    post(element, error.what());
  } catch (...) {
    post(element, "An exception of an unknown kind.");
  }
}

}  // namespace lf
