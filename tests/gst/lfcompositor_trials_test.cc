// SPDX-License-Identifier: LGPL-2.1-or-later
// Moments that are not what was asked for: counted and dropped, whatever they are, and the picture comes all the same.
#include <gmock/gmock.h>

#include <functional>
#include <random>

#include "focus/trial_levels.h"
#include "focus/trial_renderer.h"
#include "gst/compositor_fixture.h"
#include "wire/moments_codec.h"

namespace lf::test {
namespace {

class LfCompositorTrialsTest : public LfCompositorTest {
 protected:
  LfCompositorTrialsTest() : asked_(array_.request(0, 0)) {
    FocalMap map = FocalMap::for_view(asked_.view.width, asked_.view.height);
    map.from = {{0, 0, 1}, 0};
    map.farthest = 0.05;
    map.nearest = 0.3;
    map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 51);  // 10 m
    asked_.view.focus.map = std::make_shared<FocalMap>(std::move(map));
    asked_.trials = {{Trial::Kind::kBlurred, 0}, {Trial::Kind::kPlane, 200}};
    start(1, {{"rig", array_.rig_path()}, {"focus", "surface"}, {"focus-near", "3"}, {"focus-far", "20"}});
  }

  // What camera 0 sees: grey.
  std::vector<Moments> seen() const {
    const RenderJob job(array_.rig(), build_mesh(array_.rig()), trial_view(asked_.view), {{0}});
    Image grey(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
    std::ranges::fill(grey.data(), uint8_t{200});
    std::vector<std::vector<uint8_t>> levels;
    for (const Trial& trial : asked_.trials) levels.push_back(trial_levels(asked_.view, trial));
    std::vector<Moments> sums(levels.size());
    for (Moments& sum : sums) sum.reset(asked_.view.focus.map->columns, asked_.view.focus.map->rows);
    add_moments(job, {{Source{0, &array_.rig().cameras[0], grey.view()}}}, levels, sums);
    return sums;
  }
  std::vector<uint8_t> unit(const std::vector<Moments>& sums, bool small = true) const {
    return unit(sums, header(), small);
  }
  std::vector<uint8_t> unit(const std::vector<Moments>& sums, const wire::MomentsHeader& header,
                            bool small = true) const {
    const ByteBuffer bytes = wire::encode_moments(header, sums, small);
    return {bytes.begin(), bytes.end()};
  }
  wire::MomentsHeader header() const { return {asked_.view_id, asked_.sequence, array_.rig().hash(), 0, {}}; }

  // The picture of an answer that this unit goes before, and how many bad units were counted on the way.
  std::pair<std::vector<uint8_t>, uint64_t> picture_after(const std::vector<uint8_t>& unit) {
    const uint64_t before = stat(element_.get(), "bad-answers");
    request(asked_);
    EXPECT_EQ(gst_harness_push(nodes_[0].get(), to_buffer(unit)), GST_FLOW_OK);
    push(0, answer_of(asked_, {0, 1, 2, 3}));
    const std::vector<uint8_t> picture = pull();
    asked_.sequence++;
    asked_.target_time += kFrame;
    return {picture, stat(element_.get(), "bad-answers") - before};
  }

  ViewRequest asked_;
};

// Where nobody takes the surface none is looked for, but for once in a while.
TEST_F(LfCompositorTrialsTest, NobodyHeeds) {
  static int told = 0;
  asked_.view.focus.map.reset();
  asked_.trials.clear();
  for (const bool heeded : {false, true}) {
    told = 0;
    gst_pad_set_event_function(
        harness_->srcpad, heeded ? +[](GstPad*, GstObject*, GstEvent* event) -> gboolean {
          told += gst_event_has_name(event, "lightfield-feedback");
          gst_event_unref(event);
          return TRUE;
        } : +[](GstPad*, GstObject*, GstEvent* event) -> gboolean {
          told += gst_event_has_name(event, "lightfield-feedback");
          gst_event_unref(event);
          return FALSE;
        });
    constexpr int kPictures = 40;
    for (int i = 0; i < kPictures; i++) {
      request(asked_);
      push(0, answer_of(asked_, {0, 1, 2, 3}));
      pull();
      asked_.sequence++;
      asked_.target_time += kFrame;
    }
    EXPECT_GE(told, heeded ? kPictures - 16 : 2);
    EXPECT_LE(told, heeded ? kPictures : 4);
  }
}

TEST_F(LfCompositorTrialsTest, WhatIsNotWhatWasAskedForIsCountedAndDropped) {
  const auto [picture, bad] = picture_after(unit(seen()));
  ASSERT_EQ(picture.size(), 16u * 12 * 3);
  EXPECT_EQ(bad, 0u);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_EQ(picture_after(unit(seen(), false)), std::pair(picture, uint64_t{0})) << "in the other form";
  const struct {
    const char* what;
    std::function<std::vector<uint8_t>()> unit;
  } cases[] = {
      {"of another size",
       [&] {
         Moments wide;
         wide.reset(seen()[0].columns + 1, seen()[0].rows);
         return unit({wide, wide});
       }},
      {"of one trial too few",
       [&] {
         std::vector<Moments> sums = seen();
         sums.pop_back();
         return unit(sums);
       }},
      {"of another rig",
       [&] {
         wire::MomentsHeader other = header();
         other.rig_hash ^= 1;
         return unit(seen(), other);
       }},
      {"cut off",
       [&] {
         std::vector<uint8_t> bytes = unit(seen());
         bytes.resize(bytes.size() - 5);
         return bytes;
       }},
      {"a header and no more",
       [&] {
         std::vector<uint8_t> bytes = unit(seen());
         bytes.resize(20);
         return bytes;
       }},
      {"bytes too many",
       [&] {
         std::vector<uint8_t> bytes = unit(seen());
         bytes.push_back(0);
         return bytes;
       }},
      {"of bytes that do not inflate",
       [&] {
         std::vector<uint8_t> bytes = unit(seen());
         std::mt19937 random(1);
         for (size_t i = 46; i < bytes.size(); i++) bytes[i] = static_cast<uint8_t>(random());
         return bytes;
       }},
  };
  for (const auto& test : cases) {
    const auto [after, dropped] = picture_after(test.unit());
    EXPECT_EQ(after, picture) << test.what;
    EXPECT_EQ(dropped, 1u) << test.what;
  }
}

TEST_F(LfCompositorTrialsTest, ARangeWithItsEndsExchangedIsLeftOutAndSaid) {
  g_autoptr(GstBus) bus = gst_bus_new();
  gst_element_set_bus(element_.get(), bus);
  const auto set = [&](const char* name, double metres) { g_object_set(element_.get(), name, metres, nullptr); };
  set("focus-far", 2);
  EXPECT_THAT(warnings_on(bus), testing::HasSubstr("focus-near is 3 m and focus-far 2 m: the near end must be nearer"));
  g_object_set(element_.get(), "post-messages", TRUE, nullptr);
  EXPECT_EQ(warnings_on(bus), "") << "said once";
  set("focus-near", 1);
  EXPECT_EQ(warnings_on(bus), "");
  gst_element_set_bus(element_.get(), nullptr);
}

TEST_F(LfCompositorTrialsTest, WithoutTrialsThereIsNothingToSay) {
  const std::vector<uint8_t> unasked = unit(seen());
  asked_.trials.clear();
  const auto [picture, bad] = picture_after(unasked);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_EQ(bad, 1u);
}

}  // namespace
}  // namespace lf::test
