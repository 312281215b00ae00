// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "compositor/lfcompositor_private.h"

// The pads that nodes answer on, as they are now.
struct AnswerPads {
  explicit AnswerPads(LfCompositor* self) {
    lf::ObjectLock lock(self);
    for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
      if (item->data != self->request) pads.push_back(GST_AGGREGATOR_PAD(gst_object_ref(item->data)));
    lock.unlock();
  }
  ~AnswerPads() {
    for (GstAggregatorPad* pad : pads) gst_object_unref(pad);
  }
  AnswerPads(const AnswerPads&) = delete;
  AnswerPads& operator=(const AnswerPads&) = delete;
  auto begin() const { return pads.begin(); }
  auto end() const { return pads.end(); }
  std::vector<GstAggregatorPad*> pads;
};

inline void drop_head(GstAggregatorPad* pad, NodeInput& node) {
  node.head = NodeInput::Head::kUnseen;
  node.seen = nullptr;
  gst_aggregator_pad_drop_buffer(pad);
}
