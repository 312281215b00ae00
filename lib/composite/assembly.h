// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "composite/accumulator.h"
#include "composite/answer_coverage.h"
#include "focus/view_depths.h"
#include "node/answer_encoder.h"
#include "render/ownership.h"
#include "view/view_request.h"
#include "wire/answer_codec.h"
#include "wire/consistency_codec.h"
#include "wire/fragment_codec.h"

namespace lf {

// Collects the answers of all nodes to one request, and combines the answers to one picture. It checks that answers fit
// the request and each other, adds their pixels, and finds out which cameras are missing. Call begin(), then add() for
// each answer or part, in any order, then finish(), and then read picture(). The object can be used again for the next
// request. Not thread-safe.
class Assembly {
 public:
  // Sets the rig of the answering cameras; it may be null if the rig is unknown. If the rig is known, this class knows
  // which contributions are absent, so it can count the missing weight and show the background outside the camera mesh.
  void set_rig(std::shared_ptr<const Rig> rig);
  // Starts a new request and discards the previous request. `lost` lists the cameras without frames, in ascending
  // order. Their weight counts as missing, but missing() does not report them again. Throws Error if the request lists
  // an out-of-service camera that the rig does not have.
  void begin(const ViewRequest& request, const CameraSet& lost = {});

  enum class Verdict {
    kAdded,
    kOtherRequest,  // the answer belongs to another view or sequence number
    kOtherRig,      // the answer is from another rig than the request, this compositor or the first answer
    kNeedsRig,      // the answer has unwarped pixels, but no rig is set
    // Some fragments do not fit and were skipped. They have another pixel family or view size than the first answer,
    // their cameras have already contributed or are not in the rig, or there are too many different sets of cameras.
    kBadFragment,
  };
  // Adds the fragments of an answer to the picture. Damaged fragments are skipped and counted. `bytes` may own the
  // memory of the answer. A sum of the whole view is then used without a copy, so its memory is kept until release() or
  // begin().
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes = nullptr);

  // Adds an answer with a single fragment that is in GPU memory, so that the pixels need not be downloaded. `answer` is
  // the header that precedes the fragment.
  Verdict add_on_gpu(const wire::AnswerPartHeader& answer, std::shared_ptr<gl::GpuSum> sum);

  // Completes the picture: renders unprocessed camera pixels, and counts the weight of cameras that did not answer as
  // missing. Call this once, after the last answer and before picture().
  //
  // `fallback` is the pixel family of the picture if no pixels have arrived. If `mark_uncovered` is true, pixels
  // outside the camera mesh show the background (see Accumulator::set_uncovered()). This takes extra time, because the
  // face of the mesh must be found for each pixel of the view. It has no effect on a black background.
  void finish(PixelFamily fallback, bool mark_uncovered);

  // Returns true if the view needs cameras and none of them has answered. Call this before finish(). After the call,
  // missing() is valid.
  bool is_empty();

  // Completes the sum of a compositor that is itself a node of a larger compositor. Call this instead of finish():
  // cameras that did not answer belong to other compositors of the tree, so their weight does not count as missing.
  void finish_partial();

  // Returns true if the answer has the hash of this rig, but names cameras that the rig does not have. The caller must
  // ignore such an answer.
  bool has_unknown_cameras(const wire::AnswerHeader& answer) const;

  PixelFamily family() const { return family_; }
  const Accumulator& picture() const { return accumulator_; }
  unsigned fragments() const { return fragments_; }
  unsigned damaged() const { return damaged_; }
  // Number of cameras with missing or damaged contributions. Valid after finish(), and 0 without a rig.
  unsigned missing() const { return missing_; }
  // True if the picture has the contributions of all its cameras, as far as known.
  bool complete() const { return missing_ == 0 && damaged_ == 0; }
  // Cameras of the received answers that had images.
  const CameraRanges& seeing() const { return seeing_; }
  // All cameras of the received answers, with or without images.
  const CameraRanges& cameras() const { return cameras_; }
  // Cameras of the received answers that had no images.
  CameraRanges blind() const;
  // skew() returns by how much the capture times of the answers differ from the requested time at most, in nanoseconds.
  // actual_time() returns the capture time of the answer that differs most, or kNoTime if unknown.
  uint64_t skew() const { return skew_; }
  uint64_t actual_time() const { return actual_time_; }
  uint64_t rig_hash() const { return expected_rig_; }  // 0 before the first answer
  // Frees the memory of the answers. Call this when the picture has been taken.
  void release();

 private:
  // The received parts of one answer. Several nodes may have the same number, but they never have the same cameras.
  struct Source {
    wire::AnswerParts parts;
    CameraRanges blind;
    bool spoilt = false;
    bool sums = false;
  };
  // `gpu_sum` is the payload of the only fragment, or null if the fragments carry their payloads.
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes, std::shared_ptr<gl::GpuSum> gpu_sum);
  CameraSet absent(const ViewPlan& plan) const;
  void add_missing(const ViewPlan& plan, const CameraSet& absent, const FaceIdMap& owners);
  void render_pixels(const ViewPlan& plan);
  bool add_fragment(const wire::FragmentView& fragment, std::optional<Coverage::Sums>& sums,
                    const std::shared_ptr<const void>& bytes, const std::shared_ptr<gl::GpuSum>& gpu_sum);
  bool add_pixels(const wire::FragmentView& fragment, const FragmentPlanes& planes);
  bool add_sums(const wire::FragmentView& fragment, const std::shared_ptr<const void>& bytes);

  std::shared_ptr<const Rig> rig_;
  uint64_t rig_hash_ = 0;  // 0 without a rig
  MeshCache mesh_;
  ViewRequest request_;
  CameraSet lost_;
  uint64_t expected_rig_ = 0;  // rig hash that all answers must have; 0: not known yet
  Accumulator accumulator_;
  std::shared_ptr<const void> borrowed_;  // owner of the memory borrowed by accumulator_
  wire::FragmentDecoder decoder_;
  PixelFamily family_ = PixelFamily::kNone;
  std::map<std::pair<uint32_t, CameraRanges>, Source> sources_;  // key: node number and cameras
  Coverage coverage_;
  CameraPixels pixels_;
  CameraRanges incomplete_;  // cameras with incomplete pixels
  UninitializedVector<int16_t> pixel_sum_;
  UninitializedVector<uint16_t> pixel_missing_;
  CameraRanges cameras_, seeing_;
  bool have_unnamed_sums_ = false;  // some sums do not list their cameras
  unsigned fragments_ = 0, missing_ = 0, damaged_ = 0;
  uint64_t skew_ = 0, actual_time_ = kNoTime;
};

// Encodes the sum of a compositor as if the compositor were a node, so that another compositor can use the sum. Trees
// of compositors serve arrays that are too large for a single compositor.
//
// With 16 bits per value, the final picture is bit-identical to the picture of a single compositor, unless a value
// saturated. If values have 8 bits, each level of the tree adds a rounding error of at most half a level. JPEG adds its
// own error. `header.family` must be the family of the accumulator, and `memory` is reused for the result. Throws Error
// if the header cannot be encoded.
ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const Coding& coding,
                          ByteBuffer memory);

// Adds the photo-consistency sums of one node to the totals of a request. Returns an empty text, or the reason if the
// message does not fit the request.
std::string add_consistency(std::span<const uint8_t> unit, const wire::ConsistencyHeader& header,
                            const ViewRequest& request, ViewDepths::Answers& answers);

}  // namespace lf
