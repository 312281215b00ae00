// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/request_guard.h"
#include "support/test.h"

namespace lf {
namespace {

class LimitsTest : public testing::Test {
 protected:
  RequestLimits parse(const char* text) {
    g_autoptr(GstStructure) structure = gst_structure_from_string(text, nullptr);
    EXPECT_TRUE(structure) << text;
    problems_.clear();
    return parse_limits(structure, problems_);
  }
  std::vector<std::string> problems_;
};

TEST_F(LimitsTest, MissingFieldsHaveDefaults) {
  EXPECT_EQ(parse_limits(nullptr, problems_), RequestLimits());
  EXPECT_EQ(parse("limits"), RequestLimits());
  RequestLimits expected;
  expected.pixels = 4'000'000;
  EXPECT_EQ(parse("limits,max-pixels=4000000"), expected);
  EXPECT_THAT(problems_, IsEmpty());
}

TEST_F(LimitsTest, NumbersMayHaveAnyType) {
  const RequestLimits expected = {4'000'000, 0.25, 2, 60, 100};
  EXPECT_EQ(parse("limits,max-pixels=4e6,max-aperture=1/4,max-hypotheses=2,max-requests-per-second=(gint64)60,"
                  "max-views=(guint64)100"),
            expected);
  EXPECT_EQ(parse("limits,max-aperture=3").aperture, 3);
  EXPECT_THAT(problems_, IsEmpty());
}

TEST_F(LimitsTest, EndsOfTheRangesAreAccepted) {
  const RequestLimits least = {1, 0, 0, 0, 1}, most = {uint64_t{1} << 28, 1e6, 16, G_MAXUINT, 65536};
  EXPECT_EQ(parse("limits,max-pixels=1,max-aperture=0,max-hypotheses=0,max-requests-per-second=0,max-views=1"), least);
  EXPECT_EQ(parse("limits,max-pixels=268435456,max-aperture=1e6,max-hypotheses=16,"
                  "max-requests-per-second=(guint)4294967295,max-views=65536"),
            most);
  EXPECT_THAT(problems_, IsEmpty());
}

TEST_F(LimitsTest, WrongFieldsAreNamedAndIgnored) {
  RequestLimits expected;
  expected.hypotheses = 3;
  EXPECT_EQ(parse("limits,max-pixels=0,max-aperture=-1,max-hypotheses=3,max-requests-per-second=1.5,max-views=65537"),
            expected);
  EXPECT_THAT(problems_,
              ElementsAre(mentions("max-pixels", "1 to 268435456", "0"), mentions("max-aperture", "0 to 1000000", "-1"),
                          mentions("max-requests-per-second", "0 to 4294967295", "1.5"),
                          mentions("max-views", "1 to 65536", "65537")));
  EXPECT_EQ(parse("limits,max-pixels=many,max-views=true,max-hypotheses=(gint)[ 1, 3 ],max-cameras=5"),
            RequestLimits());
  EXPECT_THAT(problems_,
              ElementsAre(mentions("max-pixels", "1 to 268435456", "many"), mentions("max-views", "1 to 65536", "true"),
                          mentions("max-hypotheses", "0 to 16", "[ 1, 3 ]"), mentions("max-cameras", "no such")));
}

TEST_F(LimitsTest, StructureHasAllFields) {
  const RequestLimits limits = {1000, 0.5, 4, 20, 7};
  g_autoptr(GstStructure) structure = limits_structure(limits);
  EXPECT_STREQ(gst_structure_get_name(structure), "limits");
  EXPECT_EQ(gst_structure_n_fields(structure), 5);
  guint64 pixels = 0;
  gdouble aperture = 0;
  guint hypotheses = 0, rate = 0, views = 0;
  EXPECT_TRUE(gst_structure_get(structure, "max-pixels", G_TYPE_UINT64, &pixels, "max-aperture", G_TYPE_DOUBLE,
                                &aperture, "max-hypotheses", G_TYPE_UINT, &hypotheses, "max-requests-per-second",
                                G_TYPE_UINT, &rate, "max-views", G_TYPE_UINT, &views, nullptr));
  EXPECT_EQ((RequestLimits{pixels, aperture, hypotheses, rate, views}), limits);
  EXPECT_EQ(parse_limits(structure, problems_), limits);
  g_autofree gchar* text = gst_structure_to_string(structure);
  EXPECT_EQ(parse(text), limits);
  EXPECT_THAT(problems_, IsEmpty());
}

}  // namespace
}  // namespace lf
