// SPDX-License-Identifier: LGPL-2.1-or-later
//
// The library alone, without GStreamer: two hosts with cameras answer a viewer's request. What travels between them are
// strings of bytes, for whatever transport an application has.
//
//   g++ -std=c++20 own_transport.cc $(pkg-config --cflags --libs lightfield) -o own_transport && ./own_transport
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numeric>
#include <vector>

#include "composite/assembly.h"
#include "node/answer_task.h"
#include "quality/quality.h"
#include "rig/mesh.h"
#include "scene/scene.h"
#include "view/navigator.h"
#include "wire/answer_parser.h"
#include "wire/request_codec.h"

namespace {

using Bytes = std::vector<uint8_t>;

// A host with some of the cameras. Every host has the whole rig.
class CameraHost {
 public:
  CameraHost(const lf::Rig& rig, uint32_t number, std::vector<lf::CameraIndex> cameras)
      : rig_(rig), number_(number), cameras_(std::move(cameras)) {
    // In place of frames of cameras: what they see of the built-in scene.
    for (const lf::CameraIndex i : cameras_) {
      const lf::Camera& camera = rig_.cameras[i];
      images_.push_back(lf::render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1));
    }
  }

  // The answer to a request, as bytes; none to what is no request.
  Bytes answer(const Bytes& request_bytes) const {
    const auto request = lf::wire::decode_request(request_bytes);
    if (!request) return {};
    const lf::Mesh mesh = lf::build_mesh(rig_, request->out_of_service);
    const auto task = lf::make_task(rig_, mesh, *request, cameras_);
    std::vector<lf::Source> sources;
    for (const lf::CameraIndex i : task->cameras())
      sources.push_back({i, &rig_.cameras[i], images_[i - cameras_.front()].view()});
    lf::wire::AnswerHeader header;
    header.view_id = request->view_id;
    header.sequence = request->sequence;
    header.view_width = static_cast<uint16_t>(request->view.width);
    header.view_height = static_cast<uint16_t>(request->view.height);
    header.family = images_[0].family();
    header.rig_hash = rig_.hash();
    header.node = number_;
    header.cameras = lf::CameraRanges(cameras_);
    const auto bytes = task->render(header, sources, {}).bytes;
    return {bytes.begin(), bytes.end()};
  }

 private:
  const lf::Rig& rig_;
  uint32_t number_;
  std::vector<lf::CameraIndex> cameras_;  // one after the other
  std::vector<lf::Image> images_;
};

}  // namespace

int main() {
  const auto rig = std::make_shared<const lf::Rig>(lf::scene_rig(4, 4, 160, 120));
  std::vector<lf::CameraIndex> half(8), other(8);
  std::iota(half.begin(), half.end(), 0);
  std::iota(other.begin(), other.end(), 8);
  const CameraHost hosts[] = {{*rig, 0, half}, {*rig, 1, other}};

  // The viewer: a view in the middle of the array, focused on the figure.
  lf::Viewpoint eye = lf::default_viewpoint(*rig);
  eye.focus_distance = lf::kSceneMiddle;
  lf::ViewRequest request;
  request.sequence = 1;
  request.view = lf::make_view(eye, 320, 240);
  request.rig_hash = rig->hash();
  request.quality = 90;  // of JPEG
  const Bytes asked = lf::wire::encode_request(request);

  lf::Assembly assembly;
  assembly.set_rig(rig);
  assembly.begin(request);
  size_t bytes = 0;
  for (const CameraHost& host : hosts) {
    const Bytes answered = host.answer(asked);
    bytes += answered.size();
    const auto answer = lf::wire::parse_answer(answered);
    if (!answer || assembly.add(*answer) != lf::Assembly::Verdict::kAdded) return 1;
  }
  assembly.finish(lf::PixelFamily::kRgb, true);
  const lf::Image picture = assembly.picture().resolve();

  // The built-in scene knows the truth; off the focal plane the picture is double.
  const lf::Image truth =
      lf::render_scene({request.view.width, request.view.height, request.view.lens, request.view.pose}, 0, 1);
  const double psnr = lf::compare(picture, truth).psnr_db;
  std::printf("a request of %zu bytes, answers of %zu, %u cameras missing, PSNR %.1f dB\n", asked.size(), bytes,
              assembly.missing(), psnr);
  return assembly.missing() == 0 && psnr > 15 ? 0 : 1;
}
