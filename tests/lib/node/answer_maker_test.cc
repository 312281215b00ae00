// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_maker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <list>

#include "image/card_image.h"
#include "image/correction.h"
#include "lib/focus/array_of_walls.h"
#include "wire/moments_codec.h"

namespace lf {
namespace {

class AnswerMakerTest : public testing::Test {
 protected:
  AnswerMakerTest() {
    request_.view = walls_.view(60);
    request_.rig_hash = header_.rig_hash = walls_.rig.hash();
    header_.view_width = request_.view.width;
    header_.view_height = request_.view.height;
    header_.family = PixelFamily::kRgb;
    options_.codec = CodecChoice::kRaw16;
  }
  AnswerMaker::Units make(const std::vector<Source>& all) {
    const auto task = make_task(walls_.rig, walls_.mesh, request_, walls_.own);
    std::vector<Source> sources;
    for (const CameraIndex camera : task->cameras()) sources.push_back(all[camera]);
    return make(*task, sources, maker_, scratch_);
  }
  AnswerMaker::Units make(const AnswerTask& task, const std::vector<Source>& sources, AnswerMaker& maker,
                          ImageMemory& scratch) {
    const AnswerMaker::Work work{&task, header_};
    return std::move(maker.make({&work, 1}, sources, options_, scratch, [] { return ByteBuffer(); }).front());
  }
  test::ArrayOfWalls walls_;
  ViewRequest request_;
  wire::AnswerHeader header_;
  AnswerMaker::Options options_;
  AnswerMaker maker_;
  ImageMemory scratch_;
};

TEST_F(AnswerMakerTest, SharpensWhereThatIsAsked) {
  const ByteBuffer plain = make(walls_.sources()).answer.bytes;
  options_.resampling = Resampling::kSharpened;
  const ByteBuffer sharp = make(walls_.sources()).answer.bytes;
  EXPECT_NE(sharp, plain);
  options_.resampling = Resampling::kBilinear;
  std::vector<Image> sharpened_images;
  for (const Image& image : walls_.images) sharpened_images.push_back(sharpened(image));
  std::vector<Source> sources = walls_.sources();
  for (size_t i = 0; i < sources.size(); i++) sources[i].image = sharpened_images[i].view();
  EXPECT_EQ(make(sources).answer.bytes, sharp);
}

TEST_F(AnswerMakerTest, AllThatIsMadeOfImagesIsMadeOfCorrectedOnes) {
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
  request_.trials = {{Trial::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  const AnswerMaker::Units want = make(sources), plain = make(walls_.sources());
  const CameraColours colours(rig);
  options_.colours = &colours;
  const AnswerMaker::Units units = make(walls_.sources());
  EXPECT_EQ(units.answer.bytes, want.answer.bytes);
  EXPECT_EQ(units.tried.unit, want.tried.unit);
  EXPECT_EQ(units.brightness, want.brightness);
  EXPECT_NE(units.answer.bytes, plain.answer.bytes);
  // A rig without colours costs nothing.
  const CameraColours none(walls_.rig);
  EXPECT_FALSE(none.any());
  options_.colours = &none;
  EXPECT_EQ(make(walls_.sources()).answer.bytes, plain.answer.bytes);
}

TEST_F(AnswerMakerTest, TrialsAndBrightnessGoBeforeTheAnswer) {
  AnswerMaker::Units units = make(walls_.sources());
  EXPECT_TRUE(units.tried.unit.empty());
  EXPECT_TRUE(units.brightness.empty());
  EXPECT_EQ(units.gains, nullptr);
  request_.trials = {{Trial::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  units = make(walls_.sources());
  EXPECT_FALSE(wire::parse_moments_header(units.tried.unit)->gains);
  EXPECT_TRUE(wire::parse_moments_header(units.brightness)->gains);
  ASSERT_NE(units.gains, nullptr);
  EXPECT_EQ(units.gains->of(4), 1);

  // The means say that all cameras are too bright, and so their images are divided once there are enough.
  const ByteBuffer before = std::move(units.answer.bytes);
  request_.gains.mean.assign(20 * 15, 100);
  for (unsigned i = 1; i < CameraGains::kMeans; i++) EXPECT_EQ(make(walls_.sources()).answer.bytes, before);
  units = make(walls_.sources());
  EXPECT_NE(units.gains->of(4), 1);
  EXPECT_NE(units.answer.bytes, before);
  maker_.clear();
  EXPECT_EQ(make(walls_.sources()).gains->of(4), 1);
}

// An image that is said to be on a card; without one all of it is fetched.
class FarImage : public CardImage {
 public:
  explicit FarImage(const Image& image) : image_(image) {}
  Texture plane(int) const override { return {}; }
  void wait() const override {}
  ImageView fetch() const override { return is_gone_ ? ImageView{} : image_.view(); }
  bool is_fetched() const override { return true; }
  ImageView view() const {
    return {.family = image_.family(), .width = image_.width(), .height = image_.height(), .on_card = {this}};
  }
  void lose() { is_gone_ = true; }

 private:
  const Image& image_;
  bool is_gone_ = false;
};

// What is made of them, colours, gains, moments and brightness included, is to the bit what it is of images here.
TEST_F(AnswerMakerTest, ImagesMayBeOnACard) {
  Rig rig = walls_.rig;
  for (size_t i = 0; i < rig.cameras.size(); i += 2)
    rig.cameras[i].colour = ColourModel{.black = {3, 4, 5}, .gamma = 2, .matrix = {1.1, 0, 0, 0, 1, 0, 0, 0, 0.9}};
  const CameraColours some(rig);
  std::list<FarImage> images;
  std::vector<Source> far = walls_.sources();
  for (size_t i = 0; i < far.size(); i++) far[i].image = images.emplace_back(walls_.images[i]).view();
  options_.resampling = Resampling::kSharpened;
  request_.trials = {{Trial::Kind::kPlane, 60}};
  request_.gains = {.use = true, .ask = true};
  for (const CameraColours* const colours : {static_cast<const CameraColours*>(nullptr), &some}) {
    options_.colours = colours;
    AnswerMaker of_near, of_far;
    request_.gains.mean.clear();
    for (unsigned i = 0; i < 2 + CameraGains::kMeans; i++) {
      const auto task = make_task(walls_.rig, walls_.mesh, request_, walls_.own);
      const AnswerMaker::Units near = make(*task, walls_.sources(), of_near, scratch_);
      ImageMemory other;
      const AnswerMaker::Units units = make(*task, far, of_far, other);
      EXPECT_EQ(units.answer.bytes, near.answer.bytes);
      EXPECT_EQ(units.tried.unit, near.tried.unit);
      EXPECT_EQ(units.brightness, near.brightness);
      ASSERT_TRUE(units.gains && near.gains);
      EXPECT_EQ(units.gains->of(4), near.gains->of(4));
      if (i == 1 + CameraGains::kMeans) {
        EXPECT_NE(units.gains->of(4), 1);
      }
      request_.gains.mean.assign(20 * 15, 100);
    }
  }
  // Those that can't be had are as none.
  for (size_t i = 0; i < far.size(); i += 2) std::next(images.begin(), static_cast<ptrdiff_t>(i))->lose();
  std::vector<Source> some_sources = walls_.sources();
  for (size_t i = 0; i < some_sources.size(); i += 2) some_sources[i].image = {.family = PixelFamily::kNone};
  const auto task = make_task(walls_.rig, walls_.mesh, request_, walls_.own);
  AnswerMaker of_near, of_far;
  ImageMemory other;
  const AnswerMaker::Units near = make(*task, some_sources, of_near, scratch_), units = make(*task, far, of_far, other);
  EXPECT_EQ(units.answer.bytes, near.answer.bytes);
  EXPECT_EQ(units.tried.unit, near.tried.unit);
}

// Megabytes are not kept for each view that ever was.
TEST_F(AnswerMakerTest, ImagesOfOneViewAreMadeInAnothersMemory) {
  KeptImages kept;
  options_.resampling = Resampling::kSharpened;
  request_.gains = {.use = true, .ask = true};
  const auto answer = [&](uint32_t view_id, AnswerMaker& maker) {
    header_.view_id = view_id;
    const auto task = make_task(walls_.rig, walls_.mesh, request_, walls_.own);
    std::vector<Source> sources;
    for (const CameraIndex camera : task->cameras()) sources.push_back(walls_.sources()[camera]);
    ImageMemory memory = kept.take();
    const ByteBuffer bytes = make(*task, sources, maker, memory).answer.bytes;
    std::vector<const uint8_t*> places;
    for (const ByteBuffer& image : memory.sharpened) places.push_back(image.data());
    kept.give_back(std::move(memory));
    return std::pair(places, bytes);
  };
  const auto [first, picture] = answer(1, maker_);
  EXPECT_FALSE(first.empty());
  const size_t needed = kept.kept_bytes();
  EXPECT_GT(needed, 0u);
  for (uint32_t view = 2; view < 20; view++) {
    AnswerMaker other;
    EXPECT_EQ(answer(view, other).first, first);
  }
  EXPECT_EQ(answer(1, maker_).second, picture);
  EXPECT_EQ(kept.kept_bytes(), needed);
}

}  // namespace
}  // namespace lf
