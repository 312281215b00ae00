// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>

#include <gst/gst.h>

#include "node/fair_answers.h"
#include "node/view_requesters.h"

namespace lf {

// The answers to one requester's live requests, one view beside the other, by a thread of its answer pad.
class LiveAnswers {
 public:
  // `common`: whose are what all views have in common.
  LiveAnswers(ParallelFor parallel, const Node::Requester& common)
      : fair_(std::move(parallel), g_get_num_processors()), views_(common) {}

  // Pushes one answer, of what is kept of its view. Thread of the answer pad.
  using Answer = std::function<GstFlowReturn(Node::Requester&, const ParallelFor&)>;
  // `work`: that is planned for it. What the latest answer came to. True in *dropped if an older request of the view is
  // dropped for this one.
  GstFlowReturn add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped);
  // What that thread does, again and again.
  void work(GstPad* src);

  // Of the answer pad.
  void start();
  bool stop(GstPad* src);
  // Nothing that came before is on its way any more.
  void drain() { fair_.drain(); }
  void begin_flush() { fair_.clear(); }
  void end_flush();

 private:
  FairAnswers fair_;
  ViewRequesters views_;
  std::atomic<GstFlowReturn> flow_ = GST_FLOW_OK;  // that the latest answer came to
};

}  // namespace lf
