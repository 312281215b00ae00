// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

// The extra requests, made the view's own: with its numbers, of the moment of `request`.
static std::vector<lf::ViewRequest> extra_beside(LfViewRequest* self, const lf::ViewRequest& request) {
  lf::ObjectLock lock(self);
  std::vector<lf::ViewRequest> extra = std::exchange(*self->extra, {});
  std::erase_if(extra, [&](const lf::ViewRequest& e) {
    return e.rig_hash != 0 && request.rig_hash != 0 && e.rig_hash != request.rig_hash;
  });
  for (lf::ViewRequest& e : extra) {
    lf::CameraSet out;
    std::ranges::set_union(e.out_of_service, request.out_of_service, std::back_inserter(out));
    e.out_of_service = std::move(out);
    e.sequence = self->stream->number();
    e.view_id = request.view_id;
    e.target_time = request.target_time;
    e.absolute_time = request.absolute_time;
    e.quality = request.quality;
    e.rig_hash = request.rig_hash;
  }
  lock.unlock();
  return extra;
}

// For the cameras; null if they need none.
static GstBuffer* command_of(LfViewRequest* self, const lf::ViewRequest& request,
                             const std::shared_ptr<const lf::Rig>& rig) {
  try {
    std::vector<uint8_t> bytes = self->stream->command_for(request, rig);
    return bytes.empty() ? nullptr : lf::wrap_bytes(std::move(bytes));
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("View %u: no commands for the cameras: %s", request.view_id, error.what()), (nullptr));
    return nullptr;
  }
}

// One buffer after the other, because GstBaseSrc 1.22 has a buffer list mistaken for a buffer where a live source is
// stopped just after it was made.
void lf_view_request_send_more(LfViewRequest* self, const lf::ViewRequest& request,
                               const std::shared_ptr<const lf::Rig>& rig, GstBuffer* stamps) {
  const auto send = [&](GstBuffer* buffer) {
    if (!buffer) return;
    gst_buffer_copy_into(buffer, stamps, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    gst_queue_array_push_tail(self->to_send, buffer);
  };
  send(command_of(self, request, rig));
  if (!self->stream->access() && !lf_view_request_is_relay(self))
    if (std::optional<lf::ViewRequest> sweep = self->focus_feedback->next_sweep(request, rig.get())) {
      sweep->sequence = self->stream->number();
      self->focus_feedback->sweep_sent(sweep->sequence);
      send(lf::encode_request_buffer(*sweep));
    }
  for (const lf::ViewRequest& extra : extra_beside(self, request)) {
    send(lf::encode_request_buffer(extra));
    send(command_of(self, extra, rig));
  }
}
