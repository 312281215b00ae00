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

// Assembles the picture of one request from the answers of any number of nodes, in any order and in parts. Adds up
// fragments, and renders unwarped pixels of cameras that can only deliver pixels. Reusable. Not thread-safe.
class Assembly {
 public:
  // Sets the rig; may be null. The rig makes absent fragments count as missing weight, and shows the background outside
  // the mesh.
  void set_rig(std::shared_ptr<const Rig> rig);
  // Starts a new request. `lost`: cameras without frames, ascending; their weight counts as missing, but missing()
  // leaves out these cameras. Throws Error if the request has out-of-service cameras that are not in the rig.
  void begin(const ViewRequest& request, const CameraSet& lost = {});

  enum class Verdict {
    kAdded,
    kOtherRequest,  // another view or sequence number
    kOtherRig,      // another rig than the request, this compositor or the first answer
    kNeedsRig,      // unwarped pixels, but no rig is set
    // Another pixel family or view size than the first answer, cameras that have already contributed or are not in the
    // rig, or too many camera sets; the valid fragments were added.
    kBadFragment,
  };
  // Adds the fragments of an answer. Damaged fragments are skipped and counted. `bytes`: owner of the payloads; if
  // given, the sums of a whole view are used without a copy until release() or begin().
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes = nullptr);

  // As above, for an answer with a single fragment in GPU memory. `answer`: the header that precedes the fragment.
  Verdict add_on_gpu(const wire::AnswerPartHeader& answer, std::shared_ptr<gl::GpuSum> sum);

  // Call once after the last answer, before picture(): counts the weight of absent cameras as missing. `fallback`:
  // pixel family for a request without pixels. `mark_uncovered`: see Accumulator::set_uncovered; costs a face-id map of
  // the whole view and has no effect on a black background.
  void finish(PixelFamily fallback, bool mark_uncovered);

  // Call before finish(). True if the view has visible cameras and none of them answered. missing() is then valid. Skip
  // the picture in this case: it would show nothing and cost more than any other.
  bool is_empty();

  // Replaces finish() in a compositor inside a tree: cameras without any answer belong to another compositor and do not
  // count as missing.
  void finish_partial();

  // True if an answer for this rig claims cameras that are not in the rig. Believing it would make these cameras
  // missing from every later picture.
  bool has_unknown_cameras(const wire::AnswerHeader& answer) const;

  PixelFamily family() const { return family_; }
  const Accumulator& picture() const { return accumulator_; }
  unsigned fragments() const { return fragments_; }
  unsigned damaged() const { return damaged_; }
  // Number of cameras with missing or damaged contributions. Valid after finish(); 0 without a rig.
  unsigned missing() const { return missing_; }
  // True if no part is missing or damaged, as far as the compositor knows.
  bool complete() const { return missing_ == 0 && damaged_ == 0; }
  // Cameras of the received answers that have images.
  const CameraRanges& seeing() const { return seeing_; }
  // All cameras of the received answers, with or without images.
  const CameraRanges& cameras() const { return cameras_; }
  // Cameras of the received answers that have no images.
  CameraRanges blind() const;
  // The largest |capture time - target time| of the answers in nanoseconds, and its capture time (kNoTime: unknown).
  uint64_t skew() const { return skew_; }
  uint64_t actual_time() const { return actual_time_; }
  uint64_t rig_hash() const { return expected_rig_; }  // 0 before the first answer
  // Releases the input memory; call when the picture has been taken.
  void release();

 private:
  // The received parts of one answer. Nodes may share a number, but not cameras.
  struct Source {
    wire::AnswerParts parts;
    CameraRanges blind;
    bool spoilt = false;  // true if some fragments could not be added
    bool sums = false;
  };
  // `gpu_sum`: payload of the only fragment; null: the fragments carry their payloads.
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
  uint64_t expected_rig_ = 0;  // rig hash that answers must have; 0: not known yet
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
  bool have_unnamed_sums_ = false;  // true if some sums do not list their cameras
  unsigned fragments_ = 0, missing_ = 0, damaged_ = 0;
  uint64_t skew_ = 0, actual_time_ = kNoTime;
};

// Encodes the output of a compositor inside a tree: the sum, as the answer of one node. Sums with 16 bits per value
// give a final picture that is bit-identical to the result of a single compositor (unless a value saturated). If 8 bits
// are used, each tree level adds a rounding error of at most half a level; JPEG adds its error. `header.family` must
// equal the accumulator's. `memory` is recycled. Throws Error if the header cannot be encoded.
ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const Coding& coding,
                          ByteBuffer memory);

// Adds the photo-consistency unit of one node to the answers of the request. Returns the reason if the unit does not
// fit; "" on success.
std::string add_consistency(std::span<const uint8_t> unit, const wire::ConsistencyHeader& header,
                            const ViewRequest& request, ViewDepths::Answers& answers);

}  // namespace lf
