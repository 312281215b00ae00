// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include <gst/gst.h>

namespace lf {

struct UnrefPad {
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
};
using PadPtr = std::unique_ptr<GstPad, UnrefPad>;

// A request pad and the answer pad that it pairs with, for whoever comes through one of them, while both may be
// released.
class PadPair {
 public:
  PadPair(GstPad* request, GstPad* src) {
    g_weak_ref_init(&request_, request);
    g_weak_ref_init(&src_, src);
  }
  ~PadPair() {
    g_weak_ref_clear(&request_);
    g_weak_ref_clear(&src_);
  }
  PadPair(const PadPair&) = delete;
  PadPair& operator=(const PadPair&) = delete;
  // Null once it is gone.
  PadPtr request() { return PadPtr(static_cast<GstPad*>(g_weak_ref_get(&request_))); }
  PadPtr src() { return PadPtr(static_cast<GstPad*>(g_weak_ref_get(&src_))); }
  PadPtr other(GstPad* pad) { return GST_PAD_IS_SRC(pad) ? request() : src(); }

 private:
  GWeakRef request_, src_;
};

}  // namespace lf
