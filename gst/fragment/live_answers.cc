// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/live_answers.h"

#include "common/guard.h"

namespace lf {

GstFlowReturn LiveAnswers::add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped,
                               size_t of_set) {
  const auto make = [this, src, view_id, answer = std::move(answer)](const ParallelFor& parallel) {
    flow_ = guarded_buffer(src, [&] {
      const std::shared_ptr<Node::Requester> kept = views_.of(view_id);
      return answer(*kept, parallel).value_or(flow_);
    });
  };
  if (!fair_.add(view_id, views_.nanoseconds(view_id, work), make, dropped, of_set)) return GST_FLOW_FLUSHING;
  return flow_;
}

void LiveAnswers::work(GstPad* src) {
  if (!fair_.work()) gst_pad_pause_task(src);
}

void LiveAnswers::start() {
  flow_ = GST_FLOW_OK;
  fair_.start();
}

bool LiveAnswers::stop(GstPad* src) {
  fair_.stop();
  const bool stopped = gst_pad_stop_task(src);
  views_.clear();
  return stopped;
}

void LiveAnswers::end_flush() {
  views_.clear();
  flow_ = GST_FLOW_OK;
}

}  // namespace lf
