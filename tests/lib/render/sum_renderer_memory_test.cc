// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <gtest/gtest.h>

#include <sys/mman.h>
#include <unistd.h>

#include <memory>

#include <hwy/targets.h>

#include "lib/render/sum_arrays.h"
#include "reference/renderer.h"

namespace lf {
namespace {

using reference::Random;
using test::depths, test::jittered_array, test::sources_of, test::Sum, test::view_into;

// An image whose planes end where memory does or, `at_front`, begin where it does.
class GuardedImage {
 public:
  GuardedImage(const ImageView& from, bool at_front) : view_(from) {
    const bool i420 = from.family == PixelFamily::kI420;
    for (int c = 0; c < (i420 ? 3 : 1); c++) {
      const int rows = c > 0 ? chroma_size(from.height) : from.height;
      const int width = c > 0 ? chroma_size(from.width) : i420 ? from.width : 3 * from.width;
      const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE)), size = static_cast<size_t>(rows) * width;
      const size_t pages = (size + page - 1) / page * page;
      auto* const memory = static_cast<uint8_t*>(
          mmap(nullptr, pages + 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
      EXPECT_NE(static_cast<void*>(memory), MAP_FAILED);
      memory_.push_back({memory, pages + 2 * page});
      uint8_t* const plane = memory + page + (at_front ? 0 : pages - size);
      for (int y = 0; y < rows; y++) std::copy_n(from.plane[c] + y * from.stride[c], width, plane + y * width);
      mprotect(memory, page, PROT_NONE);
      mprotect(memory + page + pages, page, PROT_NONE);
      view_.plane[c] = plane;
      view_.stride[c] = width;
    }
  }
  GuardedImage(const GuardedImage&) = delete;
  GuardedImage& operator=(const GuardedImage&) = delete;
  ~GuardedImage() {
    for (const auto& [memory, size] : memory_) munmap(memory, size);
  }
  const ImageView& view() const { return view_; }

 private:
  ImageView view_;
  std::vector<std::pair<uint8_t*, size_t>> memory_;
};

// Views that see all of the cameras' borders, at several scales.
TEST(SumRenderer, ReadsNothingOutsideOfImages) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (int trial = 0; trial < 12; trial++) {
        Random random(trial);
        const int width = trial % 2 ? 93 : 96, height = trial % 2 ? 71 : 72;
        const Rig rig = jittered_array(random, 3, width, height, trial % 3 == 0 ? 0 : -0.1);
        View view = view_into(rig, 3, width, height, random.small_rotation(0.1));
        view.lens = Lens::pinhole(width * random.uniform(0.6, 1.4), (width - 1) / 2.0, (height - 1) / 2.0);
        if (trial % 4) view.focus.map = depths(random, view, FocalMap::kFinestStep, trial % 4 == 3);
        const Mesh mesh = build_mesh(rig);
        const test::Production production(rig, mesh, view);
        const auto rgb = images_of(rig, random, reference::noise_image);
        const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
        const std::vector<Source> sources = sources_of(rig, production.plan, images);
        for (const bool at_front : {false, true}) {
          std::vector<std::unique_ptr<GuardedImage>> guarded;
          std::vector<Source> all = sources;
          for (Source& source : all) {
            guarded.push_back(std::make_unique<GuardedImage>(source.image, at_front));
            source.image = guarded.back()->view();
          }
          const SumRenderer renderer(production.plan, production.owners.runs(), all, family);
          Sum sum(family, renderer.rect());
          renderer.render_rows(renderer.rect().y0, renderer.rect().y1, sum.planes);
        }
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace lf
