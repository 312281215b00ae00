// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/guard.h"

#include <new>

namespace lf {
namespace {

// Returns the element that the object is or belongs to. Null if there is none. The caller owns the reference.
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

void post_error(GstElement* element, const char* what) {
  GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s", what), (nullptr));
}

void post_warning(GstElement* element, const char* what) {
  GST_ELEMENT_WARNING(element, LIBRARY, FAILED, ("%s", what), (nullptr));
}

// Describes the current exception and passes the text to post(). Takes the reference to the element.
void describe_current_exception(GstElement* element, void (*post)(GstElement*, const char*)) {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    post(element, "Out of memory.");
  } catch (const std::exception& error) {
    post(element, error.what());
  } catch (...) {
    post(element, "Unknown exception.");
  }
  gst_object_unref(element);
}

bool is_time_to_warn(GstElement* element) {
  static const GQuark quark = g_quark_from_static_string("lf-warned-at");
  const auto second = static_cast<guint>(g_get_monotonic_time() / G_USEC_PER_SEC) + 1;
  const guint last = GPOINTER_TO_UINT(g_object_get_qdata(G_OBJECT(element), quark));
  if (last == second) return false;
  g_object_set_qdata(G_OBJECT(element), quark, GUINT_TO_POINTER(second));
  return true;
}

}  // namespace

void post_current_exception(gpointer object) {
  if (GstElement* element = element_of(object)) describe_current_exception(element, post_error);
}

void warn_of_current_exception(gpointer object) {
  GstElement* element = element_of(object);
  if (!element) return;
  if (is_time_to_warn(element))
    describe_current_exception(element, post_warning);
  else
    gst_object_unref(element);
}

}  // namespace lf
