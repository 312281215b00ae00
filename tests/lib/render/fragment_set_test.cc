// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/fragment_set.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>

#include "lib/render/sum_arrays.h"
#include "reference/renderer.h"
#include "render/sum_rounding.h"

namespace lf {
namespace {

using reference::Random;
using test::depths, test::jittered_array, test::sources_of, test::Sum, test::view_into;

// Fragments are what the sum of one camera rounds to, whatever the others are.
TEST(FragmentSet, IsEachCamerasSumRounded) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (int trial = 0; trial < 4; trial++) {
        Random random(trial);
        const int width = trial == 1 ? 93 : 128, height = trial == 1 ? 71 : 96;
        const Rig rig = jittered_array(random, 4, width, height, -0.25);
        View view = view_into(rig, 4, width, height, random.small_rotation(0.2));
        if (trial == 1) view.focus.map = depths(random, view, FocalMap::kFinestStep, false);
        if (trial >= 2) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * width, 63.5, 47.5, -0.1});
        if (trial == 3) view.blending = Blending{Blending::Kind::kAperture, 0.25, 0};
        const Mesh mesh = build_mesh(rig);
        const ViewPlan plan(rig, mesh, view);
        const OwnerRuns runs(plan, test::whole(view));
        const auto rgb = images_of(rig, random, reference::noise_image);
        const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
        std::vector<Source> sources = sources_of(rig, plan, images);
        sources[1].image.family = PixelFamily::kNone;  // no picture: all lost
        for (size_t i = 2; i < sources.size(); i += 3) sources[i].resampling = Resampling::kCatmullRom;
        FragmentSet set;
        set.begin(plan, runs, sources, family);
        // Bands in another order and of other heights than all at once.
        for (int y = (set.rect().y1 - 1) / 16 * 16; y >= 0; y -= 16)
          if (y + 16 > set.rect().y0) set.render_rows(std::max(y, set.rect().y0), std::min(y + 16, set.rect().y1));
        for (const CameraFragment& fragment : set.fragments()) {
          const Source source = *std::ranges::find(sources, fragment.camera, &Source::camera);
          Rect owned = CameraCorners(plan, fragment.camera).owned(runs, plan.camera_rect(fragment.camera));
          if (family == PixelFamily::kI420) owned = chroma_aligned(owned, view);
          ASSERT_EQ(fragment.planes.rect, owned);
          const SumRenderer renderer(plan, runs, {&source, 1}, family);
          Sum sum(family, fragment.planes.rect);
          const bool lost = renderer.render_rows(fragment.planes.rect.y0, fragment.planes.rect.y1, sum.planes);
          ConstSumPlanes sums{.family = family,
                              .rect = fragment.planes.rect,
                              .lost = lost ? sum.lost.data() : nullptr,
                              .lost_stride = sum.planes.lost_stride};
          for (int c = 0; c < 3; c++) {
            sums.plane[c] = sum.planes.plane[c];
            sums.stride[c] = sum.planes.stride[c];
          }
          const Fragment expected = rounded_fragment(fragment.camera, sums);
          const FragmentPlanes planes = planes_of(expected);
          const int w = planes.rect.width(), h = planes.rect.height();
          ASSERT_EQ(fragment.planes.lost != nullptr, planes.lost != nullptr);
          for (int y = 0; y < h; y++) {
            const auto row = [&](const FragmentPlanes& p, int c, int n) {
              const uint8_t* at = p.plane[c] + y * p.stride[c];
              return std::vector<uint8_t>(at, at + n);
            };
            ASSERT_EQ(row(fragment.planes, 0, family == PixelFamily::kI420 ? w : 3 * w),
                      row(planes, 0, family == PixelFamily::kI420 ? w : 3 * w))
                << "camera " << fragment.camera << " row " << y;
            for (int c = 1; c < 3 && family == PixelFamily::kI420 && y < chroma_size(h); c++)
              ASSERT_EQ(row(fragment.planes, c, chroma_size(w)), row(planes, c, chroma_size(w)));
            for (int x = 0; planes.lost && x < w; x++)
              ASSERT_EQ(fragment.planes.lost[y * fragment.planes.lost_stride + x],
                        planes.lost[y * planes.lost_stride + x]);
          }
        }
        EXPECT_GT(set.fragments().size(), 8u);
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace lf
