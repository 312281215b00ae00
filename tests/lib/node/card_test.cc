// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/card.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "lib/render/sum_arrays.h"
#include "render/ownership.h"
#include "support/process.h"

namespace lf {
namespace {

TEST(RendererRace, TheFasterOneWinsAndTheFirstOfTheCardDoesNotCount) {
  for (const uint64_t card_ns : {500, 2000}) {
    RendererRace race;
    int turns[2] = {};
    while (!race.decided()) {
      const bool card = race.card_is_next();
      // The card compiles its programs first. Half of the CPU's answers are held up by others.
      race.add(card, 1000, card ? (turns[1] == 0 ? 1000000 : card_ns) : turns[0] % 2 ? 1000 : 90000);
      ASSERT_LE(++turns[card], RendererRace::kRounds + 1);
    }
    EXPECT_EQ(turns[0], RendererRace::kRounds);
    EXPECT_EQ(turns[1], RendererRace::kRounds + 1);
    EXPECT_EQ(race.card_is_next(), card_ns < 1000);
    race.add(true, 1000, 1);  // it is decided
    EXPECT_EQ(race.card_is_next(), card_ns < 1000);
    EXPECT_EQ(race.best(true), static_cast<double>(card_ns) / 1000);
  }
}

TEST(RendererRace, BeginsAgain) {
  RendererRace race;
  for (int i = 0; i < 3; i++) race.add(true, 1000, 10);
  race.begin_again();
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity());
  race.add(true, 1000, 1);
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity()) << "programs are compiled anew";
  race.add(true, 1000, 2000);
  EXPECT_EQ(race.best(true), 2);
}

TEST(RendererRace, OneAloneDecidesNothing) {
  RendererRace race;
  for (int i = 0; i < 100; i++) race.add(false, 1000, 1000);
  EXPECT_FALSE(race.decided());
  EXPECT_TRUE(race.card_is_next());
  race.add(true, 0, 1000);
  EXPECT_EQ(race.best(true), std::numeric_limits<double>::infinity());
}

RenderedAnswer answer(bool drawn, const std::string& refused_why = "") {
  return {.drawing = {drawn, !refused_why.empty(), refused_why}, .pixels = 1000, .render_ns = 1000};
}

TEST(Card, IsLeftAloneForAWhileWhereItRefuses) {
  constexpr uint64_t kSecond = 1'000'000'000;
  uint64_t now = 77 * kSecond;
  Card card(gl::SumDrawer::create, [&] { return now; });
  std::string news;
  const std::shared_ptr<gl::SumDrawer> drawer = card.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  const std::string draws = "gl: " + drawer->device();
  const auto refuse = [&](const std::string& why) {
    EXPECT_EQ(card.open(RendererChoice::kGl, news), drawer);
    card.rendered(RendererChoice::kGl, answer(false, why));
    EXPECT_EQ(news, "");
    EXPECT_EQ(card.explain(RendererChoice::kGl), "cpu, " + drawer->device() + " does not draw this: " + why);
  };
  for (int i = 0; i < 2; i++) {
    refuse("too large");
    refuse("too large");
    card.rendered(RendererChoice::kGl, answer(true));  // not three in a row
    EXPECT_EQ(card.explain(RendererChoice::kGl), draws);
  }
  for (int i = 0; i < 3; i++) refuse("too large");
  for (int i = 0; i < 10; i++, now += kSecond) {
    EXPECT_EQ(card.open(RendererChoice::kGl, news), nullptr) << i;
    EXPECT_EQ(news, i > 0 ? "" : drawer->device() + " can't draw what is asked for, the CPU does: too large");
    news.clear();
    card.rendered(RendererChoice::kGl, answer(false));
    EXPECT_EQ(card.explain(RendererChoice::kGl), "cpu, " + drawer->device() + " does not draw this: too large");
  }
  refuse("too large");  // once more is enough
  for (int i = 0; i < 10; i++, now += kSecond) EXPECT_EQ(card.open(RendererChoice::kGl, news), nullptr) << i;
  EXPECT_EQ(news, "") << "that is known";
  EXPECT_EQ(card.open(RendererChoice::kGl, news), drawer);
  card.rendered(RendererChoice::kGl, answer(true));
  EXPECT_EQ(card.explain(RendererChoice::kGl), draws);
}

// Trials are left alone where they are refused, whatever becomes of answers.
TEST(Card, DrawsTrialsAndSeveralViews) {
  uint64_t now = 1;
  const auto open = [](gl::Context::Drivers, std::string& why) {
    return gl::SumDrawer::create(gl::Context::Drivers::kAny, why);
  };
  Card card(open, [&] { return now; });
  std::string news;
  EXPECT_EQ(card.open_for_trials(RendererChoice::kGl), nullptr) << "it is opened for answers";
  EXPECT_FALSE(card.draws_several(RendererChoice::kGl));
  const std::shared_ptr<gl::SumDrawer> drawer = card.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  EXPECT_EQ(card.open_for_trials(RendererChoice::kCpu), nullptr);
  EXPECT_EQ(card.open_for_trials(RendererChoice::kGl), drawer);
  EXPECT_TRUE(card.draws_several(RendererChoice::kGl));
  EXPECT_FALSE(card.draws_several(RendererChoice::kCpu));
  EXPECT_FALSE(card.draws_several(RendererChoice::kAuto)) << "it has not decided yet";
  if (drawer->is_software()) {
    EXPECT_EQ(card.open_for_trials(RendererChoice::kAuto), nullptr);
  }
  const std::string draws = "gl: " + drawer->device();
  card.rendered(RendererChoice::kGl, answer(true));
  EXPECT_EQ(card.explain(RendererChoice::kGl), draws);
  card.tried(RendererChoice::kGl, {.unit = {}, .drawing = {.drawn = true, .why_not = ""}, .nodes = 100, .ns = 1});
  card.tried(RendererChoice::kGl, {});  // an answer without any tells nothing
  EXPECT_EQ(card.explain(RendererChoice::kGl), draws + ", trials, too");
  for (int i = 0; i < Patience::kRefusals; i++) {
    EXPECT_EQ(card.open_for_trials(RendererChoice::kGl), drawer);
    card.tried(RendererChoice::kGl, {.unit = {}, .drawing = {.refused = true, .why_not = "too large"}, .nodes = 100});
  }
  EXPECT_EQ(card.open_for_trials(RendererChoice::kGl), nullptr);
  EXPECT_EQ(card.open(RendererChoice::kGl, news), drawer);
  EXPECT_EQ(card.explain(RendererChoice::kGl), draws);
  now += Patience::kRest;
  EXPECT_EQ(card.open_for_trials(RendererChoice::kGl), drawer);
  EXPECT_EQ(news, "");
}

// To where pictures are: once, where there is something that draws, and who still draws with the one before may go on.
TEST(Card, MovesToAnotherContext) {
  Card card;
  std::string news, why;
  int opened = 0;
  constexpr gl::ShareGroup kHere = 7, kThere = 8;
  // Contexts of nobody's are as good as any.
  const Card::OpenIn open = [&](std::string& reason) {
    opened++;
    return gl::SumDrawer::create(gl::Context::Drivers::kAny, reason);
  };
  const Card::OpenIn fail = [&](std::string& reason) {
    opened++;
    reason = "no more of them";
    return std::unique_ptr<gl::SumDrawer>();
  };
  card.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 0) << "nothing draws yet";
  const std::shared_ptr<gl::SumDrawer> before = card.open(RendererChoice::kGl, news);
  ASSERT_TRUE(before) << news;
  card.move_to(RendererChoice::kCpu, kHere, false, open, why);
  card.move_to(RendererChoice::kAuto, kHere, false, open, why);
  EXPECT_EQ(opened, 0) << "auto has not decided yet";
  for (int i = 0; i < 3; i++) card.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 1);
  const std::shared_ptr<gl::SumDrawer> after = card.open(RendererChoice::kGl, news);
  EXPECT_TRUE(after);
  EXPECT_NE(after, before);
  for (int i = 0; i < 3; i++) card.move_to(RendererChoice::kGl, kThere, false, fail, why);
  EXPECT_EQ(opened, 2);
  EXPECT_EQ(why, "no more of them");
  card.move_to(RendererChoice::kGl, kHere, false, open, why);
  EXPECT_EQ(opened, 2) << "to and fro would take all the time";
  EXPECT_EQ(card.open(RendererChoice::kGl, news), after) << "goes on where it was";
  card.leave();
  EXPECT_EQ(card.open(RendererChoice::kGl, news), after) << "it is nobody's";
  EXPECT_EQ(news, "");
}

TEST(Card, AutoNeverTakesWhatComputesOnTheCpu) {
  std::string why_not;
  const auto any = gl::SumDrawer::create(gl::Context::Drivers::kAny, why_not);
  ASSERT_TRUE(any) << why_not;
  if (!any->is_software()) return;  // there is better
  // Even if it is lied to about what it gets.
  int opened = 0;
  Card card([&](gl::Context::Drivers drivers, std::string& why) {
    opened++;
    EXPECT_EQ(drivers, gl::Context::Drivers::kHardware);
    return gl::SumDrawer::create(gl::Context::Drivers::kAny, why);
  });
  std::string news;
  EXPECT_EQ(card.explain(RendererChoice::kAuto), "auto: nothing has been rendered yet");
  for (int i = 0; i < 3; i++) EXPECT_EQ(card.open(RendererChoice::kAuto, news), nullptr);
  EXPECT_EQ(opened, 1);
  EXPECT_EQ(news, "");
  EXPECT_THAT(card.explain(RendererChoice::kAuto), testing::HasSubstr("is the CPU, too"));
  EXPECT_NE(card.open(RendererChoice::kGl, news), nullptr);  // who asks for it gets it
  EXPECT_EQ(opened, 1);
}

TEST(Card, SaysWhyThereIsNone) {
  int opened = 0;
  Card card([&](gl::Context::Drivers, std::string& why) {
    opened++;
    why = "nothing here";
    return std::unique_ptr<gl::SumDrawer>();
  });
  std::string news;
  EXPECT_EQ(card.open(RendererChoice::kCpu, news), nullptr);
  EXPECT_EQ(opened, 0);
  EXPECT_EQ(card.open(RendererChoice::kAuto, news), nullptr);
  EXPECT_EQ(news, "");
  EXPECT_EQ(card.explain(RendererChoice::kAuto), "auto: cpu, there is no other: nothing here");
  EXPECT_EQ(card.open(RendererChoice::kGl, news), nullptr);  // any driver will do now
  EXPECT_TRUE(news.starts_with("no OpenGL ES 3.1 to render with, the CPU does: nothing here (a card needs")) << news;
  news.clear();
  for (const RendererChoice choice : {RendererChoice::kAuto, RendererChoice::kGl})
    EXPECT_EQ(card.open(choice, news), nullptr);
  EXPECT_EQ(opened, 2);
  EXPECT_EQ(news, "");
}

// What a node has to give for one view, over and over.
class CardLossTest : public testing::Test {
 protected:
  // Renders by the card if there is one; the largest difference from the CPU's, of 255.
  double render(gl::SumDrawer* card, bool& drawn) {
    const SumRenderer renderer(production_.plan, production_.owners.runs(), sources_, PixelFamily::kI420,
                               Coordinates::kGrid, card);
    const SumRenderer cpu(production_.plan, production_.owners.runs(), sources_, PixelFamily::kI420);
    drawn = renderer.drawing().drawn;
    const Rect whole = test::whole(view_);
    test::Sum a(PixelFamily::kI420, whole), b(PixelFamily::kI420, whole);
    renderer.render_rows(0, view_.height, a.planes);
    cpu.render_rows(0, view_.height, b.planes);
    int worst = 0;
    for (int c = 0; c < 3; c++)
      for (size_t i = 0; i < a.memory[c].size(); i++)
        worst = std::max(worst, std::abs(a.memory[c][i] - b.memory[c][i]));
    return worst / 128.0;
  }

  reference::Random random_{1};
  const Rig rig_ = test::jittered_array(random_, 3, 64, 48, -0.1);
  const View view_ = test::view_into(rig_, 3, 64, 48, random_.small_rotation(0.1));
  const test::Production production_{rig_, build_mesh(rig_), view_};
  const std::vector<Image> images_ = test::i420_of(images_of(rig_, random_, reference::smooth_image));
  const std::vector<Source> sources_ = test::sources_of(rig_, production_.plan, images_);
};

TEST_F(CardLossTest, WhatIsTooLargeIsRefusedWithTheReason) {
  Card card;
  std::string news;
  const std::shared_ptr<gl::SumDrawer> drawer = card.open(RendererChoice::kGl, news);
  ASSERT_TRUE(drawer) << news;
  View wide = view_;
  wide.width = 1 << 16;
  wide.height = 2;
  wide.lens = Lens::pinhole(1.25 * wide.width, (wide.width - 1) / 2.0, 0.5);
  const test::Production production(rig_, build_mesh(rig_), wide);
  const std::vector<Source> sources = test::sources_of(rig_, production.plan, images_);
  const SumRenderer renderer(production.plan, production.owners.runs(), sources, PixelFamily::kI420, Coordinates::kGrid,
                             drawer.get());
  EXPECT_FALSE(renderer.drawing().drawn);
  EXPECT_TRUE(renderer.drawing().refused);
  EXPECT_EQ(renderer.drawing().why_not, "the view is too large");
}

// As many as LF_CYCLES says.
TEST_F(CardLossTest, StartsAndStopsLeaveNothing) {
  const char* const wanted = std::getenv("LF_CYCLES");
  const int cycles = wanted ? std::atoi(wanted) : 8;
  const auto resident = [] { return static_cast<double>(test::resident_kib()) / 1024; };
  double megabytes = 0;
  ptrdiff_t files = 0, threads = 0;
  for (int i = 0; i < cycles; i++) {
    if (i == cycles / 4) {  // what is kept for good is there
      megabytes = resident();
      files = test::count_of("fd");
      threads = test::count_of("task");
    }
    Card card;
    std::string news;
    const std::shared_ptr<gl::SumDrawer> drawer = card.open(RendererChoice::kGl, news);
    ASSERT_TRUE(drawer) << news;
    bool drawn = false;
    EXPECT_LE(render(drawer.get(), drawn), 1);
    EXPECT_TRUE(drawn);
  }
  std::printf("%d cycles: %.1f MiB more than after a quarter of them\n", cycles, resident() - megabytes);
  EXPECT_LE(resident() - megabytes, 0.1 * megabytes + 8);
  EXPECT_LE(test::count_of("fd"), files);
  EXPECT_LE(test::count_of("task"), threads);
}

TEST_F(CardLossTest, PicturesGoOnThroughAHundredLosses) {
  for (int i = 0; i < 100; i++) {
    Card card;
    std::string news;
    const std::shared_ptr<gl::SumDrawer> drawer = card.open(RendererChoice::kGl, news);
    ASSERT_TRUE(drawer) << news;
    bool drawn = false;
    if (i % 10 == 0) {
      EXPECT_LE(render(drawer.get(), drawn), 1);
      EXPECT_TRUE(drawn);
    }
    drawer->lose();
    EXPECT_LE(render(card.open(RendererChoice::kGl, news).get(), drawn), 1);  // found out on the way
    EXPECT_FALSE(drawn);
    EXPECT_EQ(news, "");
    EXPECT_EQ(card.open(RendererChoice::kGl, news), nullptr);
    EXPECT_EQ(news, drawer->device() + " is lost to this process, the CPU renders from now on");
    EXPECT_EQ(card.explain(RendererChoice::kGl), "cpu, " + drawer->device() + " is lost");
    EXPECT_EQ(card.explain(RendererChoice::kAuto), "auto: cpu, " + drawer->device() + " is lost");
  }
}

}  // namespace
}  // namespace lf
