// SPDX-License-Identifier: LGPL-2.1-or-later
#include <deque>
#include <list>

#include "composite/assembly.h"
#include "composite/still.h"
#include "focus/exposure_compensation.h"
#include "image/image.h"
#include "image/image_filters.h"
#include "lib/focus/array_of_walls.h"
#include "node/request_renderer.h"
#include "quality/image_quality.h"
#include "support/test.h"
#include "wire/consistency_codec.h"

namespace lf {
namespace {

constexpr size_t kNodes = 100;

WideLuma::Camera seen(CameraIndex camera, uint8_t luma) {
  return {camera, std::vector<uint8_t>(kNodes, luma), std::vector<float>(kNodes, WideLuma::kPeak)};
}

GainRequest mean_of(uint32_t sequence, uint8_t luma) {
  return {.use = true, .mean = std::vector<uint8_t>(kNodes, luma), .mean_of = sequence};
}

TEST(GainMatcher, ComparesWithTheMeanOfTheSameRequest) {
  GainMatcher matcher;
  matcher.keep(7, {seen(3, 110)});
  EXPECT_EQ(matcher.gains_for(mean_of(6, 100)).of(3), 1) << "mean of another request";
  const float first = matcher.gains_for(mean_of(7, 100)).likely(3);
  EXPECT_GT(first, 1.05);
  EXPECT_EQ(matcher.gains_for(mean_of(7, 100)).likely(3), first) << "once";
  EXPECT_EQ(matcher.gains_for({}).of(3), 1) << "too few means";
  for (const uint32_t sequence : {8, 9}) {
    matcher.keep(sequence, {seen(3, 100)});
    matcher.gains_for(mean_of(sequence, 100));
  }
  const float gain = matcher.gains_for({}).of(3);
  EXPECT_EQ(gain, first);
  GainMatcher other;
  other.copy_gains_from(matcher);
  EXPECT_EQ(other.gains_for({}).of(3), gain);
}

// A camera is 20 % too bright, and results take `underway` requests to arrive.
TEST(GainMatcher, FindsTheGainWithRequestsInFlight) {
  for (const size_t underway : {1, 2, 3, 5, 8, 16}) {
    GainMatcher matcher;
    ExposureSchedule turns;
    // true if the request includes the mean, and the gains of the request
    std::deque<std::pair<bool, GainRequest>> requests(underway);
    float largest = 0;
    for (uint32_t i = 0; i < 16 * (underway + 3); i++) {
      const auto [asks, brings] = requests.front();
      requests.pop_front();
      const float gain = matcher.gains_for(brings).likely(3);
      largest = std::max(largest, gain);
      if (asks) matcher.keep(i, {seen(3, static_cast<uint8_t>(std::lround(120 / gain)))});
      requests.emplace_back(turns.next(true, asks), asks ? mean_of(i, 100) : GainRequest());
    }
    EXPECT_NEAR(matcher.gains_for({}).of(3), 1.2, 0.01) << underway;
    EXPECT_LT(largest, 1.21) << underway;
  }
}

TEST(GainMatcher, DividesImages) {
  Image grey(PixelFamily::kRgb, 8, 8);
  std::ranges::fill(grey.data(), 110);
  const Camera camera{.width = 8, .height = 8};
  const std::vector<Source> sources{{0, &camera, grey.view()}, {1, &camera, grey.view()}, {2, &camera, {}}};
  ExposureCompensation gains;
  for (unsigned i = 0; i < ExposureCompensation::kMeans; i++)
    gains.take({{0, {std::log(1.5f / gains.likely(0)), 0}}, {2, {std::log(1.5f / gains.likely(2)), 0}}});
  ASSERT_NEAR(gains.of(0), 1.5, 0.001);
  std::vector<ByteBuffer> memory;
  const std::vector<Source> out = GainMatcher::match(
      sources, gains,
      [](CameraIndex) {
        return Rect{0, 0, 8, 8};
      },
      memory);
  EXPECT_NEAR(out[0].image.plane[0][100], 110 / gains.of(0), 1);
  EXPECT_EQ(out[1].image.plane[0], grey.view().plane[0]) << "no copy";
  EXPECT_EQ(out[2].image.family, PixelFamily::kNone);
}

class RequestRendererTest : public testing::Test {
 protected:
  RequestRendererTest() {
    request_.view = walls_.view(60);
    request_.rig_hash = header_.rig_hash = walls_.rig.hash();
    header_.view_width = request_.view.width;
    header_.view_height = request_.view.height;
    header_.family = PixelFamily::kRgb;
    options_.codec = CodecChoice::kRaw16;
  }
  RequestPlan plan() const { return {walls_.rig, walls_.mesh, request_, walls_.own}; }
  RenderedAnswer render(const std::vector<Source>& all) {
    const RequestPlan plan = this->plan();
    std::vector<Source> sources;
    for (const CameraIndex camera : plan.cameras()) sources.push_back(all[camera]);
    return renderer_.render({&plan, header_}, sources, options_, scratch_);
  }
  test::ArrayOfWalls walls_;
  ViewRequest request_;
  wire::AnswerHeader header_;
  RenderOptions options_;
  RequestRenderer renderer_;
  ImageMemory scratch_;
};

TEST_F(RequestRendererTest, SharpensIfRequested) {
  const ByteBuffer plain = render(walls_.sources()).bytes;
  options_.resampling = Resampling::kSharpened;
  const ByteBuffer sharp = render(walls_.sources()).bytes;
  EXPECT_NE(sharp, plain);
  options_.resampling = Resampling::kBilinear;
  std::vector<Image> sharpened_images;
  for (const Image& image : walls_.images) sharpened_images.push_back(sharpened(image));
  std::vector<Source> sources = walls_.sources();
  for (size_t i = 0; i < sources.size(); i++) sources[i].image = sharpened_images[i].view();
  EXPECT_EQ(render(sources).bytes, sharp);
}

// With depth maps of the cameras, a node's answer is the picture of render_still(). It is sharper at the silhouette
// than with the nodes of the focal map alone.
TEST_F(RequestRendererTest, DepthsOfTheCamerasSharpenSilhouettes) {
  const ArrayDepth depths(
      walls_.rig, walls_.own, [this](CameraIndex i) { return walls_.images[i].view(); }, 0, 1.2);
  request_.view.focus.map = std::make_shared<const FocalMap>(depths.surface(request_.view));
  const RequestPlan plan = this->plan();
  const auto picture = [&](const std::optional<ArrayDepth>& used) {
    const RenderedAnswer answer =
        renderer_.render({.plan = &plan, .header = header_, .depths = used}, walls_.sources(), options_, scratch_);
    Assembly assembly;
    assembly.begin(request_);
    const auto parsed = wire::parse_answer(answer.bytes);
    EXPECT_EQ(assembly.add(*parsed), Assembly::Verdict::kAdded);
    assembly.finish(PixelFamily::kRgb, false);
    return assembly.picture().resolve();
  };
  const CameraImages images = [this](CameraIndex i) -> const Image& { return walls_.images[i]; };
  const Still still =
      render_still(walls_.rig, walls_.mesh, request_.view, images, Resampling::kBilinear, {}, nullptr, &depths);
  const Image sharp = picture(depths), coarse = picture({});
  EXPECT_LE(compare(sharp, still.picture).max_error, 1);
  Image truth(PixelFamily::kRgb, request_.view.width, request_.view.height);
  for (int y = 0; y < truth.height(); y++)
    for (int x = 0; x < truth.width(); x++) {
      const Vec3 d(*request_.view.lens.unproject({x, y}), 1), eye = request_.view.pose.position;
      const Vec3 near = eye + 1.5 * d;
      const auto luma = test::ArrayOfWalls::luma_at(near.x > 0 ? near : eye + 3. * d);
      std::fill_n(&truth.data()[3 * (static_cast<size_t>(y) * truth.width() + x)], 3,
                  static_cast<uint8_t>(std::lround(luma)));
    }
  const double with = compare(sharp, truth).psnr_db, without = compare(coarse, truth).psnr_db;
  std::printf("PSNR %.2f dB with depth edges and visibility, %.2f dB without\n", with, without);
  EXPECT_GT(with, without + 3);
}

// The maps of very large views have nodes that are farther apart. Such views have no depth edges.
TEST_F(RequestRendererTest, CoarseMapsHaveNoDepthEdges) {
  const ArrayDepth depths(
      walls_.rig, walls_.own, [this](CameraIndex i) { return walls_.images[i].view(); }, 0, 1.2);
  View& view = request_.view;
  FocalMap map = FocalMap::for_view(view.width, view.height, 2 * FocalMap::kMinStep);
  map.from = plane_through(view.pose.position, view.pose.rotation()[2]);
  view.focus.map = std::make_shared<const FocalMap>(depths.surface(view, map));
  const CameraImages images = [this](CameraIndex i) -> const Image& { return walls_.images[i]; };
  const auto render = [&](const ArrayDepth* used) {
    return render_still(walls_.rig, walls_.mesh, view, images, Resampling::kBilinear, {}, nullptr, used).picture;
  };
  EXPECT_EQ(render(&depths).data(), render(nullptr).data());
}

TEST_F(RequestRendererTest, UsesCorrectedImagesForAllResults) {
  Rig rig = walls_.rig;
  for (size_t i = 0; i < rig.cameras.size(); i += 2)
    rig.cameras[i].colour = ColourModel{.black = {3, 4, 5}, .gamma = 2, .matrix = {1.1, 0, 0, 0, 1, 0, 0, 0, 0.9}};
  std::vector<Image> images;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    images.push_back(camera.colour ? corrected(walls_.images[i], *camera.colour, camera.principal_point())
                                   : walls_.images[i]);
  }
  std::vector<Source> sources = walls_.sources();
  for (size_t i = 0; i < sources.size(); i++) sources[i].image = images[i].view();
  request_.hypotheses = {{DepthHypothesis::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  const RenderedAnswer want = render(sources), plain = render(walls_.sources());
  const RigColourCorrections colours(rig);
  options_.colours = &colours;
  const RenderedAnswer answer = render(walls_.sources());
  EXPECT_EQ(answer.bytes, want.bytes);
  EXPECT_EQ(answer.consistency.unit, want.consistency.unit);
  EXPECT_EQ(answer.brightness, want.brightness);
  EXPECT_NE(answer.bytes, plain.bytes);
  const RigColourCorrections none(walls_.rig);
  EXPECT_FALSE(none.any());
  options_.colours = &none;
  EXPECT_EQ(render(walls_.sources()).bytes, plain.bytes);
}

TEST_F(RequestRendererTest, HypothesesAndBrightnessPrecedeTheAnswer) {
  RenderedAnswer answer = render(walls_.sources());
  EXPECT_TRUE(answer.consistency.unit.empty());
  EXPECT_TRUE(answer.brightness.empty());
  EXPECT_EQ(answer.gains, nullptr);
  request_.hypotheses = {{DepthHypothesis::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  answer = render(walls_.sources());
  EXPECT_FALSE(wire::parse_consistency_header(answer.consistency.unit)->gains);
  EXPECT_TRUE(wire::parse_consistency_header(answer.brightness)->gains);
  ASSERT_NE(answer.gains, nullptr);
  EXPECT_EQ(answer.gains->of(4), 1);

  // According to the means, all cameras are too bright, so their images are divided once there are enough means.
  const ByteBuffer before = std::move(answer.bytes);
  request_.gains.mean.assign(20 * 15, 100);
  for (unsigned i = 1; i < ExposureCompensation::kMeans; i++) EXPECT_EQ(render(walls_.sources()).bytes, before);
  answer = render(walls_.sources());
  EXPECT_NE(answer.gains->of(4), 1);
  EXPECT_NE(answer.bytes, before);
  renderer_.clear();
  EXPECT_EQ(render(walls_.sources()).gains->of(4), 1);
}

// An image that claims to be on a GPU; without one, it is fetched completely.
class FarImage : public GpuImage {
 public:
  explicit FarImage(const Image& image) : image_(image) {}
  Texture plane(int) const override { return {}; }
  void wait() const override {}
  ImageView fetch() const override { return is_gone_ ? ImageView{} : image_.view(); }
  bool is_fetched() const override { return true; }
  ImageView view() const {
    return {.family = image_.family(), .width = image_.width(), .height = image_.height(), .on_gpu = {this}};
  }
  void lose() { is_gone_ = true; }

 private:
  const Image& image_;
  bool is_gone_ = false;
};

// All results, including colours, gains, photo-consistency sums and brightness, are bit-identical to results of images
// in main memory.
TEST_F(RequestRendererTest, ImagesMayBeOnAGpu) {
  Rig rig = walls_.rig;
  for (size_t i = 0; i < rig.cameras.size(); i += 2)
    rig.cameras[i].colour = ColourModel{.black = {3, 4, 5}, .gamma = 2, .matrix = {1.1, 0, 0, 0, 1, 0, 0, 0, 0.9}};
  const RigColourCorrections some(rig);
  std::list<FarImage> images;
  std::vector<Source> far = walls_.sources();
  for (size_t i = 0; i < far.size(); i++) far[i].image = images.emplace_back(walls_.images[i]).view();
  options_.resampling = Resampling::kSharpened;
  request_.hypotheses = {{DepthHypothesis::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  for (const RigColourCorrections* const colours : {static_cast<const RigColourCorrections*>(nullptr), &some}) {
    options_.colours = colours;
    RequestRenderer of_near, of_far;
    request_.gains.mean.clear();
    for (unsigned i = 0; i < 2 + ExposureCompensation::kMeans; i++) {
      const RequestPlan plan = this->plan();
      const RenderedAnswer near = of_near.render({&plan, header_}, walls_.sources(), options_, scratch_);
      ImageMemory other;
      const RenderedAnswer answer = of_far.render({&plan, header_}, far, options_, other);
      EXPECT_EQ(answer.bytes, near.bytes);
      EXPECT_EQ(answer.consistency.unit, near.consistency.unit);
      EXPECT_EQ(answer.brightness, near.brightness);
      ASSERT_TRUE(answer.gains && near.gains);
      EXPECT_EQ(answer.gains->of(4), near.gains->of(4));
      if (i == 1 + ExposureCompensation::kMeans) {
        EXPECT_NE(answer.gains->of(4), 1);
      }
      request_.gains.mean.assign(20 * 15, 100);
    }
  }
  for (size_t i = 0; i < far.size(); i += 2) std::next(images.begin(), static_cast<ptrdiff_t>(i))->lose();
  std::vector<Source> some_sources = walls_.sources();
  for (size_t i = 0; i < some_sources.size(); i += 2) some_sources[i].image = {.family = PixelFamily::kNone};
  const RequestPlan plan = this->plan();
  RequestRenderer of_near, of_far;
  ImageMemory other;
  const RenderedAnswer near = of_near.render({&plan, header_}, some_sources, options_, scratch_);
  const RenderedAnswer answer = of_far.render({&plan, header_}, far, options_, other);
  EXPECT_EQ(answer.bytes, near.bytes);
  EXPECT_EQ(answer.consistency.unit, near.consistency.unit);
}

// Views that no longer exist must not hold megabytes.
TEST_F(RequestRendererTest, ViewsShareImageMemory) {
  KeptImages kept;
  options_.resampling = Resampling::kSharpened;
  request_.gains = {.use = true, .ask = true};
  const auto answer = [&](uint32_t view_id, RequestRenderer& renderer) {
    header_.view_id = view_id;
    const RequestPlan plan = this->plan();
    std::vector<Source> sources;
    for (const CameraIndex camera : plan.cameras()) sources.push_back(walls_.sources()[camera]);
    ImageMemory memory = kept.take();
    const ByteBuffer bytes = renderer.render({&plan, header_}, sources, options_, memory).bytes;
    std::vector<const uint8_t*> places;
    for (const ByteBuffer& image : memory.sharpened) places.push_back(image.data());
    kept.give_back(std::move(memory));
    return std::pair(places, bytes);
  };
  const auto [first, picture] = answer(1, renderer_);
  EXPECT_FALSE(first.empty());
  const size_t needed = kept.pooled_bytes();
  EXPECT_GT(needed, 0u);
  for (uint32_t view = 2; view < 20; view++) {
    RequestRenderer other;
    EXPECT_EQ(answer(view, other).first, first);
  }
  EXPECT_EQ(answer(1, renderer_).second, picture);
  EXPECT_EQ(kept.pooled_bytes(), needed);
}

}  // namespace
}  // namespace lf
