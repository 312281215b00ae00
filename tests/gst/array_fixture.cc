// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/array_fixture.h"

#include "support/rigs.h"

namespace lf::test {
namespace {

Rig make_rig() {
  Rig rig = camera_grid(2, 2, 0.1, ArrayFixture::kWidth, ArrayFixture::kHeight, 30);
  for (Camera& camera : rig.cameras) camera.name = "cam_" + std::to_string(camera.id);
  return rig;
}

}  // namespace

ArrayFixture::ArrayFixture() : rig_(make_rig()), file_(rig_to_json(rig_), ".json") {}

ViewRequest ArrayFixture::request(uint32_t sequence, uint64_t time, uint32_t view_id) const {
  ViewRequest request;
  request.view_id = view_id;
  request.sequence = sequence;
  request.target_time = time;
  // All four cameras are visible from here, and the mesh fills the view.
  const Pose pose{.position = {0.05, 0.05, -0.05}};
  request.view = {16, 12, Lens::pinhole(60, 7.5, 5.5), pose, {focal_plane_at(pose, 10)}};
  request.rig_hash = rig_.hash();
  return request;
}

std::shared_ptr<const FocalMap> flat_surface(const View& view) {
  return level_surface(view.width, view.height, 0.05, 0.3, 51);
}

std::string ArrayFixture::caps(const char* format) {
  std::string text = std::string("video/x-raw,format=") + format + ",width=" + std::to_string(kWidth) +
                     ",height=" + std::to_string(kHeight) + ",framerate=10/1";
  if (std::string(format) == "I420") text += ",colorimetry=1:4:0:0,chroma-site=jpeg";
  return text;
}

GstBuffer* ArrayFixture::frame(const char* format, uint8_t value, uint64_t time) {
  const bool i420 = std::string(format) == "I420";
  const size_t luma = kWidth * kHeight;
  std::vector<uint8_t> bytes(i420 ? luma * 3 / 2 : luma * 3, value);
  if (i420) std::fill(bytes.begin() + luma, bytes.end(), uint8_t{128});
  GstBuffer* buffer = to_buffer(bytes);
  GST_BUFFER_PTS(buffer) = time;
  GST_BUFFER_DURATION(buffer) = 100 * GST_MSECOND;
  return buffer;
}

}  // namespace lf::test
