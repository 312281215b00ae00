// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <optional>

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

  // Makes one answer, with what is kept of its view, and pushes it; nothing: there was none to push. Called by the
  // thread of the answer pad.
  using Answer = std::function<std::optional<GstFlowReturn>(Node::Requester&, const ParallelFor&)>;
  // Queues an answer. `work`: the work that is planned for it. *dropped becomes true if an older request of the view is
  // dropped for this one. `of_set`: see FairAnswers. Returns how the latest answer could be pushed.
  GstFlowReturn add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped, size_t of_set);
  // Makes the answer whose turn it is: what the thread of the answer pad does, again and again.
  void work(GstPad* src);

  // Starts the thread of the answer pad.
  void start();
  bool stop(GstPad* src);
  // Waits until all answers to earlier requests have been pushed.
  void drain() { fair_.drain(); }
  void begin_flush() { fair_.clear(); }
  void end_flush();

 private:
  FairAnswers fair_;
  ViewRequesters views_;
  std::atomic<GstFlowReturn> flow_ = GST_FLOW_OK;  // what came of pushing the latest answer
};

}  // namespace lf
