// SPDX-License-Identifier: LGPL-2.1-or-later
#include <list>

#include "focus/hypothesis_renderer.h"
#include "image/image.h"
#include "image/image_filters.h"
#include "lib/render/gl/external_context.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "render/gl/gles_renderer.h"
#include "render/sum_renderer.h"

namespace lf {
namespace {

using reference::Random;
using test::ExternalContext;
using test::Sum;

// An image in an application's textures: RGB with three bytes per pixel, BGRx, three planes, or two (NV12).
class TexturedImage : public GpuImage {
 public:
  TexturedImage(ExternalContext& somebody, const Image& image, bool is_other_layout) : image_(image) {
    const int width = image.width(), height = image.height(), cw = chroma_size(width), ch = chroma_size(height);
    const auto area = static_cast<size_t>(width) * height, chroma = static_cast<size_t>(cw) * ch;
    if (image.family() == PixelFamily::kRgb) {
      if (is_other_layout) {
        layout_ = {4, 2, 1, 0};
        pixels_.resize(4 * area, 9);
        for (size_t i = 0; i < area; i++)
          for (int c = 0; c < 3; c++) pixels_[4 * i + 2 - c] = image.data()[3 * i + c];
      } else {
        pixels_ = image.data();
      }
      planes_[0] = {somebody.texture(width, height, layout_.pixel_stride, pixels_), 0};
      return;
    }
    const auto plane = [&](int i, size_t size) { return std::vector<uint8_t>(image.plane(i), image.plane(i) + size); };
    planes_[0] = {somebody.texture(width, height, 1, plane(0, area)), 0};
    if (is_other_layout) {
      std::vector<uint8_t> both;
      for (size_t i = 0; i < chroma; i++)
        for (const int c : {1, 2}) both.push_back(image.plane(c)[i]);
      const unsigned name = somebody.texture(cw, ch, 2, both);
      for (const int c : {1, 2}) planes_[c] = {name, c - 1};
    } else {
      for (const int c : {1, 2}) planes_[c] = {somebody.texture(cw, ch, 1, plane(c, chroma)), 0};
    }
  }
  Texture plane(int index) const override { return planes_[index]; }
  void wait() const override { waited_++; }
  ImageView fetch() const override {
    fetched_++;
    if (is_gone_) return {};
    ImageView view = image_.view();
    if (image_.family() != PixelFamily::kRgb) return view;
    view.layout = layout_;
    view.plane[0] = pixels_.data();
    view.stride[0] = ptrdiff_t{image_.width()} * layout_.pixel_stride;
    return view;
  }
  bool is_fetched() const override { return fetched_ > 0; }

  ImageView view(float gain, bool sharpened) const {
    return {.family = image_.family(),
            .width = image_.width(),
            .height = image_.height(),
            .layout = layout_,
            .on_gpu = {this, gain, sharpened}};
  }
  void lose() { is_gone_ = true; }
  int waited() const { return waited_; }
  int fetches() const { return fetched_; }

 private:
  const Image image_;
  RgbLayout layout_;
  std::vector<uint8_t> pixels_;
  Texture planes_[3] = {};
  bool is_gone_ = false;
  mutable std::atomic<int> fetched_ = 0, waited_ = 0;
};

class GpuImages : public test::InExternalContext {
 protected:
  // Two views of the same images. Most images of the first view are on the GPU. All images of the second view are in
  // main memory, processed by the CPU.
  struct Scene {
    Scene(ExternalContext& somebody, int seed, int width = 150, int height = 111)
        : random(seed),
          family(seed / 2 % 2 ? PixelFamily::kI420 : PixelFamily::kRgb),
          rig(test::jittered_array(random, 3, 161, 121, seed % 3 ? -0.25 : 0)),
          view(test::view_into(3, width, height, random.small_rotation(seed % 2 ? 0.05 : 0.5))) {
      if (seed % 5 == 1) view.focus.map = test::depths(random, view, FocalMap::kMinStep, true);
      production = std::make_unique<const test::Production>(rig, build_mesh(rig), view);
      images = test::in_family(family, images_of(rig, random, reference::smooth_image));
      here = there = test::sources_of(rig, production->plan, images);
      for (size_t i = 0; i < here.size(); i++) {
        if (random.integer(0, 7) == 0) {
          here[i].image = there[i].image = {.family = PixelFamily::kNone};
          continue;
        }
        const bool is_other = random.integer(0, 1) == 1, sharpened = random.integer(0, 1) == 1;
        const float gain = random.integer(0, 1) ? static_cast<float>(random.uniform(0.5, 2)) : 1;
        if (random.integer(0, 4) == 0) continue;
        const TexturedImage& image = on_gpu.emplace_back(somebody, images[here[i].camera], is_other);
        there[i].image = image.view(gain, sharpened);
        const Rect all{0, 0, 161, 121};
        ImageView& made = here[i].image = image.fetch();
        if (gain != 1) made = divide_by_gain(made, all, gain, memory.emplace_back());
        if (sharpened) made = sharpen(made, all, memory.emplace_back());
      }
    }
    std::unique_ptr<SumRenderer> renderer(bool of_there, gl::GlesRenderer* gpu,
                                          Coordinates coordinates = Coordinates::kExact) const {
      return std::make_unique<SumRenderer>(production->plan, production->owners.runs(), of_there ? there : here, family,
                                           coordinates, gpu);
    }
    Sum sum_of(const SumRenderer& renderer) const {
      Sum sum(family, test::whole(view));
      renderer.render_rows(0, view.height, sum.planes);
      return sum;
    }
    int fetches() const {
      int all = 0;
      for (const TexturedImage& image : on_gpu) all += image.fetches();
      return all;
    }

    Random random;
    PixelFamily family;
    Rig rig;
    View view;
    std::unique_ptr<const test::Production> production;
    std::vector<Image> images;
    std::list<TexturedImage> on_gpu;
    std::list<ByteBuffer> memory;
    std::vector<Source> here, there;
  };
};
INSTANTIATE_TEST_SUITE_P(, GpuImages, testing::Values(EGL_OPENGL_ES_API, EGL_OPENGL_API), GpuImages::name_of);

// Gains, sharpening and layouts on the GPU: bit-identical to images processed by the CPU and uploaded. Images are
// downloaded only where the GPU is in doubt.
TEST_P(GpuImages, AreSampledOnTheGpu) {
  size_t images = 0;
  for (int seed = 0; seed < 24; seed++) {
    SCOPED_TRACE(seed);
    const Scene scene(somebody_, seed);
    const int before = scene.fetches();
    const auto sent = scene.renderer(false, gpu_.get());
    if (sent->rect().empty()) continue;
    ASSERT_TRUE(sent->drawing().drawn) << sent->drawing().why_not;
    const auto there = scene.renderer(true, gpu_.get());
    ASSERT_TRUE(there->drawing().drawn) << there->drawing().why_not;
    images += scene.on_gpu.size();
    if (gpu_->fixed_up() == 0) {
      EXPECT_EQ(scene.fetches(), before);
    }
    EXPECT_TRUE(scene.sum_of(*there) == scene.sum_of(*sent));
    for (const TexturedImage& image : scene.on_gpu) EXPECT_EQ(image.waited(), 1);
  }
  EXPECT_GT(images, 100u);
}

// A view from a camera's pose, larger than its image: the GPU cannot decide border pixels, so the CPU must.
TEST_P(GpuImages, AreDownloadedForUndecidedSamples) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Random random(1);
    const Rig rig = test::jittered_array(random, 3, 161, 121, 0);
    const Camera& middle = rig.cameras[4];
    View view = test::view_into(3, 201, 161, middle.pose.orientation);
    view.pose.position = middle.pose.position;
    view.lens = Lens::pinhole(middle.lens.fx(), middle.lens.cx() + 20.5, middle.lens.cy() + 20.5);
    const test::Production production(rig, build_mesh(rig), view);
    const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::smooth_image));
    std::vector<Source> here = test::sources_of(rig, production.plan, images), there = here;
    std::list<TexturedImage> on_gpu;
    std::list<ByteBuffer> memory;
    for (size_t i = 0; i < here.size(); i++) {
      there[i].image = on_gpu.emplace_back(somebody_, images[here[i].camera], true).view(0.8f, true);
      const Rect all{0, 0, 161, 121};
      here[i].image =
          sharpen(divide_by_gain(on_gpu.back().fetch(), all, 0.8f, memory.emplace_back()), all, memory.emplace_back());
    }
    const auto sum_of = [&](const std::vector<Source>& sources) {
      const SumRenderer renderer(production.plan, production.owners.runs(), sources, family, Coordinates::kExact,
                                 gpu_.get());
      EXPECT_TRUE(renderer.drawing().drawn) << renderer.drawing().why_not;
      Sum sum(family, test::whole(view));
      renderer.render_rows(0, view.height, sum.planes);
      return sum;
    };
    const Sum sent = sum_of(here);
    EXPECT_TRUE(sum_of(there) == sent);
    const size_t fixed_up = gpu_->fixed_up();
    EXPECT_GT(fixed_up, 200u);
    for (TexturedImage& image : on_gpu) image.lose();
    const Sum gone = sum_of(there);
    size_t more = 0;
    for (size_t i = 0; i < sent.lost.size(); i++) {
      EXPECT_GE(gone.lost[i], sent.lost[i]);
      more += gone.lost[i] > sent.lost[i];
    }
    EXPECT_GT(more, 0u);
    EXPECT_LE(more, fixed_up);
  }
}

TEST_P(GpuImages, AreSharedByTheViewsOfAPass) {
  for (int seed = 0; seed < 4; seed++) {
    SCOPED_TRACE(seed);
    const Scene scene(somebody_, seed);
    std::vector<std::vector<Source>> sources(3, scene.there);
    for (Source& source : sources[1]) source.image.on_gpu.sharpened = !source.image.on_gpu.sharpened;
    for (Source& source : sources[2])
      if (source.image.on_gpu.image) source.image.on_gpu.gain = 1.25;
    std::vector<std::unique_ptr<SumRenderer>> together;
    std::vector<SumRenderer*> all;
    const auto make = [&](const std::vector<Source>& of, gl::GlesRenderer* gpu) {
      return std::make_unique<SumRenderer>(scene.production->plan, scene.production->owners.runs(), of, scene.family,
                                           Coordinates::kExact, gpu);
    };
    for (const auto& of : sources) all.push_back(together.emplace_back(make(of, nullptr)).get());
    SumRenderer::draw(all, *gpu_, serial_for);
    EXPECT_EQ(gpu_->passes(), 1u);
    for (size_t i = 0; i < all.size(); i++) {
      const auto alone = make(sources[i], gpu_.get());
      ASSERT_TRUE(alone->drawing().drawn) << alone->drawing().why_not;
      EXPECT_TRUE(scene.sum_of(*all[i]) == scene.sum_of(*alone)) << i;
    }
  }
}

// Without a GPU, or if the GPU refuses, the CPU gets bit-identical results from downloaded images. Images that cannot
// be downloaded are missing weight.
TEST_P(GpuImages, AreDownloadedForTheCpu) {
  for (int seed = 0; seed < 6; seed++) {
    SCOPED_TRACE(seed);
    Scene scene(somebody_, seed);
    for (const Coordinates coordinates : {Coordinates::kExact, Coordinates::kGrid}) {
      const auto here = scene.renderer(false, nullptr, coordinates), there = scene.renderer(true, nullptr, coordinates);
      if (coordinates == Coordinates::kGrid) there->fetch(serial_for);
      EXPECT_TRUE(scene.sum_of(*there) == scene.sum_of(*here));
    }
    for (TexturedImage& image : scene.on_gpu) image.lose();
    for (size_t i = 0; i < scene.here.size(); i++)
      if (scene.there[i].image.on_gpu.image) scene.here[i].image = {.family = PixelFamily::kNone};
    const auto lost = scene.renderer(false, nullptr), gone = scene.renderer(true, nullptr);
    EXPECT_TRUE(scene.sum_of(*gone) == scene.sum_of(*lost));
  }
  const Scene scene(somebody_, 3);
  gpu_->lose();
  const auto here = scene.renderer(false, nullptr), there = scene.renderer(true, gpu_.get());
  EXPECT_TRUE(there->drawing().refused);
  EXPECT_TRUE(scene.sum_of(*there) == scene.sum_of(*here));
}

TEST_P(GpuImages, AreSampledForHypotheses) {
  for (int seed = 0; seed < 8; seed++) {
    SCOPED_TRACE(seed);
    Scene scene(somebody_, seed, 320, 240);
    View view = scene.view;
    view.focus.map = test::depths(scene.random, view, 16, false);
    const Mesh mesh = build_mesh(scene.rig);
    std::vector<CameraIndex> own;
    for (CameraIndex camera = 0; camera < scene.rig.cameras.size(); camera++) own.push_back(camera);
    const RenderJob job(scene.rig, mesh, hypothesis_view(view), own);
    std::vector<std::vector<uint8_t>> trials;
    for (const uint8_t step : {0, 40, 90}) {
      trials.push_back(job.plan().view().focus.map->levels);
      for (uint8_t& level : trials.back()) level = static_cast<uint8_t>(std::min(level + step, 255));
    }
    const auto consistency_of = [&](const std::vector<Source>& sources, gl::GlesRenderer* gpu) {
      std::vector<PhotoConsistency> sums(trials.size());
      for (PhotoConsistency& sum : sums) sum.reset(job.plan().view().width, job.plan().view().height);
      const GpuStatus drawing = add_consistency(job, sources, trials, sums, serial_for, gpu);
      EXPECT_EQ(drawing.drawn, gpu != nullptr) << drawing.why_not;
      return sums;
    };
    for (gl::GlesRenderer* const gpu : {gpu_.get(), static_cast<gl::GlesRenderer*>(nullptr)}) {
      const auto here = consistency_of(scene.here, gpu), there = consistency_of(scene.there, gpu);
      for (size_t t = 0; t < trials.size(); t++) {
        EXPECT_TRUE(there[t].weight == here[t].weight);
        EXPECT_TRUE(there[t].luma == here[t].luma);
        EXPECT_TRUE(there[t].square == here[t].square);
      }
    }
  }
}

}  // namespace
}  // namespace lf
