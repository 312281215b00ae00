// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/text.h"
#include "composite/assembly.h"
#include "lib/wire/wire_test.h"
#include "scene/scene.h"
#include "support/answers.h"
#include "support/fragments.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"

namespace lf {
namespace {

class AssemblyTest : public testing::Test {
 protected:
  AssemblyTest() : rig_(std::make_shared<const Rig>(scene_rig(3, 3, 48, 36))) {
    request_.sequence = 7;
    request_.target_time = 1000;
    request_.view.width = 30;
    request_.view.height = 20;
    request_.view.lens = Lens::from_fov_y(12, 30, 20);
    request_.view.pose.position = Vec3(0, 0, -0.1);
    request_.view.focus.plane = focal_plane_at(request_.view.pose, 2.5);
  }

  wire::Answer answer(const std::vector<CameraIndex>& cameras, uint8_t grey = 180) const {
    Image image(PixelFamily::kRgb, 48, 36);
    std::fill(image.data().begin(), image.data().end(), grey);
    return test::node_answer(*rig_, request_, cameras, image);
  }

  void begin_with_rig() {
    assembly_.set_rig(rig_);
    assembly_.begin(request_);
  }
  // Returns the sum of the answer's fragments, which has the size of the view.
  Accumulator sum_of(const wire::Answer& answer) const {
    Accumulator sum = test::empty_sum(PixelFamily::kRgb, request_.view.width, request_.view.height);
    for (const Fragment& fragment : answer.fragments) EXPECT_TRUE(sum.add(fragment));
    return sum;
  }
  static std::pair<int, int> range(const Image& image) {
    const auto [low, high] = std::minmax_element(image.data().begin(), image.data().end());
    return {*low, *high};
  }

  std::shared_ptr<const Rig> rig_;
  ViewRequest request_;
  Assembly assembly_;
  const std::vector<CameraIndex> all_ = {0, 1, 2, 3, 4, 5, 6, 7, 8};
};

TEST_F(AssemblyTest, AddsNodesInAnyOrder) {
  assembly_.begin(request_);
  EXPECT_EQ(add_answer(assembly_, answer({4, 5, 6, 7, 8})), Assembly::Verdict::kAdded);
  EXPECT_EQ(add_answer(assembly_, answer({0, 1, 2, 3})), Assembly::Verdict::kAdded);
  assembly_.finish(PixelFamily::kRgb, false);
  const auto [low, high] = range(assembly_.picture().resolve());
  EXPECT_GE(low, 178);
  EXPECT_LE(high, 182);
}

TEST_F(AssemblyTest, RefusesUnknownCameras) {
  begin_with_rig();
  wire::Answer forged = answer({0});
  forged.cameras.append({9, 9});
  EXPECT_TRUE(assembly_.has_unknown_cameras(forged));
  EXPECT_EQ(add_answer(assembly_, forged), Assembly::Verdict::kBadFragment);
  EXPECT_EQ(assembly_.fragments(), 0u);
  EXPECT_TRUE(assembly_.seeing().empty());
  EXPECT_EQ(add_answer(assembly_, answer(all_)), Assembly::Verdict::kAdded);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_TRUE(assembly_.complete());
}

TEST_F(AssemblyTest, EveryCameraCountsOnce) {
  assembly_.begin(request_);
  add_answer(assembly_, answer(all_));
  EXPECT_EQ(add_answer(assembly_, answer({4})), Assembly::Verdict::kBadFragment);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_LE(range(assembly_.picture().resolve()).second, 182);
}

TEST_F(AssemblyTest, RefusesOtherRequestsAndRigs) {
  assembly_.begin(request_);
  wire::Answer late = answer(all_), other_view = late, other_rig = late, other_size = late;
  late.sequence--;
  other_view.view_id++;
  other_size.view_width++;
  EXPECT_EQ(add_answer(assembly_, late), Assembly::Verdict::kOtherRequest);
  EXPECT_EQ(add_answer(assembly_, other_view), Assembly::Verdict::kOtherRequest);
  EXPECT_EQ(add_answer(assembly_, other_size), Assembly::Verdict::kBadFragment);
  EXPECT_EQ(add_answer(assembly_, answer({0})), Assembly::Verdict::kAdded);
  other_rig.rig_hash ^= 1;
  EXPECT_EQ(add_answer(assembly_, other_rig), Assembly::Verdict::kOtherRig);
  EXPECT_EQ(assembly_.fragments(), answer({0}).fragments.size());
}

TEST_F(AssemblyTest, WithTheRigMissingCamerasCountAsLost) {
  begin_with_rig();
  add_answer(assembly_, answer({0, 1, 2, 3, 5, 6, 7, 8}));
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 1u);  // camera 4, the centre
  const Image picture = assembly_.picture().resolve();
  // Cameras with half the weight or more restore the grey within the enlarged rounding error.
  EXPECT_NEAR(picture.pixel(1, 10)[0], 180, 5);
}

ByteBuffer pixels_of(const wire::AnswerHeader& header, const std::vector<std::pair<CameraIndex, Rect>>& regions) {
  const std::vector<uint8_t> grey(3 * 48 * 36, 180);
  std::vector<wire::AnswerFragment> fragments;
  for (const auto& [camera, rect] : regions)
    fragments.push_back({camera, packed_planes(PixelFamily::kRgb, rect, grey.data(), nullptr)});
  return wire::encode_fragments(header, fragments, 0);
}

TEST_F(AssemblyTest, PixelsNeedTheRig) {
  wire::Answer header = answer({});
  header.cameras = CameraRanges(all_);
  std::vector<std::pair<CameraIndex, Rect>> whole;
  for (const CameraIndex camera : all_) whole.push_back({camera, {0, 0, 48, 36}});
  const ByteBuffer bytes = pixels_of(header, whole);
  assembly_.begin(request_);
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kNeedsRig);
  EXPECT_EQ(assembly_.fragments(), 0u);

  begin_with_rig();
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kAdded);
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kBadFragment) << "once";
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 0u);
  EXPECT_EQ(range(assembly_.picture().resolve()), std::pair(180, 180));
}

TEST_F(AssemblyTest, IncompletePixelsOfACameraAreMissing) {
  wire::Answer header = answer({});
  header.cameras = CameraRanges(all_);
  std::vector<std::pair<CameraIndex, Rect>> regions;
  for (const CameraIndex camera : all_) {
    regions.push_back({camera, {0, 0, 48, 18}});
    if (camera != 4) regions.push_back({camera, {0, 18, 48, 36}});
  }
  begin_with_rig();
  const ByteBuffer bytes = pixels_of(header, regions);
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kAdded);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 1u);
  EXPECT_NEAR(assembly_.picture().resolve().pixel(1, 10)[0], 180, 2);
}

TEST_F(AssemblyTest, PixelsAndFragmentsOfOneCameraCountOnce) {
  wire::Answer header = answer({});
  begin_with_rig();
  add_answer(assembly_, answer({4}));
  const ByteBuffer bytes = pixels_of(header, {{4, {0, 0, 48, 36}}, {9, {0, 0, 48, 36}}, {3, {0, 0, 48, 36}}});
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kBadFragment);
  add_answer(assembly_, answer({0, 1, 2, 3, 5, 6, 7, 8}));
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_LE(range(assembly_.picture().resolve()).second, 182);
}

std::vector<wire::AnswerView> parts_of(const wire::AnswerHeader& header, const ConstSumPlanes& sums, int rows,
                                       std::vector<ByteBuffer>& memory) {
  const Rect& all = sums.rect;
  const auto total = static_cast<uint32_t>((all.height() + rows - 1) / rows);
  for (uint32_t i = 0; i < total; i++) {
    const int y0 = all.y0 + static_cast<int>(i) * rows;
    const Rect rect{all.x0, y0, all.x1, std::min(y0 + rows, all.y1)};
    wire::AnswerWriter writer(header, 1);
    const SumPlanes to = writer.add_sums({{}, header.family, rect, wire::Codec::kRaw16, 0, false});
    for (int c = 0; c < 3; c++)
      for (int y = 0; y < rect.height(); y++)
        std::copy_n(sums.plane[c] + (y0 - all.y0 + y) * sums.stride[c], rect.width(), to.plane[c] + y * to.stride[c]);
    writer.set_part(i, total);
    memory.push_back(writer.finish());
  }
  std::vector<wire::AnswerView> parts;
  for (const ByteBuffer& bytes : memory) parts.push_back(wire::parse_answer(bytes).value());
  return parts;
}

TEST_F(AssemblyTest, SumsComeInPartsInAnyOrderAndOnce) {
  wire::Answer raw = answer(all_);
  raw.cameras = CameraRanges(all_);
  const Accumulator sum = sum_of(raw);
  std::vector<ByteBuffer> memory;
  const std::vector<wire::AnswerView> parts = parts_of(raw, *sum.sums(), 5, memory);
  ASSERT_EQ(parts.size(), 4u);
  for (const bool backwards : {false, true}) {
    begin_with_rig();
    for (size_t i = 0; i < 4; i++) {
      EXPECT_EQ(assembly_.add(parts[backwards ? 3 - i : i]), Assembly::Verdict::kAdded);
      EXPECT_EQ(assembly_.add(parts[backwards ? 3 - i : i]), Assembly::Verdict::kBadFragment);
    }
    assembly_.finish(PixelFamily::kRgb, false);
    EXPECT_EQ(assembly_.missing(), 0u);
    EXPECT_EQ(assembly_.picture().resolve().data(), sum.resolve().data());
  }
}

// The sum of the second node fills the gap that the first node leaves.
TEST_F(AssemblyTest, LostStripOfASumIsMissing) {
  const CameraSet few = {4}, others = {0, 1, 2, 3, 5, 6, 7, 8};
  std::vector<ByteBuffer> memory[2];
  std::vector<wire::AnswerView> parts[2];
  for (int node = 0; node < 2; node++) {
    wire::Answer raw = answer(node ? few : others);
    raw.cameras = CameraRanges(node ? few : others);
    raw.node = node;
    parts[node] = parts_of(raw, *sum_of(raw).sums(), 4, memory[node]);
    ASSERT_GE(parts[node].size(), 4u);
  }
  assembly_.set_rig(rig_);
  for (const size_t lost : {0, 2, 99}) {
    SCOPED_TRACE(lost);
    assembly_.begin(request_);
    for (const wire::AnswerView& part : parts[0]) assembly_.add(part);
    for (size_t i = 0; i < parts[1].size(); i++)
      if (i != lost && lost != 99) assembly_.add(parts[1][i]);
    EXPECT_EQ(assembly_.cameras().size(), lost == 99 ? 8u : 9u);
    assembly_.finish(PixelFamily::kRgb, false);
    EXPECT_EQ(assembly_.missing(), 1u);
    const Image picture = assembly_.picture().resolve();
    for (int y = 0; y < picture.height(); y++) EXPECT_NEAR(picture.pixel(1, y)[0], 180, 5) << y;
  }
}

// In a sum, missing weight represents a blind camera; without a sum, nothing does.
TEST_F(AssemblyTest, BlindCamerasAreMissingUnlessASumHasThem) {
  wire::Answer raw = answer({0, 1, 2, 3, 5, 6, 7, 8});
  wire::Answer blind = raw;
  blind.fragments.clear();
  blind.node = 1;
  blind.cameras = blind.blind = CameraRanges(CameraSet{4});
  begin_with_rig();
  add_answer(assembly_, raw);
  add_answer(assembly_, blind);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 1u);
  EXPECT_FALSE(assembly_.seeing().contains(4));
  EXPECT_TRUE(assembly_.cameras().contains(4));
  raw.cameras = CameraRanges(all_);
  raw.blind = CameraRanges(CameraSet{4});
  std::vector<ByteBuffer> memory;
  assembly_.begin(request_);
  assembly_.add(parts_of(raw, *sum_of(raw).sums(), 100, memory)[0]);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 0u);
}

TEST_F(AssemblyTest, CamerasOutOfServiceAreNotMissing) {
  assembly_.set_rig(rig_);
  request_.out_of_service = {4};
  assembly_.begin(request_);
  add_answer(assembly_, answer({0, 1, 2, 3, 5, 6, 7, 8}));
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 0u);
  EXPECT_GE(range(assembly_.picture().resolve()).first, 178);
}

// For example lost corners of an array.
TEST_F(AssemblyTest, LostCamerasAreNormalisedAndNotMissing) {
  assembly_.set_rig(rig_);
  assembly_.begin(request_, {1});
  add_answer(assembly_, answer({0, 2, 4, 5, 6, 7, 8}));
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 1u) << "camera 3";
  EXPECT_GE(range(assembly_.picture().resolve()).first, 178);
}

TEST_F(AssemblyTest, UnknownCamerasOutOfServiceAreAnError) {
  assembly_.set_rig(rig_);
  request_.out_of_service = {9};
  EXPECT_THROW(assembly_.begin(request_), Error);
}

TEST_F(AssemblyTest, EmptyViewShowsTheBackground) {
  begin_with_rig();
  assembly_.finish(PixelFamily::kRgb, true);
  const Image picture = assembly_.picture().resolve({10, 20, 30});
  EXPECT_EQ(picture.pixel(15, 10)[0], 10);
  EXPECT_EQ(picture.pixel(0, 0)[2], 30);
}

TEST_F(AssemblyTest, NoAnswersAreAllMissing) {
  assembly_.begin(request_);
  EXPECT_FALSE(assembly_.is_empty()) << "unknown without a rig";
  begin_with_rig();
  EXPECT_TRUE(assembly_.is_empty());
  EXPECT_GT(assembly_.missing(), 0u);
  assembly_.begin(request_);
  add_answer(assembly_, answer({4}));
  EXPECT_FALSE(assembly_.is_empty());
  request_.view.pose.position.x = 100;
  assembly_.begin(request_);
  EXPECT_FALSE(assembly_.is_empty()) << "no camera visible from there";
}

TEST_F(AssemblyTest, SkewIsTheMaximum) {
  assembly_.begin(request_);
  wire::Answer early = answer({0}), late = answer({1});
  early.actual_time = 900;
  late.actual_time = 1250;
  add_answer(assembly_, early);
  add_answer(assembly_, late);
  EXPECT_EQ(assembly_.skew(), 250u);
}

TEST_F(AssemblyTest, BeginClearsTheState) {
  assembly_.begin(request_);
  add_answer(assembly_, answer(all_, 250));
  request_.sequence++;
  assembly_.begin(request_);
  add_answer(assembly_, answer(all_, 20));
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_LE(range(assembly_.picture().resolve()).second, 22);
  EXPECT_EQ(assembly_.fragments(), answer(all_).fragments.size());
}

TEST_F(AssemblyTest, JpegMakesNearlyTheSamePicture) {
  const wire::Answer raw = answer(all_);
  const ByteBuffer bytes = wire::encode_fragments(raw, raw.fragments, 90);
  begin_with_rig();
  EXPECT_EQ(assembly_.add(wire::parse_answer(bytes).value()), Assembly::Verdict::kAdded);
  EXPECT_EQ(assembly_.fragments(), raw.fragments.size());
  EXPECT_EQ(assembly_.damaged(), 0u);
  assembly_.finish(PixelFamily::kRgb, false);
  EXPECT_EQ(assembly_.missing(), 0u);
  const auto [low, high] = range(assembly_.picture().resolve());
  EXPECT_GE(low, 170);
  EXPECT_LE(high, 190);
}

TEST_F(AssemblyTest, DamagedFragmentsAreMissing) {
  wire::Answer raw = answer(all_);
  ASSERT_EQ(raw.fragments.size(), 1u);
  raw.fragments = test::halves_of(raw.fragments[0]);
  ByteBuffer bytes = wire::encode_fragments(raw, raw.fragments, 90);
  const wire::AnswerView view = wire::parse_answer(bytes).value();
  bytes[view.fragments[0].payload.data() - bytes.data() + 8] = 0xff;  // a marker: end of image
  bytes[view.fragments[0].payload.data() - bytes.data() + 9] = 0xd9;
  assembly_.set_rig(rig_);
  for (const bool again : {false, true}) {
    assembly_.begin(request_);
    EXPECT_EQ(assembly_.add(view), Assembly::Verdict::kAdded);
    EXPECT_EQ(assembly_.damaged(), 1u);
    EXPECT_EQ(assembly_.fragments(), raw.fragments.size() - 1);
    if (again) {
      wire::Answer other = raw;
      other.node = 1;
      other.fragments.resize(1);
      EXPECT_EQ(add_answer(assembly_, other), Assembly::Verdict::kAdded);
    }
    assembly_.finish(PixelFamily::kRgb, false);
    EXPECT_EQ(assembly_.missing() > 0, !again);
    EXPECT_EQ(range(assembly_.picture().resolve()).first > 170, again);
  }
  request_.sequence++;
  assembly_.begin(request_);
  EXPECT_EQ(assembly_.damaged(), 0u);
}

TEST_F(AssemblyTest, SumsOfTheWholeViewAreNotCopied) {
  const wire::Answer raw = answer(all_);
  const Accumulator sum = sum_of(raw);
  const ConstSumPlanes sums = *sum.sums();
  wire::AnswerWriter writer(raw, 1);
  const wire::FragmentHeader header{{}, raw.family, sums.rect, wire::Codec::kRaw16, 0, false};
  const SumPlanes to = writer.add_sums(header);
  for (int c = 0; c < 3; c++)
    for (int y = 0; y < sums.rect.height(); y++)
      std::copy_n(sums.plane[c] + y * sums.stride[c], sums.rect.width(), to.plane[c] + y * to.stride[c]);
  const auto bytes = std::make_shared<const ByteBuffer>(writer.finish());
  const wire::AnswerView view = wire::parse_answer(*bytes).value();
  for (const bool kept : {false, true}) {
    assembly_.begin(request_);
    EXPECT_EQ(kept ? assembly_.add(view, bytes) : assembly_.add(view), Assembly::Verdict::kAdded);
    assembly_.finish(PixelFamily::kRgb, false);
    EXPECT_EQ(assembly_.picture().resolve().data(), sum.resolve().data());
    EXPECT_EQ(bytes.use_count(), kept ? 2 : 1);
    EXPECT_EQ(
        reinterpret_cast<const uint8_t*>(assembly_.picture().sums()->plane[0]) == view.fragments[0].payload.data(),
        kept);
    assembly_.release();
    EXPECT_EQ(bytes.use_count(), 1);
  }
}

constexpr int kSize = 400;

Accumulator sum_of(std::span<const Fragment> fragments, PixelFamily family) {
  Accumulator sum = test::empty_sum(family, kSize, kSize);
  for (const Fragment& fragment : fragments) EXPECT_TRUE(sum.add(fragment));
  return sum;
}

void add_all(Accumulator& to, const ByteBuffer& answer) {
  const std::optional<wire::AnswerView> view = wire::parse_answer(answer);
  ASSERT_TRUE(view.has_value());
  wire::FragmentDecoder decoder;
  for (const wire::FragmentView& fragment : view->fragments) {
    if (fragment.codec == wire::Codec::kRaw16)
      EXPECT_TRUE(to.add(decoder.sums(fragment)));
    else
      EXPECT_TRUE(to.add(decoder.decode(fragment).value()));
  }
}

int max_difference(const Image& a, const Image& b) {
  int worst = 0;
  for (size_t i = 0; i < a.data().size(); i++) worst = std::max(worst, std::abs(a.data()[i] - b.data()[i]));
  return worst;
}

class PartialAnswer : public testing::TestWithParam<PixelFamily> {};

TEST_P(PartialAnswer, TreeMakesTheSamePicture) {
  const wire::AnswerHeader header = wire::header_of_view(GetParam(), kSize, kSize);
  std::vector<Fragment> all = wire::patterned_fragments(GetParam(), 30, 60, 44);
  for (Fragment& fragment : all) {  // weights of a half and less, as where cameras overlap
    for (uint8_t& value : fragment.pixels) value = static_cast<uint8_t>(value / 2);
    for (uint8_t& value : fragment.lost) value /= 4;
  }
  const Image expected = sum_of(all, GetParam()).resolve();
  const std::span<const Fragment> fragments = all;
  const struct {
    Coding coding;
    int bound;  // levels of 255; dividing by the remaining weight enlarges the error by a third at most
  } rows[] = {{{wire::Codec::kRaw16, 0}, 0}, {{wire::Codec::kRaw, 0}, 2}, {{wire::Codec::kJpeg, 100}, 12}};
  for (const auto& row : rows) {
    // JPEG in RGB does not preserve the colour of single pixels.
    if (row.coding.codec == wire::Codec::kJpeg && GetParam() == PixelFamily::kRgb) continue;
    SCOPED_TRACE(static_cast<int>(row.coding.codec));
    Accumulator root = test::empty_sum(GetParam(), kSize, kSize);
    add_all(root, partial_answer(header, sum_of(fragments.first(13), GetParam()), row.coding, {}));
    add_all(root, partial_answer(header, sum_of(fragments.subspan(13), GetParam()), row.coding, {}));
    EXPECT_LE(max_difference(root.resolve(), expected), row.bound);
  }
}

TEST_P(PartialAnswer, EmptySumHasNoFragments) {
  const wire::AnswerHeader header = wire::header_of_view(GetParam(), kSize, kSize);
  const ByteBuffer bytes = partial_answer(header, sum_of({}, GetParam()), {wire::Codec::kRaw16, 0}, {});
  EXPECT_TRUE(wire::parse_answer(bytes).value().fragments.empty());
}

INSTANTIATE_TEST_SUITE_P(Families, PartialAnswer, testing::Values(PixelFamily::kRgb, PixelFamily::kI420),
                         [](const auto& info) { return info.param == PixelFamily::kRgb ? "Rgb" : "I420"; });

class HypothesisAnswersTest : public testing::Test {
 protected:
  HypothesisAnswersTest() {
    FocalMap map = FocalMap::for_view(16, 8);
    map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 9);
    map.nearest = 1;
    request_.view.width = 16;
    request_.view.height = 8;
    request_.view.focus.map = std::make_shared<FocalMap>(map);
    request_.hypotheses = {{DepthHypothesis::Kind::kPlane, 1}, {DepthHypothesis::Kind::kPlane, 2}};
    request_.rig_hash = 5;
  }
  std::string add(const std::vector<PhotoConsistency>& hypotheses, std::optional<GainSum> gains = {},
                  uint64_t rig_hash = 5) {
    const wire::ConsistencyHeader header{0, 0, rig_hash, 0, gains};
    return add_consistency(wire::encode_consistency(header, hypotheses), header, request_, answers_);
  }
  static PhotoConsistency moments(int columns, int rows, uint16_t luma) {
    PhotoConsistency out;
    out.reset(columns, rows);
    for (uint16_t& weight : out.weight) weight = 100;
    for (uint16_t& value : out.luma) value = luma;
    return out;
  }
  ViewRequest request_;
  ViewDepths::Answers answers_;
};

TEST_F(HypothesisAnswersTest, SumsAddUp) {
  EXPECT_EQ(add({moments(4, 2, 10), moments(4, 2, 20)}), "");
  EXPECT_EQ(add({moments(4, 2, 1), moments(4, 2, 2)}), "");
  ASSERT_EQ(answers_.moments.size(), 2u);
  EXPECT_EQ(answers_.moments[0].luma[7], 11);
  EXPECT_EQ(answers_.moments[1].luma[0], 22);
  EXPECT_EQ(answers_.brightness.columns, 0);
}

// The surfaces that nodes have measured are not added: at each node of the map, the heaviest counts.
TEST_F(HypothesisAnswersTest, MeasuredSurfacesAreMerged) {
  request_.hypotheses[1].kind = DepthHypothesis::Kind::kMeasured;
  const auto measured = [](uint16_t weight, uint16_t luma) {
    PhotoConsistency sums = moments(4, 2, luma);
    sums.weight = {weight, weight, weight, weight, weight, weight, weight, 0};
    return sums;
  };
  EXPECT_EQ(add({moments(4, 2, 10), measured(50, 20)}), "");
  EXPECT_EQ(add({moments(4, 2, 1), measured(80, 7)}), "");
  EXPECT_EQ(add({moments(4, 2, 1), measured(60, 9)}), "");
  EXPECT_EQ(answers_.moments[0].luma[3], 12);
  EXPECT_EQ(answers_.moments[1].luma[3], 7);
  EXPECT_EQ(answers_.moments[1].weight[3], 80);
  EXPECT_EQ(answers_.moments[1].weight[7], 0);
}

TEST_F(HypothesisAnswersTest, RequestedBrightnessAddsUp) {
  const GainSum gains{.weight = 3, .log2 = -4};
  EXPECT_NE(add({moments(2, 1, 10)}, gains), "") << "not requested";
  request_.gains.ask = true;
  EXPECT_EQ(add({moments(2, 1, 10)}, gains), "");
  EXPECT_EQ(add({moments(2, 1, 5)}, gains), "");
  EXPECT_EQ(answers_.brightness.luma[1], 15);
  EXPECT_EQ(answers_.gains.weight, 6u);
  EXPECT_TRUE(answers_.moments.empty());
}

TEST_F(HypothesisAnswersTest, UnrequestedUnitsAreRejected) {
  EXPECT_NE(add({moments(4, 2, 10)}), "") << "too few";
  EXPECT_NE(add({moments(5, 2, 10), moments(5, 2, 10)}), "") << "another size";
  EXPECT_EQ(add({moments(4, 2, 10), moments(4, 2, 20)}, {}, 6), "of another rig");
  request_.view.focus.map = nullptr;
  EXPECT_NE(add({moments(4, 2, 10), moments(4, 2, 20)}), "");
  EXPECT_TRUE(answers_.moments.empty());
}

}  // namespace
}  // namespace lf
