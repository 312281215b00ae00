// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/command_codec.h"

#include "lib/wire/wire_test.h"
#include "support/expect_error.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

// Written from spec.md, not by the encoder.
const char kGoldenWarp[] =
    "8f4c465101030001000001660000000701020304000000003b9aca001122334455667788028001e05a00000000000000"
    "0000000000000000000000003ff0000000000000407f4000000000004073f80000000000406df0000000000000000001"
    "0000000200030102ffff00020004000600083ff000000000000040000000000000004008000000000000401000000000"
    "000040140000000000004018000000000000401c00000000000040200000000000004022000000000000402400000000"
    "00004026000000000000402800000000000000033ff00000000000000000000000000000000000000000000000000000"
    "000000004000000000000000000000000000000000000000000000000000000000000000401000000000000001023ff0"
    "000000000000000000000000000000000000000000000000000000000000bff000000000000000000000000000000000"
    "00000000000000000000000000003fe0000000000000";

const char kGoldenPixels[] =
    "8f4c465101040000000000400000000701020304ffffffffffffffff1122334455667788028001e05a00000200030000"
    "000000010001010200780064002001f5";

void set_head(RequestHeader& head) {
  head.view_id = 7;
  head.sequence = 0x01020304;
  head.target_time = 1'000'000'000;
  head.absolute_time = true;
  head.quality = 90;
  head.rig_hash = 0x1122334455667788;
}

WarpCommand golden_warp() {
  WarpCommand c;
  set_head(c);
  c.warp.width = 640;
  c.warp.height = 480;
  c.warp.lens = Lens::pinhole(500, 319.5, 239.5);
  c.warp.in_front = {0, 0, 1};
  FacePlan face;
  face.camera = {3, 258, MeshFace::kNone};
  face.rect = {2, 4, 8, 12};
  for (int k = 0; k < 3; k++) face.edge[k] = Vec3(3 * k + 1, 3 * k + 2, 3 * k + 3);
  face.facing = {10, 11, 12};
  c.warp.faces = {face};
  Mat3 a(1), b(1);
  a[1][1] = 2;
  a[2][2] = 4;
  b[1][1] = -1;
  b[2][2] = 0.5;
  c.warp.cameras = {{3, a}, {258, b}};
  return c;
}

PixelCommand golden_pixels() {
  PixelCommand c;
  set_head(c);
  c.absolute_time = false;
  c.target_time = kNoTime;
  c.view_width = 640;
  c.view_height = 480;
  c.regions = {{3, {0, 0, 1, 1}}, {258, {120, 100, 152, 601}}};
  return c;
}

WarpCommand random_warp(std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1e3, 1e3);
  const auto vec = [&] { return Vec3(number(random), number(random), number(random)); };
  WarpCommand c = golden_warp();
  c.sequence = random();
  c.quality = random() % 101;
  c.warp.width = 16 + random() % 1000;
  c.warp.height = 16 + random() % 1000;
  c.warp.in_front = vec();
  std::array<double, Lens::kMaxParams> params;
  for (double& p : params) p = std::abs(number(random)) + 1;
  c.warp.lens = Lens(*lens_model_from_code(random() % 10), params);
  c.warp.faces.clear();
  c.warp.cameras.clear();
  const uint32_t triangles = random() % 6;
  for (uint32_t i = 0; i < triangles; i++) {
    FacePlan face{.face = i, .camera = {i, i + 1, i + 2}};
    face.rect.x0 = random() % 16;
    face.rect.y0 = random() % 16;
    face.rect.x1 = face.rect.x0 + 1 + random() % (c.warp.width - face.rect.x0);
    face.rect.y1 = face.rect.y0 + 1 + random() % (c.warp.height - face.rect.y0);
    for (Vec3& edge : face.edge) edge = vec();
    face.facing = vec();
    c.warp.faces.push_back(face);
  }
  for (uint32_t i = 0; triangles > 0 && i < triangles + 2; i++)
    c.warp.cameras.push_back({i, Mat3(vec(), vec(), vec())});
  return c;
}

constexpr auto warp_reason = refusal<decode_warp_command>;
constexpr auto pixel_reason = refusal<decode_pixel_command>;

TEST(CommandCodec, GoldenBytes) {
  EXPECT_EQ(encode_command(golden_warp()), from_hex(kGoldenWarp));
  EXPECT_EQ(decode_warp_command(from_hex(kGoldenWarp)), golden_warp());
  EXPECT_EQ(encode_command(golden_pixels()), from_hex(kGoldenPixels));
  EXPECT_EQ(decode_pixel_command(from_hex(kGoldenPixels)), golden_pixels());
}

TEST(CommandCodec, RoundTrips) {
  std::mt19937 random(1);
  for (int i = 0; i < 1000; i++) {
    const WarpCommand command = random_warp(random);
    std::string reason;
    EXPECT_EQ(decode_warp_command(encode_command(command), &reason), command) << reason;
  }
}

TEST(CommandCodec, TypesAreDistinguished) {
  const auto index = [](const std::vector<uint8_t>& bytes) {
    const std::optional<AnyRequest> request = decode_any_request(bytes);
    return request ? static_cast<int>(request->index()) : -1;
  };
  ViewRequest view;
  view.view.width = view.view.height = 8;
  view.view.focus.plane = {{0, 0, -1}, 2};
  EXPECT_EQ(index(encode_request(view)), 0);
  EXPECT_EQ(index(from_hex(kGoldenWarp)), 1);
  EXPECT_EQ(index(from_hex(kGoldenPixels)), 2);
  EXPECT_EQ(index(with(from_hex(kGoldenPixels), 5, 1, 5)), -1);
  EXPECT_EQ(index({1, 2, 3}), -1);
  EXPECT_MENTIONS(warp_reason(from_hex(kGoldenPixels)), "type", "4");
}

TEST(CommandCodec, RefusesEveryTruncation) {
  for (size_t n = 12; n < from_hex(kGoldenWarp).size(); n++) {
    const std::string reason = warp_reason(resized(from_hex(kGoldenWarp), n));
    const char* field = n < 41 ? "view: " : n < 68 ? "in_front: " : n < 92 ? "lens params: " : "cameras: ";
    EXPECT_EQ(reason.substr(0, reason.find(": ") + 2), field) << n;
  }
  for (size_t n = 12; n < from_hex(kGoldenPixels).size(); n++) {
    const std::string reason = pixel_reason(resized(from_hex(kGoldenPixels), n));
    EXPECT_EQ(reason.substr(0, reason.find(": ")), n < 41 ? "view" : "cameras") << n;
  }
  for (const char* golden : {kGoldenWarp, kGoldenPixels}) {
    const std::vector<uint8_t> bytes = from_hex(golden);
    EXPECT_FALSE(decode_any_request(resized(bytes, bytes.size() + 1)));
    for (size_t n = 0; n < bytes.size(); n++) EXPECT_FALSE(decode_any_request({bytes.data(), n})) << n;
  }
}

TEST(CommandCodec, ErrorsNameTheField) {
  const uint64_t nan = std::bit_cast<uint64_t>(std::nan(""));
  const uint64_t infinity = std::bit_cast<uint64_t>(std::numeric_limits<double>::infinity());
  const WrongField warp_rows[] = {
      {6, 2, 8, {"flags", "bits 8"}},
      {36, 2, 0, {"width", "1 to 16384 pixels", "0"}},
      {40, 1, 101, {"quality", "0 to 100", "101"}},
      {41, 1, 10, {"lens model", "10"}},
      {42, 2, 1, {"reserved", "0", "1"}},
      {44, 8, nan, {"in_front", "finite"}},
      {68, 8, 0, {"params[0]", "focal length", "positive"}},
      {92, 4, 0xffffffff, {"cameras", "4294967295 triangles", "2 cameras", "258 bytes"}},
      {96, 4, 0xffffffff, {"cameras", "1 triangles", "4294967295 cameras", "258 bytes"}},
      {100, 2, 0xffff, {"triangles[0].corners", "different cameras"}},
      {102, 2, 3, {"triangles[0].corners", "different cameras"}},
      {104, 2, 3, {"triangles[0].corners", "different cameras"}},
      {104, 2, 4, {"cameras", "corners", "ascending"}},
      {106, 2, 640, {"triangles[0].rectangle", "inside"}},
      {110, 2, 0, {"triangles[0].rectangle", "inside"}},
      {112, 2, 477, {"triangles[0].rectangle", "inside"}},
      {114, 8, infinity, {"triangles[0].edges", "finite"}},
      {202, 8, nan, {"triangles[0].facing", "finite"}},
      {210, 2, 258, {"cameras", "corners", "ascending"}},
      {284, 2, 4, {"cameras", "corners", "ascending"}},
      {350, 8, nan, {"cameras[1].matrix", "finite"}},
  };
  expect_reasons(warp_reason, from_hex(kGoldenWarp), warp_rows);
  const WrongField pixel_rows[] = {
      {38, 2, 16385, {"height", "1 to 16384 pixels", "16385"}},
      {40, 1, 101, {"quality", "0 to 100", "101"}},
      {41, 1, 1, {"reserved", "0", "1"}},
      {42, 2, 3, {"cameras", "3", "20 bytes"}},
      {44, 2, 258, {"cameras[1]", "ascend"}},
      {54, 2, 0xffff, {"cameras[1]", "camera 65535", "65534"}},
      {50, 2, 0, {"cameras[0]", "empty"}},
      {56, 2, 16384, {"cameras[1]", "rectangle", "inside"}},
      {56, 2, 121, {"cameras[1]", "even"}},
  };
  expect_reasons(pixel_reason, from_hex(kGoldenPixels), pixel_rows);
}

// The owner lookup needs memory for each row of each triangle.
TEST(CommandCodec, RowsAreLimited) {
  WarpCommand command = golden_warp();
  command.warp.height = kMaxImageSize;
  command.warp.faces[0].rect = {0, 0, 1, kMaxImageSize};
  command.warp.faces.resize(kMaxTriangleRows / kMaxImageSize, command.warp.faces[0]);
  EXPECT_NO_THROW(encode_command(command));
  command.warp.faces.push_back(command.warp.faces[0]);
  EXPECT_ERROR(encode_command(command), "triangles", "2113536 rows", "2097152");
}

TEST(CommandCodec, ThousandCamerasInOneViewFit) {
  WarpCommand command = golden_warp();
  FacePlan face = command.warp.faces[0];
  command.warp.faces.clear();
  command.warp.cameras.clear();
  for (CameraIndex i = 0; i < 1024; i++) {
    for (int k = 0; k < 2; k++) {
      face.camera = {i, (i + 1) % 1024, (i + 32) % 1024};
      command.warp.faces.push_back(face);
    }
    command.warp.cameras.push_back({i, Mat3(1)});
  }
  EXPECT_LT(encode_command(command).size(), kMaxRequestBytes / 3);
}

TEST(CommandCodec, SurvivesRandomCorruption) {
  std::mt19937 random(2);
  std::vector<std::vector<uint8_t>> units{from_hex(kGoldenWarp), from_hex(kGoldenPixels)};
  for (int i = 0; i < 32; i++) units.push_back(encode_command(random_warp(random)));
  expect_corruption_survived(units, 120, random, [](const auto& bytes) -> std::optional<std::vector<uint8_t>> {
    const std::optional<AnyRequest> decoded = decode_any_request(bytes);
    if (!decoded) return {};
    const auto* warp = std::get_if<WarpCommand>(&*decoded);
    const auto* pixels = std::get_if<PixelCommand>(&*decoded);
    EXPECT_TRUE(warp || pixels);
    return warp ? encode_command(*warp) : encode_command(*pixels);
  });
}

}  // namespace
}  // namespace lf::wire
