// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/video/navigation.h>

#include "focus/hypothesis_renderer.h"
#include "gst/compositor_fixture.h"
#include "node/camera_access.h"

namespace lf::test {
namespace {

TEST_F(LfCompositorTest, AddsTheAnswerOfOneNode) {
  start(1);
  ask_and_answer(0, 3 * kFrame, {0, 1, 2, 3});
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(picture.size(), 16u * 12 * 3);
  EXPECT_EQ(last_pts_, 3 * kFrame);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_LE(range(picture).second, 201);
  EXPECT_EQ(output_format(), "RGB");
}

TEST_F(LfCompositorTest, EveryStageIsTimed) {
  start(1);
  for (uint32_t i = 0; i < 5; i++) {
    ask_and_answer(i, i * kFrame, {0, 1, 2, 3});
    pull();
  }
  for (const std::string stage : {"answer", "add", "picture", "composite", "latency"}) {
    const auto share = [&](const char* name) { return stat(element_.get(), (stage + name).c_str()); };
    EXPECT_LE(share("-ns-p50"), share("-ns-p95")) << stage;
    EXPECT_LE(share("-ns-p95"), share("-ns-p99")) << stage;
    EXPECT_LE(share("-ns-p99"), stat(element_.get(), "latency-ns-p99")) << stage;
  }
}

TEST_F(LfCompositorTest, TwoNodesMakeTheSamePictureAsOne) {
  const ViewRequest asked = array_.request(0, 0);
  start(1);
  Image noise(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  for (size_t i = 0; i < noise.data().size(); i++) noise.data()[i] = static_cast<uint8_t>(i * 2654435761u >> 24);
  const auto push_sums = [&](size_t node, const std::vector<CameraIndex>& cameras) {
    const ByteBuffer bytes = node_answer_bytes(array_.rig(), asked, cameras, noise, CodecChoice::kRaw16);
    push(node, std::vector<uint8_t>{bytes.begin(), bytes.end()});
  };
  request(asked);
  push_sums(0, {0, 1, 2, 3});
  const std::vector<uint8_t> together = pull();
  nodes_.clear();
  start(2);
  request(asked);
  push_sums(1, {1, 3});
  push_sums(0, {0, 2});
  EXPECT_EQ(pull(), together);
  EXPECT_LT(range(together).first, range(together).second - 50) << "not uniform";
}

TEST_F(LfCompositorTest, AnswersMayPrecedeTheRequest) {
  start(1);
  const ViewRequest asked = array_.request(0, 0);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  request(asked);
  EXPECT_GE(range(pull()).first, 199);
}

TEST_F(LfCompositorTest, ComposesBySequenceNotByArrival) {
  start(2);
  // the sequence number wraps around
  const ViewRequest first = array_.request(UINT32_MAX, 0), second = array_.request(0, kFrame);
  request_and_answer(first, {0, 2}, 10);
  push(1, answer_of(second, {1, 3}, 250));
  EXPECT_LE(range(pull()).second, 11);
  request_and_answer(second, {0, 2}, 250);
  EXPECT_GE(range(pull()).first, 248);
}

TEST_F(LfCompositorTest, OtherViewsAreIgnored) {
  start(1, {{"view-id", "2"}});
  const ViewRequest other = array_.request(0, 0, 1), own = array_.request(0, 0, 2);
  request_and_answer(other, {0, 1, 2, 3}, 10);
  request_and_answer(own, {0, 1, 2, 3}, 100);
  EXPECT_GE(range(pull()).first, 99);
  EXPECT_EQ(stat(element_.get(), "pictures"), 1u);
}

TEST_F(LfCompositorTest, DamagedFragmentsAreCountedAndSkipped) {
  const ViewRequest asked = array_.request(0, 0);
  const wire::Answer answer = answer_of(asked, {0, 1, 2, 3});
  ByteBuffer bytes = wire::encode_fragments(answer, answer.fragments, 90);
  const wire::AnswerView view = wire::parse_answer(bytes).value();
  const uint8_t marker[] = {0xff, 0xd9};
  for (const bool damage : {false, true}) {
    start(1, {{"rig", array_.rig_path()}});
    if (damage) std::ranges::copy(marker, bytes.begin() + (view.fragments[0].payload.data() - bytes.data()) + 4);
    request(asked);
    push(0, std::vector<uint8_t>{bytes.begin(), bytes.end()});
    const std::vector<uint8_t> picture = pull();
    if (!damage) {
      EXPECT_GE(range(picture).first, 190);
      EXPECT_LE(range(picture).second, 210);
    }
    EXPECT_EQ(stat(element_.get(), "damaged-fragments"), damage ? 1u : 0u);
    EXPECT_EQ(stat(element_.get(), "missing-fragments") > 0, damage);
    EXPECT_EQ(stat(element_.get(), "fragments"), answer.fragments.size() - damage);
    EXPECT_EQ(stat(element_.get(), "incomplete"), damage ? 1u : 0u);
    EXPECT_EQ(stat(element_.get(), "bad-answers"), 0u);
  }
}

TEST_F(LfCompositorTest, LateAndForeignAnswersAreCounted) {
  start(1);
  const ViewRequest old = array_.request(4, 0), asked = array_.request(5, 0);
  wire::Answer other_rig = answer_of(asked, {0, 1, 2, 3});
  other_rig.rig_hash ^= 1;
  request(asked);
  push(0, answer_of(old, {0, 1, 2, 3}));
  push(0, std::vector<uint8_t>{9, 9, 9});
  push(0, other_rig);
  EXPECT_EQ(range(pull()).second, 0);
  EXPECT_EQ(stat(element_.get(), "late-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfCompositorTest, OtherCamerasFillInForAMissingCamera) {
  start(1, {{"rig", array_.rig_path()}});
  ask_and_answer(0, 0, {0, 1, 2});
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 1u);
  // Camera 3 is the far corner: near the centre, cameras 0 to 2 have most of the weight and restore the grey.
  EXPECT_NEAR(picture[(6 * 16 + 8) * 3], 200, 6);
}

TEST_F(LfCompositorTest, RendersPixelsOfCameras) {
  const ViewRequest asked = array_.request(0, 0);
  const std::vector<CameraIndex> all{0, 1, 2, 3};
  Image image(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  std::ranges::fill(image.data(), uint8_t{200});
  std::vector<Source> sources;
  wire::PixelCommand whole_images{asked, asked.view.width, asked.view.height, {}};
  for (const CameraIndex camera : all) {
    sources.push_back({camera, &array_.rig().cameras[camera], image.view()});
    whole_images.regions.push_back({camera, {0, 0, ArrayFixture::kWidth, ArrayFixture::kHeight}});
  }
  const RequestPlan plan(array_.rig(), whole_images, all);
  ImageMemory scratch;
  const RenderOptions raw{.codec = CodecChoice::kRaw};
  const ByteBuffer pixels = RequestRenderer().render({&plan, answer_of(asked, all)}, sources, raw, scratch).bytes;
  const wire::AnyRequest command =
      CameraAccess::of(Access::kPixels)->command(array_.rig(), build_mesh(array_.rig()), asked);
  for (const bool with_rig : {true, false}) {
    nodes_.clear();
    with_rig ? start(1, {{"rig", array_.rig_path()}}) : start(1);
    request(asked);
    ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(wire::encode_any_request(command))), GST_FLOW_OK);
    push(0, std::vector<uint8_t>{pixels.begin(), pixels.end()});
    EXPECT_EQ(range(pull()), with_rig ? std::pair(200, 200) : std::pair(0, 0));
    EXPECT_EQ(stat(element_.get(), "bad-answers"), with_rig ? 0u : 1u);
    EXPECT_EQ(stat(element_.get(), "bad-requests"), 0u);
    EXPECT_EQ(stat(element_.get(), "missing-fragments"), 0u);
  }
}

TEST_F(LfCompositorTest, BackgroundShowsWhereNothingContributes) {
  start(1, {{"rig", array_.rig_path()}, {"background", "0xff102030"}});
  ask_and_answer(0, 0, {});
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(picture[0], 0x10);
  EXPECT_EQ(picture[1], 0x20);
  EXPECT_EQ(picture[2], 0x30);
}

TEST_F(LfCompositorTest, I420StaysI420AndSizeMayChange) {
  start(1);
  ViewRequest asked = array_.request(0, 0);
  asked.view.width = 15;
  asked.view.height = 11;
  request_and_answer(asked, {0, 1, 2, 3}, 90, PixelFamily::kI420);
  EXPECT_GE(pull()[0], 89);
  EXPECT_EQ(output_format(), "I420");
  ViewRequest larger = array_.request(1, kFrame);
  larger.view.width = 20;
  request_and_answer(larger, {0, 1, 2, 3});
  EXPECT_EQ(pull().size(), 20u * 12 * 3);
  EXPECT_EQ(output_format(), "RGB");
}

TEST_F(LfCompositorTest, DownstreamSelectsAFormatOfTheFamily) {
  start(1, {}, "video/x-raw,format=BGRx");
  ask_and_answer(0, 0, {0, 1, 2, 3});
  EXPECT_EQ(pull().size(), 16u * 12 * 4);
}

const GstStructure* structure_in(const GstStructure* structure, const char* field) {
  const GValue* value = gst_structure_get_value(structure, field);
  return value && GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : nullptr;
}

TEST_F(LfCompositorTest, PicturesCarryTheFocalSurfaceOfTheirRequest) {
  start(1);
  for (uint32_t i = 0; i < 3; i++) {
    ViewRequest asked = array_.request(i, i * kFrame);
    FocalMap map = *flat_surface(asked.view);
    for (size_t k = 0; k < map.levels.size(); k++) map.levels[k] = static_cast<uint8_t>(50 + 10 * i + k);
    asked.view.focus.map = std::make_shared<FocalMap>(map);
    asked.on_plane = i == 2;
    request_and_answer(asked, {0, 1, 2, 3});
    const BufferPtr picture(gst_harness_pull(harness_.get()));
    ASSERT_TRUE(picture);
    GstCustomMeta* meta = gst_buffer_get_custom_meta(picture.get(), "lightfield-view");
    ASSERT_TRUE(meta);
    const GstStructure* focus = structure_in(gst_custom_meta_get_structure(meta), "focus");
    ASSERT_TRUE(focus);
    const GstStructure* shown = structure_in(focus, "map");
    if (asked.on_plane) {
      EXPECT_FALSE(shown) << "the picture shows a plane";
      continue;
    }
    ASSERT_TRUE(shown);
    int step = 0, columns = 0, rows = 0;
    double farthest = 0, nearest = 0;
    GBytes* levels = nullptr;
    ASSERT_TRUE(gst_structure_get(shown, "step", G_TYPE_INT, &step, "columns", G_TYPE_INT, &columns, "rows", G_TYPE_INT,
                                  &rows, "inverse-farthest", G_TYPE_DOUBLE, &farthest, "inverse-nearest", G_TYPE_DOUBLE,
                                  &nearest, "levels", G_TYPE_BYTES, &levels, nullptr));
    EXPECT_EQ(std::tuple(step, columns, rows), std::tuple(map.step, map.columns, map.rows));
    EXPECT_EQ(std::pair(farthest, nearest), std::pair(map.farthest, map.nearest));
    gsize size = 0;
    const auto* bytes = static_cast<const uint8_t*>(g_bytes_get_data(levels, &size));
    EXPECT_EQ(std::vector<uint8_t>(bytes, bytes + size), map.levels);
    g_bytes_unref(levels);
  }
}

TEST_F(LfCompositorTest, EndOfRequestsEndsTheOutput) {
  start(1);
  ask_and_answer(0, 0, {0, 1, 2, 3});
  pull();
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  EXPECT_TRUE(reaches_eos(harness_.get()));
}

TEST_F(LfCompositorTest, NavigationIsSentToTheRequestsWithTheViewId) {
  start(1, {{"view-id", "6"}});
  gst_harness_push_upstream_event(harness_.get(),
                                  gst_navigation_event_new_mouse_move(1, 2, GST_NAVIGATION_MODIFIER_NONE));
  EventPtr event;
  for (int i = 0; i < 10; i++) {
    event.reset(gst_harness_try_pull_upstream_event(harness_.get()));
    if (!event || GST_EVENT_TYPE(event.get()) == GST_EVENT_NAVIGATION) break;
  }
  ASSERT_TRUE(event);
  guint view = 0;
  EXPECT_TRUE(gst_structure_get_uint(gst_event_get_structure(event.get()), "lightfield-view-id", &view));
  EXPECT_EQ(view, 6u);
  while (const EventPtr other{gst_harness_try_pull_upstream_event(nodes_[0].get())})
    EXPECT_NE(GST_EVENT_TYPE(other.get()), GST_EVENT_NAVIGATION);
}

TEST_F(LfCompositorTest, ErrorsNameThePlace) {
  start(1, {}, "video/x-raw,format=I420");
  const ViewRequest asked = array_.request(0, 0);
  const ElementBus bus(element_.get());
  request_and_answer(asked, {0, 1, 2, 3});
  const MessagePtr message(gst_bus_timed_pop_filtered(bus.get(), 5 * GST_SECOND, GST_MESSAGE_ERROR));
  ASSERT_TRUE(message);
  EXPECT_THAT(text_of(message.get()), HasSubstr("videoconvert"));
  EXPECT_THAT(run("lfcompositor rig=/nowhere/rig.json ! fakesink", 5), HasSubstr("/nowhere/rig.json"));
}

class LfCompositorTreeTest : public LfCompositorTest {
 protected:
  std::vector<uint8_t> rack(const ViewRequest& asked, const std::vector<wire::Answer>& answers,
                            const std::string& codec = "raw16", guint node = 0) {
    start(static_cast<int>(answers.size()),
          {{"partial", "true"}, {"rig", array_.rig_path()}, {"codec", codec}, {"node", std::to_string(node)}});
    request(asked);
    for (size_t i = 0; i < answers.size(); i++) push(static_cast<int>(i), answers[i]);
    return pull();
  }

  std::vector<uint8_t> root(const ViewRequest& asked, const std::vector<std::vector<uint8_t>>& answers) {
    start(static_cast<int>(answers.size()), {{"rig", array_.rig_path()}});
    request(asked);
    for (size_t i = 0; i < answers.size(); i++) push(i, answers[i]);
    std::vector<uint8_t> picture = pull();
    missing_ = stat(element_.get(), "missing-fragments");
    return picture;
  }

  guint64 missing_ = 0;
};

TEST_F(LfCompositorTreeTest, PictureEqualsThatOfOneCompositor) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const ViewRequest asked = array_.request(5, kFrame);
    std::vector<std::vector<uint8_t>> single;
    std::vector<wire::Answer> answers;
    for (CameraIndex camera = 0; camera < 4; camera++) {
      answers.push_back(answer_of(asked, {camera}, static_cast<uint8_t>(60 + 40 * camera), family));
      single.push_back(wire::encode_answer(answers.back()));
    }
    const std::vector<uint8_t> expected = root(asked, single);
    for (const char* codec : {"raw16", "raw"}) {
      const std::vector<uint8_t> picture = root(
          asked, {rack(asked, {answers[0], answers[1]}, codec, 1), rack(asked, {answers[2], answers[3]}, codec, 2)});
      EXPECT_EQ(missing_, 0u);
      ASSERT_EQ(picture.size(), expected.size());
      // Rounding to 8 bits per value affects each rack's sum.
      for (size_t i = 0; i < picture.size(); i++)
        ASSERT_NEAR(picture[i], expected[i], std::string(codec) == "raw16" ? 0 : 1) << codec << " " << i;
    }
  }
}

TEST_F(LfCompositorTreeTest, PartialAnswerCoversItsCameras) {
  const ViewRequest asked = array_.request(5, kFrame);
  wire::Answer first = answer_of(asked, {0}), second = answer_of(asked, {});
  first.actual_time -= 3000;
  second.cameras = second.blind = CameraRanges(CameraSet{2});
  second.family = PixelFamily::kNone;
  const std::vector<uint8_t> bytes = rack(asked, {first, second}, "raw16", 9);
  const wire::AnswerView view = wire::parse_answer(bytes).value();
  EXPECT_EQ(view.node, 9u);
  EXPECT_EQ(view.sequence, 5u);
  EXPECT_EQ(view.rig_hash, array_.rig().hash());
  EXPECT_EQ(view.actual_time, kFrame - 3000);
  EXPECT_EQ(view.cameras, CameraRanges(CameraSet{0, 2}));
  EXPECT_EQ(view.blind, CameraRanges(CameraSet{2}));
}

TEST_F(LfCompositorTreeTest, MissingCamerasOfARackAreMissingAtTheRoot) {
  const ViewRequest asked = array_.request(5, kFrame);
  wire::Answer blind = answer_of(asked, {});
  blind.cameras = blind.blind = CameraRanges(CameraSet{1});
  const std::vector<uint8_t> picture =
      root(asked, {rack(asked, {answer_of(asked, {0}), blind}), wire::encode_answer(answer_of(asked, {2, 3}))});
  EXPECT_NEAR(picture[(6 * 16 + 8) * 3], 200, 6);
}

TEST_F(LfCompositorTreeTest, NeedsTheRig) {
  EXPECT_THAT(run("lfcompositor partial=true ! fakesink", 5), mentions("property", "\"rig\""));
}

TEST(LfCompositorSettings, IgnoredSettingsAreReported) {
  const ArrayFixture array;
  const std::string rig = "rig=" + array.rig_path();
  struct Case {
    std::string properties, words;
  };
  for (const Case& c : {Case{"", ""}, Case{rig + " monitor-interval=8 gains=on focus-near=1 focus-far=2", ""},
                        Case{rig + " partial=true node=7 codec=jpeg", ""}, Case{rig + " node=7", "node and codec: "},
                        Case{rig + " codec=jpeg", "node and codec: "},
                        Case{rig + " focus=plane focus-far=3", "focus-near and focus-far: "},
                        Case{rig + " partial=true focus=surface", "focus: inside a tree"},
                        Case{"monitor-interval=8", "monitor-interval: "}, Case{"gains=on", "gains: "},
                        Case{"show=coverage", "show: only"}, Case{rig + " show=coverage", ""},
                        Case{rig + " gains=on focus=plane node=1 focus-near=2 focus-far=1", "nearer"}}) {
    const PipelinePtr pipeline = launch("lfcompositor " + c.properties + " ! fakesink async=false");
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    const std::string told = warnings_of(pipeline.get());
    EXPECT_THAT(told, HasSubstr(c.words)) << c.properties;
    EXPECT_EQ(told.empty(), c.words.empty()) << c.properties << ": " << told;
  }
}

// Malformed photo-consistency sums are counted and dropped; the picture is unaffected.
class LfCompositorHypothesesTest : public LfCompositorTest {
 protected:
  LfCompositorHypothesesTest() : asked_(array_.request(0, 0)) {
    asked_.view.focus.map = flat_surface(asked_.view);
    asked_.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 200}};
    start(1, {{"rig", array_.rig_path()}, {"focus", "surface"}, {"focus-near", "3"}, {"focus-far", "20"}});
  }

  std::vector<PhotoConsistency> seen() const {
    const RenderJob job(array_.rig(), build_mesh(array_.rig()), hypothesis_view(asked_.view), {{0}});
    Image grey(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
    std::ranges::fill(grey.data(), uint8_t{200});
    const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(asked_.view, asked_.hypotheses);
    std::vector<PhotoConsistency> sums(levels.size());
    for (PhotoConsistency& sum : sums) sum.reset(asked_.view.focus.map->columns, asked_.view.focus.map->rows);
    add_consistency(job, {{Source{0, &array_.rig().cameras[0], grey.view()}}}, levels, sums);
    return sums;
  }
  std::vector<uint8_t> unit(const std::vector<PhotoConsistency>& sums, bool small = true) const {
    return unit(sums, header(), small);
  }
  std::vector<uint8_t> unit(const std::vector<PhotoConsistency>& sums, const wire::ConsistencyHeader& header,
                            bool small = true) const {
    const ByteBuffer bytes = wire::encode_consistency(header, sums, small);
    return {bytes.begin(), bytes.end()};
  }
  wire::ConsistencyHeader header() const { return {asked_.view_id, asked_.sequence, array_.rig().hash(), 0, {}}; }

  // Returns the picture of an answer that follows `unit`, and how many bad units were counted.
  std::pair<std::vector<uint8_t>, uint64_t> picture_after(const std::vector<uint8_t>& unit) {
    const uint64_t before = stat(element_.get(), "bad-answers");
    request(asked_);
    push(0, unit);
    push(0, answer_of(asked_, {0, 1, 2, 3}));
    const std::vector<uint8_t> picture = pull();
    asked_.sequence++;
    asked_.target_time += kFrame;
    return {picture, stat(element_.get(), "bad-answers") - before};
  }

  ViewRequest asked_;
};

// If no element uses the focal surface, the search runs only occasionally.
TEST_F(LfCompositorHypothesesTest, FeedbackIsRareIfUnused) {
  static int told = 0;
  static bool heeds = false;
  asked_.view.focus.map.reset();
  asked_.hypotheses.clear();
  for (const bool heeded : {false, true}) {
    told = 0;
    heeds = heeded;
    gst_pad_set_event_function(
        harness_->srcpad, +[](GstPad*, GstObject*, GstEvent* event) -> gboolean {
          told += gst_event_has_name(event, "lightfield-feedback");
          gst_event_unref(event);
          return heeds;
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

TEST_F(LfCompositorHypothesesTest, UnexpectedUnitsAreCountedAndDropped) {
  const auto [picture, bad] = picture_after(unit(seen()));
  ASSERT_EQ(picture.size(), 16u * 12 * 3);
  EXPECT_EQ(bad, 0u);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_EQ(picture_after(unit(seen(), false)), std::pair(picture, uint64_t{0})) << "in the other form";
  const auto expect_dropped = [&, &expected = picture](const std::vector<uint8_t>& bad_unit, const char* what) {
    const auto [after, dropped] = picture_after(bad_unit);
    EXPECT_EQ(after, expected) << what;
    EXPECT_EQ(dropped, 1u) << what;
  };
  PhotoConsistency wide;
  wide.reset(seen()[0].columns + 1, seen()[0].rows);
  expect_dropped(unit({wide, wide}), "of another size");
  expect_dropped(unit({seen()[0]}), "one hypothesis too few");
  wire::ConsistencyHeader other = header();
  other.rig_hash ^= 1;
  expect_dropped(unit(seen(), other), "of another rig");
  // Returns the unit with another size; new bytes are 0.
  const auto resized = [&](auto size_of) {
    std::vector<uint8_t> bytes = unit(seen());
    bytes.resize(size_of(bytes.size()));
    return bytes;
  };
  expect_dropped(resized([](size_t size) { return size - 5; }), "cut off");
  expect_dropped(resized([](size_t) { return 20; }), "a header and no more");
  expect_dropped(resized([](size_t size) { return size + 1; }), "bytes too many");
  std::vector<uint8_t> noise = unit(seen());
  std::mt19937 random(1);
  for (size_t i = 46; i < noise.size(); i++) noise[i] = static_cast<uint8_t>(random());
  expect_dropped(noise, "of bytes that do not inflate");
}

TEST_F(LfCompositorHypothesesTest, ReversedFocusRangeIsIgnoredAndReported) {
  const ElementBus bus(element_.get());
  const auto set = [&](const char* name, double metres) { g_object_set(element_.get(), name, metres, nullptr); };
  set("focus-far", 2);
  EXPECT_THAT(bus.warnings(), mentions("focus-near", "3 m", "focus-far", "2 m"));
  g_object_set(element_.get(), "post-messages", TRUE, nullptr);
  EXPECT_EQ(bus.warnings(), "") << "warns once";
  set("focus-near", 1);
  EXPECT_EQ(bus.warnings(), "");
}

TEST_F(LfCompositorHypothesesTest, UnitsWithoutHypothesesAreDropped) {
  const std::vector<uint8_t> unasked = unit(seen());
  asked_.hypotheses.clear();
  const auto [picture, bad] = picture_after(unasked);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_EQ(bad, 1u);
}

}  // namespace
}  // namespace lf::test
