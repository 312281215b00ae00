// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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
  // `images`: of task.cameras(), as render_answer() takes them and with Source::resampling left alone. `scratch`: for
  // what is made of them. `memory` is recycled. Throws Error as AnswerTask::render() does.
  Units make(const AnswerTask& task, const wire::AnswerHeader& header, std::span<const Source> images,
             const Options& options, ImageMemory& scratch, ByteBuffer memory = {});
  void clear() { gains_.clear(); }
  // New views begin with what the other maker has learned.
  void begin_like(const AnswerMaker& other) { gains_.begin_like(other.gains_); }

 private:
  void match_gains(const AnswerTask& task, const wire::AnswerHeader& header, const Options& options,
                   std::vector<ByteBuffer>& memory, std::vector<Source>& images, Units& units);

  GainMatcher gains_;
};

}  // namespace lf
