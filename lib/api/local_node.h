// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <lightfield/renderer.h>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "node/answer_maker.h"
#include "node/card.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf::api {

// The cameras of one node whose frames come with each request. Not thread-safe.
class LocalNode {
 public:
  // `cameras`: indices in the order of frames. Throws Error for one that the rig does not have, one twice, and none.
  // `threads` 0: as many as there are processors.
  LocalNode(std::shared_ptr<const Rig> rig, uint64_t rig_hash, std::vector<CameraIndex> cameras, unsigned threads);

  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  // What the request comes to. Throws Error for a request of another rig, and for what does not fit this one.
  std::unique_ptr<const AnswerTask> plan(const ViewRequest& request);
  // The units of the answer. `frames`: one for each of cameras(). `in_process`: as AnswerTask::Options has it. `memory`
  // is recycled. Throws Error as plan() does, and for frames that do not fit.
  AnswerMaker::Units answer(const ViewRequest& request, const std::vector<lightfield::ImageView>& frames,
                            lightfield::Resampling resampling, bool in_process, ByteBuffer memory = {},
                            lightfield::DrawnBy drawn_by = lightfield::DrawnBy::kCpu);
  // See Card::explain(); of the latest answer.
  std::string drawn_by() const { return card_.explain(renderer_); }

 private:
  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const std::vector<CameraIndex> cameras_;
  std::vector<CameraIndex> own_;  // cameras_ in ascending order
  std::vector<size_t> frame_of_;  // for each of own_ its place in cameras_
  const unsigned threads_;
  const std::shared_ptr<WorkerPool> workers_ = WorkerPool::shared();
  const CameraColours colours_{*rig_};
  MeshCache mesh_;
  AnswerMaker maker_;
  ImageMemory scratch_;
  Card card_;
  RendererChoice renderer_ = RendererChoice::kCpu;
};

}  // namespace lf::api
