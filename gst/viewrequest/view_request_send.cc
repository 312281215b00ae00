// SPDX-License-Identifier: LGPL-2.1-or-later
#include <utility>

#include "base/error.h"
#include "common/gst_wire.h"
#include "viewrequest/lfviewrequest_private.h"

// For the cameras; null if they need none.
static GstBuffer* command_of(LfViewRequest* self, const lf::ViewRequest& request,
                             const std::shared_ptr<const lf::Rig>& rig) {
  try {
    std::vector<uint8_t> bytes = self->state->stream->command_for(request, rig);
    return bytes.empty() ? nullptr : lf::wrap_bytes(std::move(bytes));
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("View %u: no commands for the cameras: %s", request.view_id, error.what()), (nullptr));
    return nullptr;
  }
}

void lf_view_request_send_more(LfViewRequest* self, const lf::ViewRequest& request,
                               const std::shared_ptr<const lf::Rig>& rig, GstBuffer* stamps,
                               std::vector<lf::ViewRequest> beside) {
  auto& state = *self->state;
  const auto send = [&](GstBuffer* buffer) { state.outbox.put(buffer, stamps); };
  send(command_of(self, request, rig));
  for (lf::ViewRequest& other : beside) {
    other.sequence = state.stream->next_number++;
    send(lf::encode_request_buffer(other));
    send(command_of(self, other, rig));
  }
  if (!state.stream->access() && !state.relay.is_on())
    if (std::optional<lf::ViewRequest> sweep = state.focus.next_sweep(request, rig.get())) {
      sweep->sequence = state.stream->next_number++;
      state.focus.sweep_sent(sweep->sequence);
      send(lf::encode_request_buffer(*sweep));
    }
  for (const lf::ViewRequest& extra : state.extra.take_beside(request, state.stream->next_number)) {
    send(lf::encode_request_buffer(extra));
    send(command_of(self, extra, rig));
  }
}
