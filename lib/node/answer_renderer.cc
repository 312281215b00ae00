// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_renderer.h"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <vector>

#include "base/now.h"
#include "render/fragment_set.h"
#include "render/sum_rounding.h"
#include "wire/answer_writer.h"
#include "wire/fragment_codec.h"
#include "wire/strips.h"

namespace lf {
namespace {

// Rows of a task where rows go straight into the answer: a multiple of the renderer's bands (8 rows) and of what two
// threads may write without sharing a cache line.
constexpr int kBandRows = 32;

// One fragment of 16-bit values, rendered where it travels.
void write_sums(wire::AnswerWriter& writer, const SumRenderer& renderer, CameraIndex camera, PixelFamily family,
                const ParallelFor& parallel) {
  const Rect rect = renderer.rect();
  if (rect.empty()) return;
  const SumPlanes out = writer.add_sums({camera, family, rect, wire::Codec::kRaw16, 0, true});
  const std::vector<Rect> bands = wire::cut_rows(rect, kBandRows);
  std::atomic<bool> any_lost = false;
  parallel(bands.size(), [&](size_t i) {
    if (renderer.render_rows(bands[i].y0, bands[i].y1, out)) any_lost = true;
  });
  if (!any_lost) writer.drop_lost();
}

RenderedAnswer render_sums16(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             bool sum, ByteBuffer memory, const ParallelFor& parallel) {
  wire::AnswerWriter writer(header, sum ? 1 : sources.size(), std::move(memory));
  if (sum) {
    write_sums(writer, {job.plan(), job.runs(), sources, header.family}, Fragment::kSum, header.family, parallel);
  } else {
    for (const Source& source : sources)
      if (source.image.family != PixelFamily::kNone)
        write_sums(writer, {job.plan(), job.runs(), {&source, 1}, header.family}, source.camera, header.family,
                   parallel);
  }
  const size_t fragments = writer.fragments();
  return {.bytes = writer.finish(), .fragments = fragments};
}

Fragment render_strip(const SumRenderer& renderer, const Rect& rect, PixelFamily family) {
  thread_local UninitializedVector<int16_t> samples;
  thread_local UninitializedVector<uint16_t> lost;
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  samples.resize(std::max(samples.size(), 3 * area));
  lost.resize(std::max(lost.size(), area));
  const SumPlanes out = packed_sums(family, rect, samples.data(), lost.data());
  const bool any_lost = renderer.render_rows(rect.y0, rect.y1, out);
  return rounded_fragment(Fragment::kSum, packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(),
                                                                                     any_lost ? lost.data() : nullptr));
}

std::vector<Fragment> render_strips(const RenderJob& job, std::span<const Source> sources, PixelFamily family,
                                    int strip_pixels, const ParallelFor& parallel) {
  const SumRenderer renderer(job.plan(), job.runs(), sources, family);
  const Rect rect = renderer.rect();
  if (rect.empty()) return {};
  const std::vector<Rect> strips = wire::cut_rows(rect, wire::strip_rows(rect.width(), strip_pixels));
  std::vector<Fragment> fragments(strips.size());
  parallel(strips.size(), [&](size_t i) { fragments[i] = render_strip(renderer, strips[i], family); });
  return fragments;
}

// In memory of `set`. Cameras without an image give nothing.
std::span<const CameraFragment> render_cameras(const RenderJob& job, std::span<const Source> sources,
                                               PixelFamily family, FragmentSet& set, const ParallelFor& parallel) {
  std::vector<Source> seeing;
  std::ranges::copy_if(sources, std::back_inserter(seeing),
                       [](const Source& source) { return source.image.family != PixelFamily::kNone; });
  set.begin(job.plan(), job.runs(), seeing, family);
  const std::vector<Rect> bands = wire::cut_rows(set.rect(), kBandRows);
  parallel(bands.size(), [&](size_t i) { set.render_rows(bands[i].y0, bands[i].y1); });
  return set.fragments();
}

}  // namespace

RenderedAnswer render_answer(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             const AnswerForm& form, ByteBuffer memory, const ParallelFor& parallel) {
  const uint64_t begin = now_ns();
  RenderedAnswer answer;
  if (header.family == PixelFamily::kNone) {  // no camera has an image yet
    answer.bytes = wire::AnswerWriter(header, 0, std::move(memory)).finish();
  } else if (form.codec == wire::Codec::kRaw16) {
    answer = render_sums16(header, job, sources, form.sum, std::move(memory), parallel);
    answer.render_ns = now_ns() - begin;
  } else {
    thread_local FragmentSet set;
    std::vector<Fragment> strips;
    std::vector<CameraFragment> strip_planes;
    std::span<const CameraFragment> fragments;
    if (form.sum) {
      strips = render_strips(job, sources, header.family, form.strip_pixels, parallel);
      for (const Fragment& strip : strips) strip_planes.push_back({strip.camera, planes_of(strip)});
      fragments = strip_planes;
    } else {
      fragments = render_cameras(job, sources, header.family, set, parallel);
    }
    const uint64_t rendered = now_ns();
    answer.bytes = wire::encode_fragments(header, fragments, form.quality, std::move(memory), parallel);
    answer.fragments = fragments.size();
    answer.render_ns = rendered - begin;
    answer.encode_ns = now_ns() - rendered;
  }
  return answer;
}

}  // namespace lf
