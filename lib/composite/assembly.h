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
#include "composite/arrivals.h"
#include "focus/view_focus.h"
#include "node/answer_encoder.h"
#include "render/ownership.h"
#include "view/view_request.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"
#include "wire/moments_codec.h"

namespace lf {

// Puts the picture of one request together from the answers of any number of nodes, whole or part by part, in any
// order: adds fragments up, and renders from plain pixels, for cameras that give nothing else. Reused from request to
// request. Not thread-safe.
class Assembly {
 public:
  // Sets the rig, or null: with it fragments that never came count as lost weight, and pixels outside the mesh show the
  // background.
  void set_rig(std::shared_ptr<const Rig> rig);
  // `lost`: cameras that are known to give nothing, ascending: what they should have given is lost, but not missing.
  // Throws Error if the request names cameras out of service that the rig does not have.
  void begin(const ViewRequest& request, const CameraSet& lost = {});

  enum class Verdict {
    kAdded,
    kOtherRequest,  // another view or sequence number
    kOtherRig,      // rendered from another rig than the request, this compositor's or the first answer's
    kNeedsRig,      // plain pixels, which only somebody who knows the rig can use
    kBadFragment,   // another pixel family or view size than the first answer's, or cameras that have been there
                    // already, or that the rig does not have, or too many sets of cameras; other fragments were added
  };
  // Damaged fragments are left out and counted; the others of the answer are added. `bytes`: what owns the payloads
  // and keeps them where they are; with it the sums of a whole view are used in their place, until release() or
  // begin().
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes = nullptr);

  // The same of an answer whose one fragment is on a card: `answer` is what comes before it.
  Verdict add_on_card(const wire::AnswerPartHeader& answer, std::shared_ptr<gl::CardSum> sum);

  // Call once after the last answer, before picture(): gives missing cameras' weight up for lost. `fallback`: the
  // family of the picture if no answer named one. `mark_uncovered`: see Accumulator::set_uncovered; costs an owner map
  // of the whole view and changes nothing if the background is black.
  void finish(PixelFamily fallback, bool mark_uncovered);

  // Call before finish(): whether there is something to be seen in the view and nothing of it has come. Then missing()
  // is known, and a picture, which would be more work than any other, need not be made: it would show nothing.
  bool all_is_missing();

  // finish() of a compositor inside a tree: cameras of which nothing came are not missing, but another compositor's.
  void finish_partial();

  // Whether an answer of this rig speaks for cameras that the rig does not have: who believed it would miss them in all
  // that comes.
  bool is_beyond_rig(const wire::AnswerHeader& answer) const;

  // The pixel family of the answers so far; kNone before the first that names one.
  PixelFamily family() const { return family_; }
  const Accumulator& picture() const { return accumulator_; }
  unsigned fragments() const { return fragments_; }
  // Fragments that came and could not be decoded.
  unsigned damaged() const { return damaged_; }
  // Cameras of which something should have come and did not, or damaged; known after finish() and with a rig alone,
  // else 0.
  unsigned missing() const { return missing_; }
  // Whether nothing is missing or damaged, as far as is known by then.
  bool complete() const { return missing_ == 0 && damaged_ == 0; }
  // Cameras that the answers so far speak for and that have pictures.
  const CameraRanges& seeing() const { return seeing_; }
  // All cameras that the answers so far speak for, with pictures or without.
  const CameraRanges& cameras() const { return cameras_; }
  // Cameras that the answers so far speak for and that have no pictures.
  CameraRanges blind() const;
  // The largest |capture time - target time| of the answers, nanoseconds, and that capture time (kNoTime: none told).
  uint64_t skew() const { return skew_; }
  uint64_t actual_time() const { return actual_time_; }
  uint64_t rig_hash() const { return expected_rig_; }  // hash of the answers' rig; 0 before the first answer
  // The picture has been taken: lets go of what it was made from.
  void release();

 private:
  // What has come of one answer; nodes may share a number, but not cameras.
  struct Source {
    wire::AnswerParts parts;
    CameraRanges blind;
    bool spoilt = false;  // some fragments could not be added
    bool sums = false;
  };
  // `card_sum`: payload of the only fragment; null: it has its own.
  Verdict add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes, std::shared_ptr<gl::CardSum> card_sum);
  CameraSet absent(const ViewPlan& plan) const;
  void add_missing(const ViewPlan& plan, const CameraSet& absent, const OwnerMap& owners);
  void render_pixels(const ViewPlan& plan);
  bool add_fragment(const wire::FragmentView& fragment, std::optional<Coverage::Sums>& sums,
                    const std::shared_ptr<const void>& bytes, const std::shared_ptr<gl::CardSum>& card_sum);
  bool add_pixels(const wire::FragmentView& fragment, const FragmentPlanes& planes);
  bool add_sums(const wire::FragmentView& fragment, const std::shared_ptr<const void>& bytes);

  std::shared_ptr<const Rig> rig_;
  uint64_t rig_hash_ = 0;  // hash of rig_; 0 without a rig
  MeshCache mesh_;
  ViewRequest request_;
  CameraSet lost_;
  uint64_t expected_rig_ = 0;  // hash that answers must carry, 0: not known yet
  Accumulator accumulator_;
  std::shared_ptr<const void> kept_;  // owns memory that accumulator_ refers to
  wire::FragmentDecoder decoder_;
  PixelFamily family_ = PixelFamily::kNone;
  std::map<std::pair<uint32_t, CameraRanges>, Source> sources_;  // by the node's number and its cameras
  Coverage coverage_;
  CameraPixels pixels_;
  CameraRanges incomplete_;                 // cameras whose pixels have come in part
  UninitializedVector<int16_t> pixel_sum_;  // rendered from pixels_
  UninitializedVector<uint16_t> pixel_lost_;
  CameraRanges cameras_, seeing_;
  bool have_unnamed_sums_ = false;  // sums that do not tell which cameras are in them
  unsigned fragments_ = 0, missing_ = 0, damaged_ = 0;
  uint64_t skew_ = 0, actual_time_ = kNoTime;
};

// What a compositor inside a tree sends on: the sum of what was added, as the answer of one node. With 16 bits a value
// the picture at the root is that of one compositor to the bit (unless a value saturated); with 8 it is rounded once
// more for each level of the tree, within half a level; JPEG adds its error. `header.family` is the accumulator's.
// `memory` is recycled. Throws Error if the header is not fit for the wire.
ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const Coding& coding,
                          ByteBuffer memory);

// Adds a unit of moments, which came from a node and belongs to the request, to what other nodes have answered. Returns
// why it could not be added; "": it was.
std::string add_moments(std::span<const uint8_t> unit, const wire::MomentsHeader& header, const ViewRequest& request,
                        ViewFocus::Answers& answers);

}  // namespace lf
