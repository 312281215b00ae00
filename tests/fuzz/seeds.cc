// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes inputs to begin with, made of real units: seeds FOLDER makes FOLDER/TARGET/....
#include <filesystem>
#include <fstream>

#include "lib/rtp/rtp_test.h"
#include "node/commands.h"
#include "scene/scene.h"
#include "web/offers.h"
#include "wire/command_codec.h"
#include "wire/moments_codec.h"
#include "wire/unit.h"

namespace {

using lf::rtp::Bytes;

void write(const std::filesystem::path& folder, const Bytes& bytes) {
  std::filesystem::create_directories(folder);
  int number = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) number++;
  std::ofstream(folder / ("seed-" + std::to_string(number)), std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

Bytes join(const std::vector<Bytes>& parts) {
  Bytes out;
  for (const Bytes& part : parts) out.insert(out.end(), part.begin(), part.end());
  return out;
}

Bytes packets(lf::wire::UnitKind kind, const std::vector<Bytes>& units, size_t max_payload) {
  Bytes out{kind == lf::wire::UnitKind::kRequest};
  lf::rtp::Packetizer packetizer(kind);
  for (const Bytes& unit : units)
    for (const lf::rtp::Sent& sent : lf::rtp::packetize(packetizer, unit, max_payload))
      out = join({out,
                  {16, static_cast<uint8_t>(sent.payload.size() >> 8), static_cast<uint8_t>(sent.payload.size())},
                  sent.payload});
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  using enum lf::PixelFamily;
  lf::CameraRanges cameras;
  cameras.append({0, 3});
  cameras.append({7, 9});
  const std::vector<Bytes> answers{
      lf::rtp::answer(0, 1, 1, 0),
      lf::rtp::answer(2, 6, 5, 0, kRgb),
      lf::rtp::answer(2, 7, 5, 0, kI420, cameras),
      lf::rtp::answer(5, 16, 16, 50, kI420, cameras),  // an atlas
      lf::rtp::answer(3, 20, 10, 90, kRgb),
      lf::rtp::answer(1, 90, 70, 75, kI420),
      lf::rtp::answer_with_sum(6, 5, true, 2),
      lf::rtp::answer_with_sum(8, 6, false, 0),
  };
  const std::vector<Bytes> requests{lf::rtp::request(1), lf::rtp::request(2), lf::rtp::request(3, 7, 5)};
  for (const Bytes& unit : answers) {
    write(folder / "answer", unit);
    write(folder / "packetizer", join({{0, 0}, unit}));
    write(folder / "depacketizer", packets(lf::wire::UnitKind::kAnswer, {unit}, lf::rtp::kMinPayloadBytes));
  }
  lf::ViewRequest asked;
  asked.view.width = asked.view.height = 64;
  asked.view.lens = lf::Lens::from_fov_y(40, 64, 64);
  asked.view.focus.plane = lf::focal_plane_at(asked.view.pose, 2);
  const lf::Rig rig = lf::scene_rig(2, 2, 64, 48);
  write(folder / "request", lf::wire::encode_command(warp_command(rig, build_mesh(rig), asked)));
  write(folder / "request", lf::wire::encode_command(pixel_command(rig, build_mesh(rig), asked)));
  lf::FocalMap map = lf::FocalMap::for_view(64, 64);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.1;
  map.nearest = 1;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(i / 20 * 30));
  asked.view.focus.map = std::make_shared<lf::FocalMap>(map);
  for (const lf::Blending blending :
       {lf::Blending{lf::Blending::Kind::kAperture, 0.2, 0}, lf::Blending{lf::Blending::Kind::kAngle, 0, 4}}) {
    asked.view.blending = blending;
    write(folder / "request", lf::wire::encode_request(asked));
  }
  asked.trials = lf::trials_of_round(1);
  write(folder / "request", lf::wire::encode_request(asked));
  asked.gains = {.use = true, .ask = true, .mean = std::vector<uint8_t>(64, 90), .mean_of = 7};
  write(folder / "request", lf::wire::encode_request(asked));
  std::vector<lf::Moments> moments(2);
  for (lf::Moments& m : moments) {
    m.reset(5, 4);
    for (size_t i = 6; i < 15; i++) {
      m.weight[i] = &m == &moments[0] ? 32768 : 20000;
      m.luma[i] = m.square[i] = static_cast<uint16_t>(1000 * i);
    }
  }
  const lf::ByteBuffer coded = lf::wire::encode_moments({1, 2, 3, 4, {}}, moments);
  const Bytes moments_unit(coded.begin(), coded.end());
  write(folder / "moments", moments_unit);
  for (lf::Moments& m : moments)
    for (size_t i = 6; i < 15; i++) {
      m.weight[i] = static_cast<uint16_t>(2000 * i);
      m.luma[i] = lf::Moments::luma_of(m.weight[i], 77);
      m.square[i] = lf::Moments::square_of(m.luma[i], 77);
    }
  const lf::ByteBuffer of_one = lf::wire::encode_moments({1, 2, 3, 4, {}}, moments, true);
  write(folder / "moments", Bytes(of_one.begin(), of_one.end()));
  const lf::ByteBuffer gains = lf::wire::encode_moments({1, 2, 3, 4, lf::GainSum{9000, -77}}, {&moments[1], 1});
  write(folder / "moments", Bytes(gains.begin(), gains.end()));
  write(folder / "packetizer", join({{0, 0}, moments_unit}));
  write(folder / "framing", join({{9}, moments_unit, answers[0]}));
  for (const Bytes& unit : requests) {
    write(folder / "request", unit);
    write(folder / "packetizer", join({{0, 1}, unit}));
  }
  write(folder / "depacketizer", packets(lf::wire::UnitKind::kAnswer, answers, 600));
  write(folder / "depacketizer", packets(lf::wire::UnitKind::kRequest, requests, 1388));
  const auto write_text = [&folder](const char* target, const std::string& text) {
    write(folder / target, Bytes(text.begin(), text.end()));
  };
  write_text("offer", lf::test::browser_offer());
  write_text("offer", lf::test::with(lf::test::browser_offer(), "H264", "H265"));
  write_text("control", R"({"id":7,"mid":null,"request":{"type":"navigationEvent","event":{"event":"MouseMove","x":1,)"
                        R"("y":2,"modifier_state":"shift-mask+button1-mask"}}})");
  write_text("control", R"({"id":8,"request":{"type":"navigationEvent","event":{"event":"KeyPress","key":"Left"}}})");
  write_text("control", R"({"id":9,"request":{"type":"customUpstreamEvent","structureName":"lf-view-request",)"
                        R"("structure":{"x":0.1,"focus-distance":2}}})");
  write(folder / "framing", join({{30}, requests[0], {0x8f, 'L', 'x'}, requests[1], requests[2]}));
  write(folder / "framing", join({{7}, answers[1], Bytes(40, 'x'), answers[2], answers[0]}));
}
