// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include <gst/gst.h>

namespace lf {

struct UnrefBuffer {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
};
using BufferPtr = std::unique_ptr<GstBuffer, UnrefBuffer>;

struct UnrefObject {
  void operator()(gpointer object) const { gst_object_unref(object); }
};
template <typename Object>
using ObjectPtr = std::unique_ptr<Object, UnrefObject>;
using ElementPtr = ObjectPtr<GstElement>;
using PadPtr = ObjectPtr<GstPad>;

// A weak reference to a GstObject. Thread-safe.
template <typename Object>
class WeakRef {
 public:
  WeakRef() = default;
  explicit WeakRef(Object* object)
      : ref_(new GWeakRef, [](GWeakRef* ref) {
          g_weak_ref_clear(ref);
          delete ref;
        }) {
    g_weak_ref_init(ref_.get(), object);
  }
  // Null if the object does not exist any more.
  ObjectPtr<Object> get() const {
    return ObjectPtr<Object>(ref_ ? static_cast<Object*>(g_weak_ref_get(ref_.get())) : nullptr);
  }

 private:
  std::shared_ptr<GWeakRef> ref_;
};

// Returns all elements of the iterator, and frees the iterator. Starts again if the bin changes meanwhile.
inline std::vector<ElementPtr> take_elements(GstIterator* iterator) {
  std::vector<ElementPtr> all;
  const auto take = [](const GValue* value, gpointer to) {
    static_cast<std::vector<ElementPtr>*>(to)->emplace_back(GST_ELEMENT(g_value_dup_object(value)));
  };
  while (gst_iterator_foreach(iterator, take, &all) == GST_ITERATOR_RESYNC) {
    all.clear();
    gst_iterator_resync(iterator);
  }
  gst_iterator_free(iterator);
  return all;
}

using SharedCaps = std::shared_ptr<GstCaps>;
inline SharedCaps share_caps(GstCaps* caps) {
  return caps ? SharedCaps(caps, [](GstCaps* owned) { gst_caps_unref(owned); }) : nullptr;
}

// Releases request pads in its destructor, in the order of add(). Holds references to the elements, so it may outlive
// their bin.
class RequestedPads {
 public:
  RequestedPads() = default;
  ~RequestedPads() {
    for (const auto& [element, pad] : pads_) {
      gst_element_release_request_pad(element, pad);
      gst_object_unref(pad);
      gst_object_unref(element);
    }
  }
  RequestedPads(const RequestedPads&) = delete;
  RequestedPads& operator=(const RequestedPads&) = delete;

  GstPad* add(GstElement* element, GstPad* pad) {
    pads_.emplace_back(GST_ELEMENT(gst_object_ref(element)), pad);
    return pad;
  }

 private:
  std::vector<std::pair<GstElement*, GstPad*>> pads_;
};

}  // namespace lf
