// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "render/camera_projection.h"
#include "render/gl/gpu_sum.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"
#include "wire/unit.h"

namespace lf {

void Assembly::set_rig(std::shared_ptr<const Rig> rig) {
  rig_ = std::move(rig);
  rig_hash_ = rig_ ? rig_->hash() : 0;
  mesh_.clear();
}

void Assembly::begin(const ViewRequest& request, const CameraSet& lost) {
  if (rig_) mesh_.get(*rig_, request.out_of_service);
  request_ = request;
  lost_ = lost;
  expected_rig_ = rig_hash_ != 0 ? rig_hash_ : request.rig_hash;
  family_ = PixelFamily::kNone;
  release();
  sources_.clear();
  coverage_.clear();
  incomplete_ = {};
  cameras_ = seeing_ = {};
  have_unnamed_sums_ = false;
  fragments_ = missing_ = damaged_ = 0;
  skew_ = 0;
  actual_time_ = kNoTime;
}

void Assembly::release() {
  accumulator_.reset(family_, request_.view.width, request_.view.height);
  borrowed_.reset();
  pixels_.clear();
}

bool Assembly::has_unknown_cameras(const wire::AnswerHeader& answer) const {
  return rig_ && answer.rig_hash == rig_hash_ && !answer.cameras.empty() &&
         answer.cameras.ranges().back().last >= rig_->cameras.size();
}

Assembly::Verdict Assembly::add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes) {
  return add(answer, std::move(bytes), nullptr);
}

Assembly::Verdict Assembly::add_on_gpu(const wire::AnswerPartHeader& answer, std::shared_ptr<gl::GpuSum> sum) {
  const wire::FragmentHeader of_all{{}, answer.family, sum->rect(), wire::Codec::kRaw16, 0, sum->has_missing()};
  return add(wire::AnswerView{answer, {{of_all, {}}}}, nullptr, std::move(sum));
}

Assembly::Verdict Assembly::add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes,
                                std::shared_ptr<gl::GpuSum> gpu_sum) {
  if (answer.view_id != request_.view_id || answer.sequence != request_.sequence) return Verdict::kOtherRequest;
  if (expected_rig_ == 0) expected_rig_ = answer.rig_hash;
  if (answer.rig_hash != expected_rig_) return Verdict::kOtherRig;
  if (has_unknown_cameras(answer)) return Verdict::kBadFragment;
  if (answer.view_width != request_.view.width || answer.view_height != request_.view.height)
    return Verdict::kBadFragment;
  if (family_ == PixelFamily::kNone && answer.family != PixelFamily::kNone) {
    family_ = answer.family;
    accumulator_.reset(family_, request_.view.width, request_.view.height);
  }
  const auto is_of_camera = [](const wire::FragmentView& fragment) { return fragment.camera.has_value(); };
  if (!rig_ && std::ranges::any_of(answer.fragments, is_of_camera)) return Verdict::kNeedsRig;
  const std::pair key(answer.node, answer.cameras);
  if (sources_.size() >= wire::kMaxSources && !sources_.contains(key)) return Verdict::kBadFragment;
  cameras_.add(answer.cameras);
  CameraRanges seeing = answer.cameras;
  seeing.remove(answer.blind);
  seeing_.add(seeing);
  const unsigned damaged_before = damaged_;
  bool all_good = true;
  const bool any_sums = !std::ranges::all_of(answer.fragments, is_of_camera);
  std::optional<Coverage::Sums> sums;
  if (any_sums && !answer.cameras.empty()) sums.emplace(coverage_, answer.cameras);
  for (const wire::FragmentView& fragment : answer.fragments)
    all_good = add_fragment(fragment, sums, bytes, gpu_sum) && all_good;
  Source& source = sources_[key];
  source.parts.add(answer.part);
  source.blind = answer.blind;
  source.spoilt |= damaged_ > damaged_before || !all_good;
  source.sums |= any_sums;
  if (answer.actual_time != kNoTime && answer.target_time != kNoTime) {
    const uint64_t skew = time_between(answer.actual_time, answer.target_time);
    if (actual_time_ == kNoTime || skew > skew_) actual_time_ = answer.actual_time;
    skew_ = std::max(skew_, skew);
  }
  return all_good ? Verdict::kAdded : Verdict::kBadFragment;
}

// Adds a fragment. `sums` are the cameras of a sum, or null if the sum does not list its cameras. Returns false if the
// fragment does not fit; damaged fragments return true.
bool Assembly::add_fragment(const wire::FragmentView& fragment, std::optional<Coverage::Sums>& sums,
                            const std::shared_ptr<const void>& bytes, const std::shared_ptr<gl::GpuSum>& gpu_sum) {
  std::optional<FragmentPlanes> planes;
  if (fragment.codec != wire::Codec::kRaw16) {
    planes = decoder_.decode(fragment);
    if (!planes) {
      damaged_++;
      return true;
    }
  }
  if (fragment.camera) {
    if (!add_pixels(fragment, *planes)) return false;
  } else {
    if (!accumulator_.fits(fragment.family, fragment.rect) || (sums && !sums->add(fragment.rect))) return false;
    have_unnamed_sums_ |= !sums;
    gpu_sum ? accumulator_.add_borrowed(gpu_sum) : planes ? accumulator_.add(*planes) : add_sums(fragment, bytes);
  }
  fragments_++;
  return true;
}

// All fragments have the family of the answer, so add_pixels() need not check the family.
bool Assembly::add_pixels(const wire::FragmentView& fragment, const FragmentPlanes& planes) {
  const CameraIndex camera = *fragment.camera;
  if (camera >= rig_->cameras.size() || coverage_.has(camera)) return false;
  return pixels_.add(camera, rig_->cameras[camera], planes);
}

bool Assembly::add_sums(const wire::FragmentView& fragment, const std::shared_ptr<const void>& bytes) {
  bool copied;
  const ConstSumPlanes sums = decoder_.sums(fragment, &copied);
  if (!bytes || copied) return accumulator_.add(sums);
  const bool added = accumulator_.add_borrowed(sums);
  if (added && !borrowed_) borrowed_ = bytes;
  return added;
}

// Returns the contributing cameras that may be incomplete.
CameraSet Assembly::absent(const ViewPlan& plan) const {
  if (have_unnamed_sums_) return {};
  CameraRanges there;
  for (const auto& [key, source] : sources_) {
    if (!source.parts.complete() || source.spoilt) continue;
    CameraRanges giving = key.second;
    if (!source.sums) giving.remove(source.blind);
    there.add(giving);
  }
  CameraSet absent;
  for (const CameraIndex camera : plan.contributors())
    if (!there.contains(camera) || incomplete_.contains(camera)) absent.push_back(camera);
  return absent;
}

void Assembly::finish(PixelFamily fallback, bool mark_uncovered) {
  if (family_ == PixelFamily::kNone) {
    family_ = fallback;
    accumulator_.reset(family_, request_.view.width, request_.view.height);
  }
  if (!rig_) return;
  const View& view = request_.view;
  const ViewPlan plan(*rig_, mesh_.get(*rig_, request_.out_of_service), view);
  render_pixels(plan);
  const CameraSet absent = this->absent(plan);
  if (absent.empty() && !mark_uncovered) return;

  const FaceIdMap owners(plan, {0, 0, view.width, view.height});
  add_missing(plan, absent, owners);
  if (mark_uncovered) accumulator_.set_uncovered(owners);
}

CameraRanges Assembly::blind() const {
  CameraRanges blind = cameras_;
  blind.remove(seeing_);
  return blind;
}

bool Assembly::is_empty() {
  if (!rig_ || fragments_ > 0) return false;
  const ViewPlan plan(*rig_, mesh_.get(*rig_, request_.out_of_service), request_.view);
  const size_t wanted = plan.contributors().size();
  if (wanted == 0 || absent(plan).size() < wanted) return false;
  missing_ = static_cast<unsigned>(wanted);
  return true;
}

void Assembly::finish_partial() {
  if (!rig_ || family_ == PixelFamily::kNone) return;
  const ViewPlan plan(*rig_, mesh_.get(*rig_, request_.out_of_service), request_.view);
  render_pixels(plan);
  CameraSet absent = this->absent(plan);
  std::erase_if(absent, [this](CameraIndex camera) { return !cameras_.contains(camera); });
  if (!absent.empty()) add_missing(plan, absent, FaceIdMap(plan, {0, 0, request_.view.width, request_.view.height}));
}

// Renders the received pixels in the same way as nodes do.
void Assembly::render_pixels(const ViewPlan& plan) {
  std::vector<lf::Source> sources;
  CameraSet incomplete;
  Rect rect;
  for (const CameraIndex camera : pixels_.cameras()) {
    const Rect part = plan.camera_rect(camera);
    if (part.empty()) continue;
    const Camera& rig_camera = rig_->cameras[camera];
    if (!pixels_.has(camera, needed_pixels(plan, camera, rig_camera))) {
      incomplete.push_back(camera);
    } else if (coverage_.add(camera, part)) {
      sources.push_back({camera, &rig_camera, pixels_.image(camera)});
      rect = unite(rect, chroma_aligned(part, plan.view()));
    }
  }
  incomplete_ = CameraRanges(incomplete);
  if (sources.empty()) return;
  const FaceRuns runs(plan, rect);
  const SumRenderer renderer(plan, runs, sources, family_);
  const size_t area = wire::area(rect);
  pixel_sum_.resize(3 * area);
  pixel_missing_.resize(area);
  const bool any_missing =
      renderer.render_rows(rect.y0, rect.y1, packed_sums(family_, rect, pixel_sum_.data(), pixel_missing_.data()));
  accumulator_.add_borrowed(packed_sums<const int16_t, const uint16_t>(family_, rect, pixel_sum_.data(),
                                                                       any_missing ? pixel_missing_.data() : nullptr));
}

void Assembly::add_missing(const ViewPlan& plan, const CameraSet& absent, const FaceIdMap& owners) {
  for (const CameraIndex camera : absent) {
    const Rect rect = plan.camera_rect(camera);
    std::vector<float> weights = pixel_weights(plan, owners, camera, rect);
    coverage_.subtract(camera, rect, weights);
    if (std::ranges::all_of(weights, [](float w) { return w == 0; })) continue;
    if (!std::ranges::binary_search(lost_, camera)) missing_++;
    accumulator_.add_missing_weights(rect, weights);
  }
}

namespace {

void copy(const ConstSumPlanes& from, const SumPlanes& to) {
  for (int c = 0; c < 3; c++)
    for (int y = 0; y < plane_height(from.family, from.rect, c); y++)
      std::copy_n(from.plane[c] + y * from.stride[c], plane_width(from.family, from.rect, c),
                  to.plane[c] + y * to.stride[c]);
  if (!from.lost) return;
  for (int y = 0; y < from.rect.height(); y++)
    std::copy_n(from.lost + y * from.missing_stride, from.rect.width(), to.lost + y * to.missing_stride);
}

}  // namespace

ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const Coding& coding,
                          ByteBuffer memory) {
  const std::optional<ConstSumPlanes> sums = sum.sums();
  if (!sums || sums->rect.empty()) return wire::AnswerWriter(header, 0, std::move(memory)).finish();
  if (coding.codec == wire::Codec::kRaw16) {
    wire::AnswerWriter writer(header, 1, std::move(memory));
    copy(*sums, writer.add_sums({{}, sums->family, sums->rect, wire::Codec::kRaw16, 0, sums->lost != nullptr}));
    return writer.finish();
  }
  const std::vector<Rect> rects = wire::cut_rows(sums->rect, wire::strip_rows(sums->rect.width()));
  std::vector<Fragment> strips;
  for (const Rect& rect : rects) strips.push_back(rounded_fragment(part_of(*sums, rect)));
  std::vector<wire::AnswerFragment> fragments;
  for (const Fragment& strip : strips) fragments.push_back({{}, planes_of(strip)});
  return wire::encode_fragments(header, fragments, coding.quality, std::move(memory));
}

std::string add_consistency(std::span<const uint8_t> unit, const wire::ConsistencyHeader& header,
                            const ViewRequest& request, ViewDepths::Answers& answers) {
  if (request.rig_hash != 0 && header.rig_hash != request.rig_hash) return "of another rig";
  wire::ConsistencyShape asked;
  if (const FocalMap* map = request.view.focus.map.get()) {
    if (!header.gains)
      asked = {map->columns, map->rows, request.hypotheses.size()};
    else if (request.gains.ask)
      asked = {FocalMap::nodes(map->columns, 2), FocalMap::nodes(map->rows, 2), 1};
  }
  std::string reason;
  std::optional<wire::ConsistencyUnit> came = wire::decode_consistency(unit, asked, &reason);
  if (!came) return reason;
  if (came->gains) {
    answers.gains.add(*came->gains);
    if (answers.brightness.columns == 0)
      answers.brightness = std::move(came->sums()[0]);
    else
      came->add_to({&answers.brightness, 1});
  } else if (answers.moments.empty()) {
    answers.moments = came->sums();
  } else {
    for (size_t t = 0; t < came->hypotheses.size(); t++) {
      PhotoConsistency& sum = answers.moments[t];
      if (request.hypotheses[t].kind == DepthHypothesis::Kind::kMeasured)
        sum.take_heavier(came->hypotheses[t], came->rect.x0, came->rect.y0);
      else
        sum.add(came->hypotheses[t], came->rect.x0, came->rect.y0);
    }
  }
  return {};
}

}  // namespace lf
