// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/base/gsttypefindhelper.h>

#include "gst/gst_test.h"
#include "support/answers.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

namespace lf::test {
namespace lfparse_test {

// Prints a short description instead of all bytes when a test fails.
struct Bytes : std::vector<uint8_t> {
  using vector::vector;
  Bytes(vector bytes) : vector(std::move(bytes)) {}
};
void PrintTo(const Bytes& bytes, std::ostream* out) {
  const std::optional<wire::UnitHeader> header = wire::peek_unit(bytes);
  *out << (!header ? "no unit" : header->kind == wire::UnitKind::kRequest ? "request" : "answer");
  if (bytes.size() >= 20) *out << " " << int{bytes[19]};  // the sequence number
  *out << " of " << bytes.size() << " bytes";
}
using Units = std::vector<Bytes>;

Bytes request(uint32_t sequence, uint64_t target_time = kNoTime, bool absolute = false) {
  ViewRequest r;
  r.sequence = sequence;
  r.target_time = target_time;
  r.absolute_time = absolute;
  r.view.width = r.view.height = 64;
  return wire::encode_request(r);
}

Bytes answer(uint32_t sequence, int size = 4) {
  wire::Answer a;
  a.sequence = sequence;
  a.view_width = a.view_height = size;
  a.family = PixelFamily::kRgb;
  const Rect whole{0, 0, size, size};
  a.fragments.push_back({a.family, whole, Bytes(packed_size(a.family, size, size), 0x11), {}});
  return wire::encode_answer(a);
}

Bytes join(const Units& parts) {
  Bytes out;
  for (const Bytes& part : parts) out.insert(out.end(), part.begin(), part.end());
  return out;
}

class Parser {
 public:
  explicit Parser(const char* sink_caps = nullptr) : harness_(gst_harness_new("lfparse")) {
    if (sink_caps) {
      gst_harness_set_src_caps_str(h(), sink_caps);
    } else {
      gst_harness_push_event(h(), gst_event_new_stream_start("test"));
      GstSegment segment;
      gst_segment_init(&segment, GST_FORMAT_BYTES);
      gst_harness_push_event(h(), gst_event_new_segment(&segment));
    }
  }

  GstHarness* h() { return harness_.get(); }
  void push(const Bytes& bytes, GstClockTime time = GST_CLOCK_TIME_NONE) {
    GstBuffer* buffer = to_buffer(bytes);
    GST_BUFFER_PTS(buffer) = time;
    ASSERT_EQ(gst_harness_push(h(), buffer), GST_FLOW_OK);
  }
  void push_in_chunks(const Bytes& bytes, size_t size) {
    for (size_t i = 0; i < bytes.size(); i += size)
      push({bytes.begin() + i, bytes.begin() + std::min(bytes.size(), i + size)});
  }
  void end() { gst_harness_push_event(h(), gst_event_new_eos()); }
  Units take() {
    Units units;
    while (const BufferPtr buffer{gst_harness_try_pull(h())}) {
      units.push_back(to_bytes(buffer.get()));
      times.push_back(GST_BUFFER_PTS(buffer.get()));
    }
    return units;
  }
  std::string caps() { return caps_of(h()->sinkpad); }
  uint64_t stat(const char* field) { return lf::test::stat(h()->element, field); }

  std::vector<GstClockTime> times;

 private:
  HarnessPtr harness_;
};

// Caps state whether buffers hold whole units: unparsed bytes do not link to elements that need units.
TEST(LfParse, UnparsedBytesLinkOnlyToLfparse) {
  for (const char* kind : {"request", "answer"}) {
    const std::string caps = std::string("application/x-lightfield-") + kind;
    const CapsPtr unparsed(gst_caps_from_string((caps + ",parsed=false").c_str()));
    const CapsPtr unsaid(gst_caps_from_string(caps.c_str()));
    for (const char* name : {"lfcompositor", "lffragment", "rtplfpay", "lfviewrequest", "lfparse"}) {
      const ElementPtr element = make_element(name);
      const bool takes_all = std::string(name) == "lfparse";
      const bool of_pad = takes_all || std::string(name) == "rtplfpay";
      const char* pad_name = of_pad || std::string(name) == "lfviewrequest"                         ? "sink"
                             : std::string(kind) == "answer" && std::string(name) == "lfcompositor" ? "sink_0"
                                                                                                    : "request";
      if (std::string(kind) == "answer" && (pad_name == std::string("request") || name == std::string("lfviewrequest")))
        continue;
      PadPtr pad = pad_of(element.get(), pad_name);
      if (!pad) pad.reset(gst_element_request_pad_simple(element.get(), pad_name));
      ASSERT_TRUE(pad) << name;
      EXPECT_EQ(gst_pad_query_accept_caps(pad.get(), unparsed.get()), takes_all) << name << " " << kind;
      EXPECT_TRUE(gst_pad_query_accept_caps(pad.get(), unsaid.get())) << name << " " << kind;
    }
  }
}

TEST(LfParse, FramesChunksOfAnySize) {
  for (const bool requests : {true, false}) {
    Units units;
    for (int i = 0; i < 7; i++) units.push_back(requests ? request(i) : answer(i, 1 + 3 * i));
    for (const size_t chunk : {1, 2, 11, 12, 13, 100, 1000, 100000}) {
      Parser parser;
      parser.push_in_chunks(join(units), chunk);
      parser.end();
      EXPECT_EQ(parser.take(), units) << chunk;
      EXPECT_EQ(parser.caps(), requests
                                   ? "application/x-lightfield-request, framerate=(fraction)0/1, parsed=(boolean)true"
                                   : "application/x-lightfield-answer, parsed=(boolean)true");
      EXPECT_EQ(parser.stat("units"), 7u);
      EXPECT_EQ(parser.stat("skipped-bytes"), 0u);
      EXPECT_EQ(parser.stat("gaps"), 0u);
    }
  }
}

TEST(LfParse, OutputsAUnitAsSoonAsItIsComplete) {
  Parser parser;
  const Bytes unit = answer(1);
  parser.push({unit.begin(), unit.end() - 1});
  EXPECT_TRUE(parser.take().empty());
  parser.push({unit.back()});
  EXPECT_EQ(parser.take(), Units{unit});
}

TEST(LfParse, SkipsGarbageBetweenUnits) {
  // The garbage contains apparent unit starts: parts of the magic, and a magic with an impossible header.
  const Bytes plain(1000, 'x'), part = {0x8f, 'L', 0x8f, 0x8f, 'L', 'F'};
  const Bytes header = {0x8f, 'L', 'F', 'A', 0, 1, 0, 0, 0, 0, 0, 80, 5, 5};
  for (const size_t chunk : {1, 5, 64, 100000}) {
    Parser parser;
    parser.push_in_chunks(join({plain, answer(1), part, answer(2), answer(3), header, answer(4), plain}), chunk);
    parser.end();
    EXPECT_EQ(parser.take(), (Units{answer(1), answer(2), answer(3), answer(4)})) << chunk;
    EXPECT_EQ(parser.stat("units"), 4u);
    EXPECT_EQ(parser.stat("skipped-bytes"), 2 * plain.size() + part.size() + header.size()) << chunk;
    EXPECT_EQ(parser.stat("gaps"), 4u) << chunk;
  }
}

TEST(LfParse, DropsATruncatedTail) {
  const Bytes tail = answer(3);
  for (const size_t left : {size_t{1}, size_t{11}, size_t{12}, size_t{60}, tail.size() - 1}) {
    Parser parser;
    parser.push(join({answer(1), answer(2), {tail.begin(), tail.begin() + left}}));
    parser.end();
    EXPECT_EQ(parser.take(), (Units{answer(1), answer(2)})) << left;
    EXPECT_EQ(parser.stat("skipped-bytes"), left);
  }
}

TEST(LfParse, OutputsOneKindOfUnit) {
  const Bytes mixed = join({request(1), answer(2), request(3), answer(4), request(5)});
  Parser first;
  first.push(mixed);
  first.end();
  EXPECT_EQ(first.take(), (Units{request(1), request(3), request(5)}));
  EXPECT_EQ(first.stat("gaps"), 2u);
  EXPECT_EQ(first.stat("skipped-bytes"), 2 * answer(2).size());
  Parser told("application/x-lightfield-answer");
  told.push(mixed);
  told.end();
  EXPECT_EQ(told.take(), (Units{answer(2), answer(4)}));
}

TEST(LfParse, PassesUnitsOfFutureVersions) {
  Bytes unit = answer(1);
  unit[4] = 9;
  Parser parser;
  parser.push(unit);
  EXPECT_EQ(parser.take(), Units{unit});
}

TEST(LfParse, HugeLengthsDoNotStopTheStream) {
  const auto with_length = [](Bytes unit, uint32_t length) {
    for (int i = 0; i < 4; i++) unit[8 + i] = static_cast<uint8_t>(length >> (24 - 8 * i));
    return unit;
  };
  Parser impossible;  // above the format's limit: skipped immediately
  impossible.push(join({with_length(answer(1), 0xffffffff), answer(2)}));
  EXPECT_EQ(impossible.take(), Units{answer(2)});

  Parser limited;
  g_object_set(limited.h()->element, "max-size-bytes", 5000, nullptr);
  limited.push(join({with_length(answer(1), 5001), answer(2), answer(3, 50)}));
  limited.push(answer(4));
  EXPECT_EQ(limited.take(), (Units{answer(2), answer(4)}));

  Parser plausible;  // waits for the rest, and searches inside if it never arrives
  plausible.push(join({with_length(answer(1), 50'000'000), answer(2), answer(3)}));
  EXPECT_TRUE(plausible.take().empty());
  plausible.end();
  EXPECT_EQ(plausible.take(), (Units{answer(2), answer(3)}));
}

TEST(LfParse, TimeStampsPassThrough) {
  Parser parser("application/x-lightfield-answer");
  for (int i = 0; i < 4; i++) parser.push(answer(i), i == 2 ? GST_CLOCK_TIME_NONE : (1 + i) * GST_SECOND);
  EXPECT_EQ(parser.take().size(), 4u);
  EXPECT_EQ(parser.times, (std::vector<GstClockTime>{GST_SECOND, 2 * GST_SECOND, GST_CLOCK_TIME_NONE, 4 * GST_SECOND}));
}

TEST(LfParse, RequestsWithoutTimestampGetTheirTargetTime) {
  Parser parser;
  parser.push(join({request(1, 40), request(2, 80), request(3, kNoTime), request(4, 70, true), request(5, 90)}));
  parser.push(request(6, 100), 7);
  parser.end();
  EXPECT_EQ(parser.take().size(), 6u);
  EXPECT_EQ(parser.times, (std::vector<GstClockTime>{40, 80, GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE, 90, 7}));
}

TEST(LfParse, CapsPassThrough) {
  Parser parser("application/x-lightfield-request, framerate=(fraction)25/1, parsed=(boolean)true");
  parser.push(request(1));
  EXPECT_EQ(parser.caps(), "application/x-lightfield-request, framerate=(fraction)25/1, parsed=(boolean)true");
  EXPECT_EQ(parser.take().size(), 1u);
}

TEST(LfParse, SurvivesRandomDamage) {
  std::mt19937 random(5);
  for (int round = 0; round < 60; round++) {
    Units units;
    for (int i = 0; i < 6; i++) units.push_back(random() % 2 ? answer(i, 1 + random() % 12) : request(i));
    Bytes bytes = join(units);
    for (int i = 0; i < 8; i++) bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1 << random() % 8);
    Parser parser("application/x-lightfield-answer");
    parser.push_in_chunks(bytes, 1 + random() % 300);
    parser.end();
    size_t size = 0;
    for (const Bytes& unit : parser.take()) {
      const std::optional<wire::UnitHeader> header = wire::peek_unit(unit);
      ASSERT_TRUE(header.has_value());
      EXPECT_EQ(header->size, unit.size());
      size += unit.size();
    }
    EXPECT_EQ(size + parser.stat("skipped-bytes"), bytes.size());
  }
}

TEST(LfParse, OnlyGarbageIsAnError) {
  const TempFile file(Bytes(5000, 'x'));
  EXPECT_NE(run("filesrc location=" + file.path() + " ! lfparse ! fakesink"), "");
}

Units units_of(const std::string& line) {
  Units units;
  const PipelinePtr pipeline = launch(line + " ! fakesink name=sink");
  on_buffers(child_of(pipeline.get(), "sink").get(), "sink", [&](GstBuffer* b) { units.push_back(to_bytes(b)); });
  EXPECT_EQ(run(pipeline.get()), "") << line;
  return units;
}

TEST(LfParse, ReadsFiles) {
  Units requests, answers;
  for (int i = 0; i < 50; i++) {
    requests.push_back(request(i));
    answers.push_back(answer(i, 1 + 2 * i));
  }
  for (const Units& units : {requests, answers, Units{request(7)}, Units{answer(7, 300)}}) {
    const TempFile file(join(units));
    const std::string source = "filesrc location=" + file.path();
    EXPECT_EQ(units_of(source + " ! lfparse"), units);
    EXPECT_EQ(units_of(source + " ! typefind ! lfparse"), units);
    EXPECT_EQ(units_of(source + " blocksize=100 ! queue ! lfparse"), units);
    EXPECT_EQ(units_of(source + " ! decodebin caps=application/x-lightfield-request;application/x-lightfield-answer "
                                "! lfparse"),
              units);
  }
}

TEST(LfParse, RecoversInsideAFile) {
  Bytes wrong_length = answer(2);
  wrong_length[9] = 0x70;
  const TempFile file(join({Bytes(77, 'x'), answer(1), Bytes(70000, 'y'), wrong_length, answer(3), Bytes(5, 'z')}));
  EXPECT_EQ(units_of("filesrc location=" + file.path() + " ! lfparse"), (Units{answer(1), answer(3)}));
}

TEST(LfTypeFind, DistinguishesRequestsAndAnswers) {
  using Found = std::pair<std::string, int>;
  const auto type_of = [](const Bytes& bytes) -> Found {
    GstTypeFindProbability probability;
    const CapsPtr caps(gst_type_find_helper_for_data(nullptr, bytes.data(), bytes.size(), &probability));
    if (!caps) return {"none", 0};
    return {gst_structure_get_name(gst_caps_get_structure(caps.get(), 0)), probability};
  };
  EXPECT_EQ(type_of(join({request(1), request(2)})), Found("application/x-lightfield-request", GST_TYPE_FIND_MAXIMUM));
  EXPECT_EQ(type_of(join({answer(1), answer(2)})), Found("application/x-lightfield-answer", GST_TYPE_FIND_MAXIMUM));
  // Too short to contain a second unit.
  Bytes cut = answer(1, 100);
  cut.resize(4096);
  EXPECT_EQ(type_of(cut), Found("application/x-lightfield-answer", GST_TYPE_FIND_LIKELY));
  cut[2] = 'x';
  EXPECT_THAT(type_of(cut).first, Not(HasSubstr("lightfield")));
}

TEST(LfTypeFind, FindsRigsWithTheFormatAnywhere) {
  const auto type_of = [](const std::string& text) -> std::string {
    const CapsPtr caps(
        gst_type_find_helper_for_data(nullptr, reinterpret_cast<const guint8*>(text.data()), text.size(), nullptr));
    return caps ? gst_structure_get_name(gst_caps_get_structure(caps.get(), 0)) : "none";
  };
  const std::string rig = "application/x-lightfield-rig", name = "\"format\": \"lightfield-rig\"";
  EXPECT_EQ(type_of("{" + name + ", \"version\": 1, \"cameras\": []}"), rig);
  EXPECT_EQ(type_of("\n { \"format\"\t:\n\"lightfield-rig\" }"), rig);
  EXPECT_EQ(type_of("{\"cameras\": [\"" + std::string(200000, 'x') + "\"], " + name + "}"), rig);
  EXPECT_NE(type_of("{\"format\": \"lightfield-views\", \"version\": 1, \"views\": []}"), rig);
  EXPECT_NE(type_of("A text of \"format\": \"lightfield-rig\" that is no object."), rig);
  EXPECT_NE(type_of("{\"format\""), rig);
}

}  // namespace lfparse_test
}  // namespace lf::test
