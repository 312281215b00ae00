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

// Assembles the picture of one request from the answers of any number of nodes. Answers may come in any order and in
// parts. Their fragments are added up; unwarped pixels of cameras that cannot render are rendered here. Reusable. Not
// thread-safe.
class Assembly {
 public:
  // Sets the rig, which may be null. With a rig, absent fragments count as missing weight and pixels outside the mesh
  // show the background.
  void set_rig(std::shared_ptr<const Rig> rig);
  // Starts a new request. `lost` lists cameras without frames in ascending order: their weight counts as missing, but
  // missing() does not report them again. Throws Error if an out-of-service camera of the request is not in the rig.
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
  // Adds the fragments of an answer. Damaged fragments are skipped and counted. `bytes` may own the memory of the
  // payloads. The sums of a whole view are then used without a copy, until release() or begin().
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes = nullptr);

  // The same for an answer with a single fragment in GPU memory. `answer` is the header that precedes the fragment.
  Verdict add_on_gpu(const wire::AnswerPartHeader& answer, std::shared_ptr<gl::GpuSum> sum);

  // Completes the picture: counts the weight of absent cameras as missing. Call once, after the last answer and before
  // picture(). `fallback` is the pixel family if no pixels have arrived. `mark_uncovered` shows the background outside
  // the mesh (see Accumulator::set_uncovered()); it costs a face map of the whole view and has no effect on a black
  // background.
  void finish(PixelFamily fallback, bool mark_uncovered);

  // True if the view needs cameras and none of them has answered. Call before finish(); missing() is then valid. Such a
  // picture should be skipped, because it would show nothing and cost more than any other.
  bool is_empty();

  // Replaces finish() for a compositor inside a tree. Cameras that did not answer belong to other compositors of the
  // tree, so they do not count as missing.
  void finish_partial();

  // True if an answer for this rig names cameras that the rig does not have. Such an answer must be ignored; otherwise
  // these cameras would be missing from every later picture.
  bool has_unknown_cameras(const wire::AnswerHeader& answer) const;

  PixelFamily family() const { return family_; }
  const Accumulator& picture() const { return accumulator_; }
  unsigned fragments() const { return fragments_; }
  unsigned damaged() const { return damaged_; }
  // Number of cameras with missing or damaged contributions. Valid after finish(), and 0 without a rig.
  unsigned missing() const { return missing_; }
  // True if no part is known to be missing or damaged.
  bool complete() const { return missing_ == 0 && damaged_ == 0; }
  // Cameras of the received answers that had images.
  const CameraRanges& seeing() const { return seeing_; }
  // All cameras of the received answers, with or without images.
  const CameraRanges& cameras() const { return cameras_; }
  // Cameras of the received answers that had no images.
  CameraRanges blind() const;
  // skew() is the largest difference between capture time and target time of the answers, in nanoseconds; actual_time()
  // is the capture time of that answer (kNoTime: unknown).
  uint64_t skew() const { return skew_; }
  uint64_t actual_time() const { return actual_time_; }
  uint64_t rig_hash() const { return expected_rig_; }  // 0 before the first answer
  // Releases the input memory. Call when the picture has been taken.
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

// Encodes the sum of a compositor inside a tree as if it were the answer of one node. With 16 bits per value, the final
// picture is bit-identical to the picture of a single compositor, unless a value saturated. With 8 bits, each level of
// the tree adds a rounding error of at most half a level; JPEG adds its own error. `header.family` must be the family
// of the accumulator, and `memory` is reused. Throws Error if the header cannot be encoded.
ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const Coding& coding,
                          ByteBuffer memory);

// Adds the photo-consistency sums of one node to the answers of a request. Returns "", or the reason if the message
// does not fit.
std::string add_consistency(std::span<const uint8_t> unit, const wire::ConsistencyHeader& header,
                            const ViewRequest& request, ViewDepths::Answers& answers);

}  // namespace lf
