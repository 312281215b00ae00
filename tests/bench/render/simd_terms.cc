// SPDX-License-Identifier: LGPL-2.1-or-later
// What the steps of the SIMD renderer add, by its own code compiled for the least this processor family has.
#include <hwy/highway.h>

#include <algorithm>

#include "bench/render/collector.h"
#include "composite/accumulator.h"
#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"
#include "quality/quality.h"
#include "reference/renderer.h"
#include "render/ownership.h"
#include "render/simd/plane-inl.h"
#include "render/simd/sum_task.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::bench {
namespace {

// The whole view of a scene, and what is rendered of it.
struct Ready {
  explicit Ready(const Scene& scene, bool seeing = true)
      : scene(scene),
        view(scene.views().front()),
        job(scene.rig(), scene.mesh(), view, scene.cameras()),
        all{0, 0, view.width, view.height} {
    for (const CameraIndex camera : job.cameras()) {
      sources.push_back({camera, &scene.rig().cameras[camera], {}});
      if (seeing) sources.back().image = scene.image(camera, Pixels::kI420);
    }
  }
  const Scene& scene;
  const View& view;
  const RenderJob job;
  const Rect all;
  std::vector<Source> sources;
};

struct Sum {
  Sum(const Ready& ready, std::span<const Source> sources, Coordinates coordinates)
      : samples(packed_size(PixelFamily::kI420, ready.all.width(), ready.all.height())),
        lost(static_cast<size_t>(ready.all.width()) * ready.all.height()) {
    const SumRenderer renderer(ready.job.plan(), ready.job.runs(), sources, PixelFamily::kI420, coordinates);
    const bool any_lost =
        renderer.render_rows(0, ready.all.y1, packed_sums(PixelFamily::kI420, ready.all, samples.data(), lost.data()));
    planes = packed_sums<const int16_t, const uint16_t>(PixelFamily::kI420, ready.all, samples.data(),
                                                        any_lost ? lost.data() : nullptr);
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  ConstSumPlanes planes;
};

// A camera without a picture loses its weight: that shows it as it is.
Spread simd_weights(const Scene& scene) {
  const Ready ready(scene, false);
  const reference::Picture exact = reference::render(scene.rig(), scene.mesh(), ready.view, {});
  Collector errors;
  for (const Source& source : ready.sources) {
    const Sum sum(ready, {&source, 1}, Coordinates::kGrid);
    size_t i = 0;
    for (int y = 0; y < ready.view.height; y++)
      for (int x = 0; x < ready.view.width; x++, i++)
        if (const double weight = exact.weight_of(x, y, source.camera); weight != 0)
          errors.add(sum.lost[i] / double{kLostOne} - weight);
  }
  return errors.spread();
}

// --- positions -------------------------------------------------------------------------------------------------------

namespace target = simd::HWY_NAMESPACE;

struct Place {
  const simd::Slot& slot;
  const simd::SlotBand& band;
  const Rays& rays;
  int row;    // of the band
  int block;  // of the band; its node on the left is entry() + 1
  int entry() const { return row * band.pitch + block; }
  int x() const { return (band.first_block + block) * simd::kBlock; }  // of the view
  std::optional<Vec2> exact(int x) const {
    Vec2 position;
    if (!slot.projection->project_beyond(rays.at(x, band.y + row), 0, position)) return std::nullopt;
    return position;
  }
};

// visit(place) for all rows of all blocks that are interpolated.
template <class Visit>
Spread in_blocks(const Scene& scene, bool shuffled_alone, const Visit& visit) {
  const Ready ready(scene);
  const simd::PreparedTask prepared(ready.job.plan(), ready.job.runs(), ready.sources, PixelFamily::kI420,
                                    Coordinates::kGrid);
  Collector errors;
  for (const simd::Slot& slot : prepared.task.slots) {
    simd::SlotBand band;
    for (int y = slot.rect.y0 / simd::kBandRows * simd::kBandRows; y < slot.rect.y1; y += simd::kBandRows) {
      band.y = y;
      band.slot = &slot;
      band.first_block = slot.rect.x0 / simd::kBlock;
      band.blocks = (slot.rect.x1 + simd::kBlock - 1) / simd::kBlock - band.first_block;
      target::place_plane(true, slot, y, band);
      for (int row = std::max(slot.rect.y0 - y, 0); row < std::min(slot.rect.y1 - y, simd::kBandRows); row++)
        for (int block = 0; block < band.blocks; block++) {
          const int verdict =
              band.calm ? simd::SlotBand::kShuffle : band.verdict[static_cast<size_t>(row / 2 * band.pitch + block)];
          if (verdict == simd::SlotBand::kShuffle || (!shuffled_alone && verdict == simd::SlotBand::kSample))
            visit(Place{slot, band, ready.job.plan().rays(), row, block}, errors);
        }
    }
  }
  return errors.spread();
}

// Positions at the ends of blocks.
Spread projection(const Scene& scene) {
  return in_blocks(scene, false, [](const Place& at, Collector& errors) {
    for (int end = 0; end < 2; end++) {
      const auto exact = at.exact(at.x() + end * simd::kBlock);
      const auto entry = static_cast<size_t>(at.entry() + 1 + end);
      if (!exact) continue;
      errors.add(at.band.luma.node_x[entry] - exact->x);
      errors.add(at.band.luma.node_y[entry] - exact->y);
    }
  });
}

// Bessel's rule on four values, at `t` from the second to the third.
double interpolated(const double (&v)[4], double t) {
  return v[1] + t * (v[2] - v[1]) + t * (t - 1) / 4 * (v[3] - v[2] - v[1] + v[0]);
}

// Between exact positions at the ends of blocks.
Spread grid(const Scene& scene) {
  return in_blocks(scene, false, [](const Place& at, Collector& errors) {
    double x[4], y[4];
    for (int k = 0; k < 4; k++) {
      const auto node = at.exact(at.x() + (k - 1) * simd::kBlock);
      if (!node) return;
      x[k] = node->x;
      y[k] = node->y;
    }
    for (int i = 0; i < simd::kBlock; i++)
      if (const auto exact = at.exact(at.x() + i)) {
        const double t = static_cast<double>(i) / simd::kBlock;
        errors.add(interpolated(x, t) - exact->x);
        errors.add(interpolated(y, t) - exact->y);
      }
  });
}

// As sample_windows() finds them, beside the same interpolation in double.
Spread fixed_point(const Scene& scene) {
  return in_blocks(scene, true, [](const Place& at, Collector& errors) {
    const simd::PlanePositions& luma = at.band.luma;
    const auto entry = static_cast<size_t>(at.entry());
    const simd::WindowPositions& window = luma.window[entry];
    const auto corner = luma.corner[entry], stride = static_cast<int32_t>(at.slot.image.stride[0]);
    double x[4], y[4];
    for (size_t k = 0; k < 4; k++) {
      x[k] = luma.node_x[entry + k];
      y[k] = luma.node_y[entry + k];
    }
    const auto times15 = [](int a, int b) { return (a * b + (1 << 14)) >> 15; };
    for (int i = 0; i < simd::kBlock; i++) {
      const auto whole = [&](int v) { return static_cast<double>(v) / (1 << simd::kPositionBits); };
      const double t = static_cast<double>(i) / simd::kBlock;
      const int bessel15 = static_cast<int16_t>(target::bessel(static_cast<float>(t)) * 32768 - 0.5f);
      const int fx =
          window.x0 + static_cast<int>((uint32_t{window.dx} * (i << 12)) >> 16) + times15(window.sx, bessel15);
      const int fy = window.y0 + times15(window.dy, i << 11) + times15(window.sy, bessel15);
      errors.add(corner % stride + whole(fx) - interpolated(x, t));
      errors.add(corner / stride + whole(fy) - interpolated(y, t));
    }
  });
}

// --- pictures --------------------------------------------------------------------------------------------------------

// The luma of sums in 16 bits, not rounded.
template <Coordinates kCoordinates>
Spread sums(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, kCoordinates);
  const FloatStill& exact = scene.exact(PixelFamily::kI420);
  Collector errors;
  for (size_t i = 0; i < exact.valid.size(); i++)
    if (exact.valid[i] > kCovered) errors.add(sum.samples[i] / double{1 << kSumFractionBits} - exact.colour[i]);
  return errors.spread();
}

Spread picture(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, Coordinates::kGrid);
  Accumulator accumulator;
  accumulator.reset(PixelFamily::kI420, ready.view.width, ready.view.height);
  accumulator.add_kept(sum.planes);
  const Image picture = accumulator.resolve();
  const FloatStill& exact = scene.exact(PixelFamily::kI420);
  Collector errors;
  for (size_t i = 0; i < exact.valid.size(); i++)
    if (exact.valid[i] > kCovered) errors.add(picture.data()[i] - exact.colour[i]);
  return errors.spread();
}

// A node's sum through JPEG and back.
template <int kQuality, int kPlane>
Spread jpeg_of_sum(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, Coordinates::kGrid);
  const Fragment fragment = rounded_fragment(sum.planes);
  const FragmentPlanes before = planes_of(fragment);
  FragmentPlanes after{.family = before.family, .rect = before.rect};
  ByteBuffer scan;
  jpeg::FragmentEncoder().encode_pixels(before, kQuality, scan);
  jpeg::FragmentDecoder decoder;
  decoder.decode_pixels(scan, kQuality, after);
  const auto value = [](const FragmentPlanes& planes, int x, int y) -> int {
    const uint8_t byte = planes.plane[kPlane][y * planes.stride[kPlane] + x];
    return kPlane == 0 ? byte : static_cast<int8_t>(byte);
  };
  Collector errors;
  for (int y = 0; y < plane_height(before.family, before.rect, kPlane); y++)
    for (int x = 0; x < plane_width(before.family, before.rect, kPlane); x++)
      errors.add(value(after, x, y) - value(before, x, y));
  return errors.spread();
}

}  // namespace

std::vector<Term> simd_terms() {
  // Positions good to 1/256 pixel between samples of 0 and 255 along both axes, and the sums' own: see error-budget.md.
  return {{"SIMD: weights in 15 bits", "of 1", 2.5 / 32768, simd_weights},
          {"SIMD: coordinates in float", "pixels", 1.0 / 4096, projection},
          {"SIMD: between coordinates 16 pixels apart", "pixels", kGridError, grid},
          {"SIMD: coordinates in 11 bits of fraction", "pixels", 3.0 / 2048, fixed_point},
          {"SIMD: sums in 16 bits, exact coordinates", "of 255", 0.1, sums<Coordinates::kExact>},
          {"SIMD: sums in 16 bits, with all of these", "of 255", 0.75, sums<Coordinates::kGrid>},
          {"SIMD: the same, rounded once", "of 255", 1, picture},
          {"JPEG 50, luma of a node's sum", "of 255", 0, jpeg_of_sum<50, 0>},
          {"JPEG 75, luma of a node's sum", "of 255", 0, jpeg_of_sum<75, 0>},
          {"JPEG 90, luma of a node's sum", "of 255", 0, jpeg_of_sum<90, 0>},
          {"JPEG 95, luma of a node's sum", "of 255", 0, jpeg_of_sum<95, 0>},
          {"JPEG 90, chroma of a node's sum", "of 255", 0, jpeg_of_sum<90, 1>}};
}

}  // namespace lf::bench
