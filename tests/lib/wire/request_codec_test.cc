// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/request_codec.h"
#include "focus/hypothesis_levels.h"

#include "base/text.h"
#include "lib/wire/wire_test.h"
#include "support/rigs.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

// Written from spec.md, not by the encoder.
const char kGolden[] =
    "8f4c465101010001000000ac0000000701020304000000003b9aca001122334455667788028001e0000100003ff00000"
    "00000000c0000000000000003fe00000000000003ff00000000000000000000000000000000000000000000000000000"
    "00000000407f400000000000407f5000000000004073f80000000000406df00000000000000000000000000000000000"
    "00000000bff000000000000040040000000000000000000200030102";

ViewRequest golden_request() {
  ViewRequest r;
  r.view_id = 7;
  r.sequence = 0x01020304;
  r.target_time = 1'000'000'000;
  r.absolute_time = true;
  r.rig_hash = 0x1122334455667788;
  r.view.width = 640;
  r.view.height = 480;
  r.view.lens = Lens(LensModel::kPinhole, {500, 501, 319.5, 239.5});
  r.view.pose.position = {1, -2, 0.5};
  r.view.focus.plane = {{0, 0, -1}, 2.5};
  r.out_of_service = {3, 258};
  return r;
}

ViewRequest random_request(std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  ViewRequest r;
  r.view_id = random();
  r.sequence = random();
  r.target_time = random() % 3 ? (uint64_t{random()} << 32) | random() : kNoTime;
  r.absolute_time = random() % 2;
  r.probe = random() % 2;
  r.view.blending.extrapolates = !r.probe;
  r.warmup = random() % 2;
  r.quality = random() % 101;
  r.rig_hash = (uint64_t{random()} << 32) | random();
  r.view.width = 1 + random() % kMaxViewSize;
  r.view.height = 1 + random() % kMaxViewSize;
  std::array<double, Lens::kMaxParams> params;
  for (double& p : params) p = 1000 * number(random);
  params[0] = std::abs(params[0]) + 1;
  params[1] = std::abs(params[1]) + 1;
  r.view.lens = Lens(*lens_model_from_code(random() % 10), params);
  r.view.pose.position = {1e6 * number(random), number(random), 1e-6 * number(random)};
  r.view.pose.orientation =
      glm::normalize(Quat(number(random), number(random), number(random), number(random) + 1.001));
  r.view.focus.plane = {glm::normalize(Vec3(number(random), number(random), number(random) + 1.001)), number(random)};
  for (CameraIndex camera = random() % 4; camera < 1000 && random() % 8; camera += 1 + random() % 300)
    r.out_of_service.push_back(camera);
  return r;
}

constexpr DepthHypothesis::Kind kKinds[] = {DepthHypothesis::Kind::kBlurred, DepthHypothesis::Kind::kFarther,
                                            DepthHypothesis::Kind::kNearer,  DepthHypothesis::Kind::kShifted,
                                            DepthHypothesis::Kind::kPlane,   DepthHypothesis::Kind::kFocused};

ViewRequest focused_request(std::mt19937& random) {
  ViewRequest r = random_request(random);
  r.view.width = 1 + static_cast<int>(random() % 300);
  r.view.height = 1 + static_cast<int>(random() % 300);
  FocalMap map;
  map.step = 1 + static_cast<int>(random() % 9);
  map.columns = FocalMap::nodes(r.view.width, map.step);
  map.rows = FocalMap::nodes(r.view.height, map.step);
  map.from = {{0, 0.6, -0.8}, 3.25};
  map.farthest = 0.125;
  map.nearest = 4;
  map.measured = map.step % 2 == 0;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(random() % 5 * 50));
  r.view.focus.map = std::make_shared<FocalMap>(map);
  for (size_t i = random() % (kMaxHypotheses + 1); i > 0; i--)
    r.hypotheses.push_back({kKinds[random() % std::size(kKinds)], static_cast<int16_t>(random())});
  r.on_plane = random() % 2;
  r.gains.use = random() % 2;
  r.gains.ask = random() % 2;
  if (random() % 2) {
    r.gains.mean_of = static_cast<uint32_t>(random());
    r.gains.mean.resize(static_cast<size_t>(FocalMap::nodes(map.columns, 2)) * FocalMap::nodes(map.rows, 2));
    for (uint8_t& level : r.gains.mean) level = static_cast<uint8_t>(random() % 5 * 50);
  }
  return r;
}

constexpr auto reason_of = refusal<decode_request>;

// Returns the encoded request.
std::vector<uint8_t> expect_round_trip(const ViewRequest& request) {
  const std::vector<uint8_t> bytes = encode_request(request);
  std::string reason;
  EXPECT_EQ(decode_request(bytes, &reason), request) << reason;
  return bytes;
}

TEST(RequestCodec, GoldenBytes) { EXPECT_EQ(expect_round_trip(golden_request()), from_hex(kGolden)); }

TEST(RequestCodec, PositionInASetIsEncodedAtTheEnd) {
  ViewRequest request = golden_request();
  request.place = {ViewSetLayout::kQuilt, 8, 6, 47};
  std::vector<uint8_t> wanted = from_hex(kGolden);
  wanted[7] = 9;
  wanted[11] = static_cast<uint8_t>(wanted[11] + 4);
  for (const uint8_t byte : {5, 8, 6, 47}) wanted.push_back(byte);
  EXPECT_EQ(expect_round_trip(request), wanted);
  EXPECT_EQ(peek_request_cost(wanted), (RequestCost{.width = 640, .height = 480, .columns = 8, .rows = 6}));
  request.view.blending = make_blending(0.25, 0);
  EXPECT_EQ(peek_request_cost(expect_round_trip(request)),
            (RequestCost{.width = 640, .height = 480, .aperture = 0.25, .columns = 8, .rows = 6}));

  const auto with_end = [&](std::initializer_list<uint8_t> end) {
    std::vector<uint8_t> bytes = wanted;
    std::copy(end.begin(), end.end(), bytes.end() - 4);
    return reason_of(bytes);
  };
  EXPECT_THAT(with_end({5, 8, 6, 48}), mentions("set", "view 48"));
  EXPECT_THAT(with_end({1, 8, 6, 0}), mentions("set", "layout 1", "8x6"));
  EXPECT_THAT(with_end({6, 1, 1, 0}), HasSubstr("set: layout 6"));
  EXPECT_THAT(with_end({0, 1, 1, 0}), mentions("set", "two views"));
  EXPECT_THAT(with_end({5, 16, 9, 0}), mentions("set", "16x9", "128"));
  EXPECT_THAT(with_end({5, 40, 3, 0}), HasSubstr("16384"));
  wanted[7] = 1;
  EXPECT_THAT(reason_of(wanted), HasSubstr("bytes left"));
}

TEST(RequestCodec, SetsRoundTripWithAndWithoutMaps) {
  std::mt19937 random(5);
  for (int i = 0; i < 200; i++) {
    ViewRequest r = i % 2 ? focused_request(random) : random_request(random);
    const ViewSet set{.layout = static_cast<ViewSetLayout>(1 + random() % 5), .columns = 8, .rows = 2};
    r.place = set.place(static_cast<int>(random() % static_cast<unsigned>(set.place(0).count())));
    r.view.width = 2 + 2 * static_cast<int>(random() % 500);
    r.view.height = 2 + 2 * static_cast<int>(random() % 500);
    if (r.view.focus.map) {
      FocalMap map = *r.view.focus.map;
      map.columns = FocalMap::nodes(r.view.width, map.step);
      map.rows = FocalMap::nodes(r.view.height, map.step);
      map.levels.resize(static_cast<size_t>(map.columns) * map.rows, 7);
      r.view.focus.map = std::make_shared<FocalMap>(map);
      r.gains.mean.clear();
      r.gains.mean_of = 0;
    }
    const std::vector<uint8_t> bytes = expect_round_trip(r);
    EXPECT_EQ(peek_request_cost(bytes).columns, r.place.columns);
    EXPECT_EQ(peek_request_cost(bytes).rows, r.place.rows);
    EXPECT_FALSE(decode_request(std::span(bytes).first(bytes.size() - 1)));
  }
}

TEST(RequestCodec, FocalMapsRoundTrip) {
  std::mt19937 random(2);
  for (int i = 0; i < 200; i++) {
    const std::vector<uint8_t> bytes = expect_round_trip(focused_request(random));
    for (const size_t size : {bytes.size() - 1, bytes.size() / 2})
      EXPECT_FALSE(decode_request(std::span(bytes).first(size)).has_value());
  }
}

TEST(RequestCodec, MapsAreCompressedUnlessQualityIsZero) {
  ViewRequest request = golden_request();
  const auto map = test::level_surface(request.view.width, request.view.height, 0, 1, 77, {{0, 0, -1}, 2.5});
  request.view.focus.map = map;
  for (const uint8_t quality : {0, 1, 90}) {
    request.quality = quality;
    const std::vector<uint8_t> bytes = expect_round_trip(request);
    EXPECT_EQ(bytes.size() > map->levels.size(), quality == 0) << bytes.size() << " of quality " << int{quality};
  }
}

TEST(RequestCodec, InvalidFocalMapIsRefused) {
  std::mt19937 random(3);
  const ViewRequest good = focused_request(random);
  const auto with = [&](const std::function<void(ViewRequest&, FocalMap&)>& change) {
    ViewRequest bad = good;
    auto map = std::make_shared<FocalMap>(*good.view.focus.map);
    change(bad, *map);
    bad.view.focus.map = std::move(map);
    EXPECT_THROW(encode_request(bad), Error);
  };
  with([](ViewRequest&, FocalMap& map) { map.levels.pop_back(); });
  with([](ViewRequest&, FocalMap& map) { map.nearest = map.farthest; });
  with([](ViewRequest& r, FocalMap&) { r.hypotheses.resize(kMaxHypotheses + 1); });
  ViewRequest without = good;
  without.hypotheses.resize(1);
  without.view.focus.map = nullptr;
  EXPECT_THROW(encode_request(without), Error) << "hypotheses without a map";
  without.hypotheses.clear();
  without.gains = {.use = true, .ask = true};
  EXPECT_THROW(encode_request(without), Error) << "mean without a map";
  with([](ViewRequest& r, FocalMap&) { r.gains.mean.assign(7, 100); });
  std::vector<uint8_t> flags = encode_request(golden_request());
  for (const uint8_t unknown : {2, 4, 8}) {
    flags[43] = unknown;
    EXPECT_THAT(reason_of(flags), testing::StartsWith("gains: "));
  }
}

TEST(RequestCodec, MapForHypothesesOnlyRoundTrips) {
  std::mt19937 random(5);
  ViewRequest request = focused_request(random);
  request.on_plane = false;
  request.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kFocused, 0}};
  const std::vector<uint8_t> through = expect_round_trip(request);
  request.on_plane = true;
  std::vector<uint8_t> bytes = expect_round_trip(request);
  ASSERT_EQ(bytes.size(), through.size());
  for (size_t i = 0; i < bytes.size(); i++) EXPECT_EQ(bytes[i], through[i] | (i == 43 ? 8 : 0)) << i;
  EXPECT_EQ(displayed_view(request).focus.map, nullptr);

  ViewRequest without = golden_request();
  without.on_plane = true;
  EXPECT_THROW(encode_request(without), Error) << "without a map";
  request.view.focus.map = nullptr;
  EXPECT_THROW(encode_request(request), Error);
  for (const int kind : {7, 255}) {
    // The only hypothesis of kind 6 is followed by its value, 0.
    std::vector<uint8_t> unknown = bytes;
    const auto at = std::ranges::search(unknown, std::array<uint8_t, 7>{2, 0, 0, 0, 6, 0, 0});
    ASSERT_EQ(at.size(), 7u);
    at[4] = static_cast<uint8_t>(kind);
    EXPECT_MENTIONS(reason_of(unknown), "depth hypotheses", std::to_string(kind), "unknown");
  }
}

TEST(RequestCodec, TheMeasuredSurfaceIsTheLastHypothesis) {
  ViewRequest request = golden_request();
  request.view.focus.map = std::make_shared<FocalMap>(plane_map(request.view, request.view.focus.plane, 1, 0.1));
  request.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kMeasured, 0}};
  EXPECT_EQ(decode_request(encode_request(request)), request);
  std::ranges::reverse(request.hypotheses);
  EXPECT_THROW(encode_request(request), Error);
}

TEST(RequestCodec, RoundTrips) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; i++) expect_round_trip(random_request(random));
}

TEST(RequestCodec, BlendingRoundTripsAndIsChecked) {
  std::mt19937 random(4);
  for (const Blending blending : {Blending{Blending::Kind::kAperture, 0.25, 0}, Blending{Blending::Kind::kAngle, 0, 4}})
    for (int i = 0; i < 50; i++) {
      ViewRequest request = i % 2 ? focused_request(random) : random_request(random);
      const size_t before = encode_request(request).size();
      request.view.blending = blending;
      request.view.blending.extrapolates = !request.probe;
      const std::vector<uint8_t> bytes = expect_round_trip(request);
      EXPECT_EQ(bytes.size(), before + (blending.aperture > 0 ? 8 : 1));
      EXPECT_MENTIONS(reason_of(resized(bytes, bytes.size() - 1)), "blending", "ends");
      EXPECT_NE(reason_of(resized(bytes, bytes.size() + 1)), "");
    }
  ViewRequest request = golden_request();
  request.view.blending = {Blending::Kind::kAngle, 0, 4};
  const std::vector<uint8_t> by_angle = encode_request(request);
  EXPECT_MENTIONS(reason_of(with(by_angle, by_angle.size() - 1, 1, 33)), "blending", "1 to 32 cameras");
  request.view.blending = {Blending::Kind::kAperture, 0.2, 0};
  const std::vector<uint8_t> wide = encode_request(request);
  for (const double bad : {0., -1., std::nan(""), 2e6})
    EXPECT_MENTIONS(reason_of(with(wide, wide.size() - 8, 8, std::bit_cast<uint64_t>(bad))), "blending", "aperture",
                    "0", "1000000 m");
}

TEST(RequestCodec, EveryCameraMayBeOutOfService) {
  ViewRequest request = golden_request();
  request.out_of_service.clear();
  for (CameraIndex i = 0; i < kMaxCameras; i++) request.out_of_service.push_back(i);
  EXPECT_LE(expect_round_trip(request).size(), kMaxRequestBytes);
}

TEST(RequestCodec, RefusesEveryTruncation) {
  const std::vector<uint8_t> bytes = from_hex(kGolden);
  for (size_t n = 0; n < bytes.size(); n++) {
    const std::string plain = reason_of({bytes.begin(), bytes.begin() + n});
    if (n < 12) {
      EXPECT_MENTIONS(plain, "header", "12 bytes", std::to_string(n));
      continue;
    }
    EXPECT_MENTIONS(plain, "length", "172 bytes", std::to_string(n));
    // The error names the truncated field if the length field matches.
    const char* field = n < 100 ? "view" : n < 132 ? "lens params" : n < 164 ? "focal_plane" : "out_of_service";
    if (n < 168) {
      EXPECT_MENTIONS(reason_of(resized(bytes, n)), field, "ends") << n;
    } else {
      EXPECT_MENTIONS(reason_of(resized(bytes, n)), "out_of_service", "2 cameras", std::to_string(n - 168));
    }
  }
  EXPECT_MENTIONS(reason_of(resized(bytes, 173)), "out_of_service", "2 cameras", "5 bytes");
}

TEST(RequestCodec, ErrorsNameTheField) {
  const uint64_t nan = std::bit_cast<uint64_t>(std::nan("")), two = std::bit_cast<uint64_t>(2.);
  const uint64_t infinity = std::bit_cast<uint64_t>(std::numeric_limits<double>::infinity());
  const WrongField rows[] = {
      {0, 1, 0x8e, {"magic"}},
      {3, 1, 'A', {"magic"}},
      {4, 1, 2, {"version", "2", "1"}},
      {4, 1, 0, {"version", "0", "1"}},
      {5, 1, 2, {"type", "2"}},
      {6, 2, 18, {"flags", "bits 16"}},
      {8, 4, 171, {"length", "171 bytes", "172"}},
      {8, 4, 0, {"length", "0 bytes", "12 to 1048576"}},
      {8, 4, 0xffffffff, {"length", "4294967295 bytes", "12 to 1048576"}},
      {36, 2, 0, {"width", "1 to 16384 pixels", "0"}},
      {38, 2, 16385, {"height", "1 to 16384 pixels", "16385"}},
      {40, 1, 101, {"quality", "0 to 100", "101"}},
      {41, 1, 10, {"lens model", "10"}},
      {41, 1, 4, {"focal_plane", "ends"}},
      {42, 1, 3, {"focal surface", "kind 3"}},
      {43, 1, 8, {"gains", "focal map"}},
      {43, 1, 0x10, {"blending", "ends"}},
      {43, 1, 0x30, {"blending", "kind 3"}},
      {44, 8, nan, {"position", "finite"}},
      {60, 8, infinity, {"position", "finite"}},
      {68, 8, two, {"orientation", "quaternion"}},
      {92, 8, nan, {"orientation", "quaternion"}},
      {100, 8, 0, {"params[0]", "focal length", "positive"}},
      {108, 8, nan, {"params[1]", "finite"}},
      {132, 8, two, {"focal_plane", "finite", "unit length"}},
      {156, 8, nan, {"focal_plane", "finite", "unit length"}},
      {164, 4, 0xffffffff, {"out_of_service", "4294967295 cameras", "4 bytes"}},
      {168, 2, 258, {"out_of_service[1]", "ascend"}},
      {170, 2, 0xffff, {"out_of_service[1]", "camera 65535", "65534"}},
  };
  expect_reasons(reason_of, from_hex(kGolden), rows);
}

TEST(RequestCodec, RefusesToEncodeInvalidRequests) {
  const auto refused = [](auto change) {
    ViewRequest request = golden_request();
    change(request);
    EXPECT_THROW(encode_request(request), Error);
  };
  refused([](ViewRequest& r) { r.view.width = 0; });
  refused([](ViewRequest& r) { r.view.height = 70000; });
  refused([](ViewRequest& r) { r.quality = 101; });
  refused([](ViewRequest& r) { r.view.pose.position.x = std::nan(""); });
  refused([](ViewRequest& r) { r.out_of_service = {kMaxCameras}; });
  refused([](ViewRequest& r) { r.out_of_service = {5, 4}; });
}

TEST(RequestCodec, PeekMatchesDecoding) {
  std::mt19937 random(5);
  for (int i = 0; i < 200; i++) {
    const ViewRequest request = random_request(random);
    std::vector<uint8_t> bytes = encode_request(request);
    const auto peek = peek_request(bytes).value();
    EXPECT_EQ(peek.type, 1);
    EXPECT_EQ(peek.head, static_cast<const RequestHeader&>(request));
    bytes.resize(12 + 29);
    EXPECT_TRUE(peek_request(bytes)) << "the rest is not read";
    bytes.resize(12 + 28);
    EXPECT_FALSE(peek_request(bytes));
  }
  std::vector<uint8_t> bytes = encode_request(golden_request());
  bytes[3] = 'A';
  EXPECT_FALSE(peek_request(bytes)) << "an answer";
  bytes[3] = 'Q';
  bytes[4] = kVersion + 1;
  EXPECT_FALSE(peek_request(bytes)) << "unknown version";
}

TEST(RequestCodec, SurvivesRandomCorruption) {
  std::mt19937 random(2);
  std::vector<std::vector<uint8_t>> requests;
  for (int i = 0; i < 64; i++) requests.push_back(encode_request(random_request(random)));
  expect_corruption_survived(requests, 44, random, [](const auto& bytes) -> std::optional<std::vector<uint8_t>> {
    const std::optional<ViewRequest> decoded = decode_request(bytes);
    return decoded ? std::optional(encode_request(*decoded)) : std::nullopt;
  });
}

TEST(RequestCodec, PeekedCostMatchesTheRequest) {
  std::mt19937 random(8);
  for (int i = 0; i < 300; i++) {
    const ViewRequest request = random_request(random);
    const std::vector<uint8_t> bytes = encode_request(request);
    EXPECT_EQ(peek_request_cost(bytes),
              (RequestCost{.width = request.view.width,
                           .height = request.view.height,
                           .aperture = request.view.blending.aperture,
                           .hypotheses = static_cast<unsigned>(request.hypotheses.size()),
                           .lens_steps = request.view.lens.mean_iterations(request.view.width, request.view.height),
                           .by_angle = request.view.blending.kind == Blending::Kind::kAngle}));
    for (size_t size = 0; size < bytes.size(); size += 7) peek_request_cost(std::span(bytes).first(size));
  }
  ViewRequest wide = golden_request();
  wide.view.blending = {Blending::Kind::kAperture, 12.5, 0};
  EXPECT_EQ(peek_request_cost(encode_request(wide)), (RequestCost{640, 480, 12.5, 0}));
}

}  // namespace
}  // namespace lf::wire
