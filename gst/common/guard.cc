// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/guard.h"

#include <new>

#include "common/gst_pointers.h"

namespace lf {
namespace {

// Returns the element that the object is or belongs to. Null if there is none. The caller owns the reference.
GstElement* element_of(gpointer object) {
  if (!object || !GST_IS_OBJECT(object)) return nullptr;
  ObjectPtr<GstObject> owner(GST_OBJECT(gst_object_ref(object)));
  while (owner && !GST_IS_ELEMENT(owner.get())) owner.reset(gst_object_get_parent(owner.get()));
  return GST_ELEMENT(owner.release());
}

// Posts the current exception as a message of this type, GST_MESSAGE_ERROR or GST_MESSAGE_WARNING.
void post(GstElement* element, GstMessageType type) {
  const auto post_text = [=](const char* text) {
    gst_element_message_full(element, type, GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_FAILED, g_strdup(text), nullptr,
                             __FILE__, GST_FUNCTION, __LINE__);
  };
  try {
    throw;
  } catch (const std::bad_alloc&) {
    post_text("Out of memory.");
  } catch (const std::exception& error) {
    post_text(error.what());
  } catch (...) {
    post_text("Unknown exception.");
  }
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
  g_autoptr(GstElement) element = element_of(object);
  if (element) post(element, GST_MESSAGE_ERROR);
}

void warn_of_current_exception(gpointer object) {
  g_autoptr(GstElement) element = element_of(object);
  if (element && is_time_to_warn(element)) post(element, GST_MESSAGE_WARNING);
}

}  // namespace lf
