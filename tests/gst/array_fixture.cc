// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/array_fixture.h"

namespace lf::test {
namespace {

Rig make_rig() {
  Rig rig;
  rig.topology.type = Topology::Type::kGrid;
  rig.topology.rows = rig.topology.columns = 2;
  for (uint32_t i = 0; i < 4; i++) {
    Camera camera;
    camera.id = i;
    camera.name = "cam_" + std::to_string(i);
    camera.width = ArrayFixture::kWidth;
    camera.height = ArrayFixture::kHeight;
    camera.lens = Lens::pinhole(30, (ArrayFixture::kWidth - 1) / 2.0, (ArrayFixture::kHeight - 1) / 2.0);
    camera.pose.position = Vec3(i % 2, i / 2, 0) * 0.1;
    rig.cameras.push_back(camera);
  }
  return rig;
}

}  // namespace

ArrayFixture::ArrayFixture() : rig_(make_rig()), file_(rig_to_json(rig_), ".json") {}

ViewRequest ArrayFixture::request(uint32_t sequence, uint64_t time, uint32_t view_id) const {
  ViewRequest request;
  request.view_id = view_id;
  request.sequence = sequence;
  request.target_time = time;
  request.view.width = 16;
  request.view.height = 12;
  // All four cameras are visible from here, and the mesh fills the view.
  request.view.pose.position = Vec3(0.05, 0.05, -0.05);
  request.view.lens = Lens::pinhole(60, 7.5, 5.5);
  request.view.focus.plane = focal_plane_at(request.view.pose, 10);
  request.rig_hash = rig_.hash();
  return request;
}

std::shared_ptr<const FocalMap> flat_surface(const View& view) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.05;
  map.nearest = 0.3;
  map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 51);
  return std::make_shared<FocalMap>(std::move(map));
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
