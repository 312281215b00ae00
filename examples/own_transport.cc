// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Uses the library without GStreamer. Two hosts with eight cameras each answer the requests of a viewer. Requests and
// answers are byte strings that an application can send over any transport.
//
//   g++ -std=c++20 own_transport.cc $(pkg-config --cflags --libs lightfield) -o own_transport && ./own_transport
#include <lightfield/lf.h>

#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

namespace {

// Sixteen cameras in a square, 5 cm apart, 2 m in front of a wall.
constexpr int kSide = 4, kWidth = 160, kHeight = 120;
constexpr double kPitch = 0.05, kFocal = 150, kWall = 2;

lf::Rig make_rig() {
  std::vector<lf::Camera> cameras(kSide * kSide);
  for (uint32_t i = 0; i < cameras.size(); i++) {
    cameras[i].id = i;
    cameras[i].width = kWidth;
    cameras[i].height = kHeight;
    cameras[i].lens = {kFocal, kFocal, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0};
    cameras[i].world_from_camera.position = {kPitch * (i % kSide), kPitch * (i / kSide), 0};
  }
  return lf::Rig(cameras, {lf::Topology::Type::kGrid, kSide, kSide, {}});
}

// Returns the brightness of the wall, 0 to 255, in pixel (x, y) of a camera at `eye`.
double wall(const lf::Vec3& eye, double x, double y) {
  const double u = eye.x + (x - (kWidth - 1) / 2.0) / kFocal * kWall;
  const double v = eye.y + (y - (kHeight - 1) / 2.0) / kFocal * kWall;
  return 128 + 60 * std::sin(10 * u) + 60 * std::cos(12 * v);
}

lf::Image photograph(const lf::Camera& camera) {
  lf::Image image = lf::make_image(lf::PixelFormat::kRgb, camera.width, camera.height);
  for (size_t i = 0; i < image.pixels.size(); i++)
    image.pixels[i] = static_cast<uint8_t>(std::lround(wall(
        camera.world_from_camera.position, static_cast<double>(i / 3 % kWidth), static_cast<double>(i / 3 / kWidth))));
  return image;
}

// A host with some of the cameras of the array. It has the complete rig, so that it can answer view requests.
struct Host {
  Host(const lf::Rig& rig, const std::vector<uint32_t>& cameras) : node(rig, cameras) {
    for (const uint32_t camera : cameras) frames.push_back(photograph(rig.camera(camera)));
  }
  std::vector<lf::Bytes> receive(const lf::Bytes& request) const { return node.answer(request, frames); }
  lf::Node node;
  std::vector<lf::Image> frames;
};

}  // namespace

int main() try {
  const lf::Rig rig = make_rig();
  std::vector<uint32_t> some(8), others(8);
  std::iota(some.begin(), some.end(), 0);
  std::iota(others.begin(), others.end(), 8);
  const Host hosts[] = {{rig, some}, {rig, others}};

  lf::Compositor compositor(rig, 1);
  lf::View view = lf::home_view(rig, kWidth, kHeight);
  view.lens = rig.camera(0).lens;
  lf::Image picture;
  for (int i = 0; i < 16; i++) {  // the focal surface improves with every picture
    const lf::Bytes request = compositor.request(view, {.focus = lf::Focus::kAuto, .quality = 95});
    size_t bytes = 0;
    for (const Host& host : hosts)
      for (const lf::Bytes& part : host.receive(request)) {
        bytes += part.size();
        if (const auto added = compositor.add(part); !added) std::printf("%s\n", added.problem.c_str());
      }
    picture = compositor.finish();
    std::printf("request %zu bytes, answers %zu bytes, %u cameras missing\n", request.size(), bytes,
                compositor.missing());
  }

  double sum = 0;  // sum of the absolute differences to the wall, without the border
  int count = 0;
  for (int y = 20; y < kHeight - 20; y++)
    for (int x = 20; x < kWidth - 20; x++, count++)
      sum += std::abs(picture.pixels[3 * (static_cast<size_t>(y) * kWidth + x)] -
                      wall(view.world_from_view.position, x, y));
  std::printf("mean error %.2f of 255\n", sum / count);
  return compositor.missing() == 0 && sum / count < 2 ? 0 : 1;
} catch (const lf::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
