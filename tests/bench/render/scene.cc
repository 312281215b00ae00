// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/scene.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <thread>

#include "scene/scene.h"

namespace lf::bench {
namespace {

// Calls job(i) for i below n, on all cores.
template <class Job>
void in_parallel(size_t n, const Job& job) {
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t i; (i = next++) < n;) job(i);
  };
  std::vector<std::thread> pool;
  for (unsigned i = 1; i < std::thread::hardware_concurrency(); i++) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
}

// Alternates 255 and 0; `phase` shifts the pattern per channel or plane.
void draw_checkerboard(uint8_t* plane, int width, int height, int pixel_stride, int phase) {
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      plane[(static_cast<size_t>(y) * width + x) * pixel_stride] = (x + y + phase) % 2 == 0 ? 255 : 0;
}

}  // namespace

std::string pixels_name(Pixels pixels) {
  switch (pixels) {
    case Pixels::kRgb: return "rgb";
    case Pixels::kRgbx: return "rgbx";
    case Pixels::kBgr: return "bgr";
    default: return "i420";
  }
}

PixelFamily family_of(Pixels pixels) { return pixels == Pixels::kI420 ? PixelFamily::kI420 : PixelFamily::kRgb; }

Scene::Scene(const SceneOptions& options)
    : options_(options), rig_(make_array(options.array)), mesh_(build_mesh(rig_)), cameras_(rig_.cameras.size()) {
  for (int n = 0; n < options.views; n++) views_.push_back(make_view(options.array.width, options.array.height, n));
  std::iota(cameras_.begin(), cameras_.end(), 0);
  if (options.content == "checkerboard")
    draw_checkerboard();
  else
    film();
}

void Scene::film() {
  const double pixels = static_cast<double>(options_.array.width) * options_.array.height;
  const auto sources = static_cast<size_t>(
      std::clamp(options_.most_filmed_pixels / pixels, 1.0, static_cast<double>(rig_.cameras.size())));
  for (size_t i = 0; i < cameras_.size(); i++) source_of_.push_back(i * sources / cameras_.size());
  rgb_.resize(sources);
  i420_.resize(sources);
  in_parallel(sources, [&](size_t i) {
    const auto first = std::find(source_of_.begin(), source_of_.end(), i);
    const Camera& camera = rig_.cameras[static_cast<size_t>(first - source_of_.begin())];
    rgb_[i] = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0);
    i420_[i] = to_i420(rgb_[i]);
  });
  const View& view = views_.front();
  if (sources == cameras_.size()) truth_ = render_scene({view.width, view.height, view.lens, view.pose}, 0);
}

void Scene::draw_checkerboard() {
  const int width = options_.array.width, height = options_.array.height;
  source_of_.assign(cameras_.size(), 0);
  rgb_.emplace_back(PixelFamily::kRgb, width, height);
  i420_.emplace_back(PixelFamily::kI420, width, height);
  for (int c = 0; c < 3; c++) {
    bench::draw_checkerboard(rgb_[0].data().data() + c, width, height, 3, c);
    const bool luma = c == 0;
    bench::draw_checkerboard(i420_[0].plane(c), luma ? width : chroma_size(width), luma ? height : chroma_size(height),
                             1, c);
  }
}

const Image& Scene::source(CameraIndex camera, PixelFamily family) const {
  return (family == PixelFamily::kI420 ? i420_ : rgb_)[source_of_[camera]];
}

const uint8_t* Scene::in_layout(size_t source, const RgbLayout& layout, std::vector<std::vector<uint8_t>>& made) const {
  made.resize(rgb_.size());
  std::vector<uint8_t>& out = made[source];
  if (out.empty()) {
    const std::vector<uint8_t>& rgb = rgb_[source].data();
    out.assign(rgb.size() / 3 * layout.pixel_stride, 255);
    uint8_t* pixel = out.data();
    for (size_t i = 0; i < rgb.size(); i += 3, pixel += layout.pixel_stride) {
      pixel[layout.r] = rgb[i];
      pixel[layout.g] = rgb[i + 1];
      pixel[layout.b] = rgb[i + 2];
    }
  }
  return out.data();
}

ImageView Scene::image(CameraIndex camera, Pixels pixels) const {
  ImageView view = source(camera, family_of(pixels)).view();
  if (pixels == Pixels::kRgb || pixels == Pixels::kI420) return view;
  const bool padded = pixels == Pixels::kRgbx;
  view.layout = padded ? RgbLayout{4, 0, 1, 2} : RgbLayout{3, 2, 1, 0};
  view.plane[0] = in_layout(source_of_[camera], view.layout, padded ? rgbx_ : bgr_);
  view.stride[0] = static_cast<ptrdiff_t>(view.layout.pixel_stride) * view.width;
  return view;
}

const FloatStill& Scene::exact(PixelFamily family) const {
  FloatStill& still = family == PixelFamily::kI420 ? exact_i420_ : exact_rgb_;
  if (still.family != PixelFamily::kNone) return still;
  const View& view = views_.front();
  const ViewPlan plan(rig_, mesh_, view);
  const FaceIdMap owners(plan, {0, 0, view.width, view.height});
  still = render_float_still(rig_, plan, owners, family,
                             [&](CameraIndex camera) -> const Image& { return source(camera, family); });
  return still;
}

}  // namespace lf::bench
