// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "image/image.h"
#include "node/answer_task.h"
#include "node/gain_matcher.h"
#include "node/image_memory.h"
#include "rig/camera_colours.h"

namespace lf {

// Makes a node's answers from its cameras' images: corrects their colours, matches their brightness, has them tried and
// sampled, and renders.
// It keeps what it learns of one requester's views. Not thread-safe.
class AnswerMaker {
 public:
  struct Options : AnswerTask::Options {
    Resampling resampling = Resampling::kBilinear;
    ParallelFor parallel = serial_for;
    const CameraColours* colours = nullptr;  // the colours of the task's rig; null: colours are taken as they come
  };
  // The units that an answer comes to.
  struct Units {
    ByteBuffer brightness;    // the unit that goes first; empty: there is none
    AnswerTask::Tried tried;  // the unit that goes before the answer
    RenderedAnswer answer;
    uint64_t before_ns = 0;              // nanoseconds of wall time that these two took
    const CameraGains* gains = nullptr;  // gains that the images were divided by, valid until the next call; null: none
  };
  // An answer that is to be made.
  struct Work {
    const AnswerTask* task;
    wire::AnswerHeader header;
    bool has_images = true;  // false: none of its cameras has one, and what they would show is nothing, not lost
  };
  // The answers of several tasks whose images are the same; of more than one none asks how bright cameras are. What one
  // comes to does not depend on the others. `images`: of all cameras of the tasks, ascending, as render_answer() takes
  // them. `scratch`: holds the corrected images. `memory`: to be recycled for one
  // answer. Throws Error as AnswerTask::begin() does.
  std::vector<Units> make(std::span<const Work> works, std::span<const Source> images, const Options& options,
                          ImageMemory& scratch, const std::function<ByteBuffer()>& memory);
  void clear() { gains_.clear(); }
  // New views begin with what the other maker has learned.
  void begin_like(const AnswerMaker& other) { gains_.begin_like(other.gains_); }

 private:
  void match_gains(std::span<const Work> works, const Options& options, std::vector<ByteBuffer>& memory,
                   std::vector<Source>& images, std::vector<Units>& units);

  GainMatcher gains_;
};

}  // namespace lf
