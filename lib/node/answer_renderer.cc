// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_renderer.h"

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "base/schedule.h"
#include "render/gl/card_sum.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"
#include "wire/answer_writer.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"
#include "wire/strips.h"

namespace lf {
namespace {

// Rows of a task where rows go straight into the answer: a multiple of the renderer's bands (8 rows) and of what two
// threads may write without sharing a cache line.
constexpr int kBandRows = 32;

// Rendered where they travel.
RenderedAnswer render_sums16(const wire::AnswerHeader& header, const SumRenderer& renderer, std::span<const Rect> tiles,
                             ByteBuffer memory, const ParallelFor& parallel) {
  wire::AnswerWriter writer(header, tiles.size(), std::move(memory));
  std::vector<wire::FragmentHeader> fragments;
  size_t bytes = 0;
  for (const Rect& tile : tiles) {
    fragments.push_back({{}, header.family, tile, wire::Codec::kRaw16, 0, true});
    bytes += wire::raw_size(fragments.back());
  }
  writer.reserve_payloads(bytes);
  std::vector<SumPlanes> planes;
  std::vector<std::pair<size_t, Rect>> bands;  // of which tile
  for (size_t i = 0; i < tiles.size(); i++) {
    planes.push_back(writer.add_sums(fragments[i]));
    for (const Rect& band : wire::cut_rows(tiles[i], kBandRows)) bands.emplace_back(i, band);
  }
  std::vector<std::atomic<bool>> any_lost(tiles.size());
  parallel(bands.size(), [&](size_t i) {
    const auto& [tile, band] = bands[i];
    if (renderer.render_rows(band.y0, band.y1, planes[tile])) any_lost[tile] = true;
  });
  writer.drop_lost([&](size_t i) { return !any_lost[i]; });
  return {.bytes = writer.finish(), .fragments = tiles.size()};
}

// What comes before a sum that has stayed on a card.
RenderedAnswer before(const wire::AnswerHeader& header, std::shared_ptr<gl::CardSum> sum, ByteBuffer memory) {
  wire::AnswerWriter writer(header, 1, std::move(memory));
  const size_t payload =
      writer.add(wire::FragmentHeader{{}, header.family, sum->view(), wire::Codec::kRaw16, 0, sum->has_lost()}).size();
  ByteBuffer bytes = writer.finish();
  bytes.resize(bytes.size() - payload);
  return {.bytes = std::move(bytes), .fragments = 1, .payload = std::move(sum)};
}

Fragment render_strip(const SumRenderer& renderer, const Rect& rect, PixelFamily family) {
  thread_local UninitializedVector<int16_t> samples;
  thread_local UninitializedVector<uint16_t> lost;
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  samples.resize(std::max(samples.size(), 3 * area));
  lost.resize(std::max(lost.size(), area));
  const SumPlanes out = packed_sums(family, rect, samples.data(), lost.data());
  const bool any_lost = renderer.render_rows(rect.y0, rect.y1, out);
  return rounded_fragment(
      packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), any_lost ? lost.data() : nullptr));
}

std::vector<Fragment> render_strips(const SumRenderer& renderer, std::span<const Rect> tiles, PixelFamily family,
                                    int strip_pixels, const ParallelFor& parallel) {
  std::vector<Rect> strips;
  for (const Rect& tile : tiles)
    for (const Rect& strip : wire::cut_rows(tile, wire::strip_rows(tile.width(), strip_pixels)))
      strips.push_back(strip);
  std::vector<Fragment> fragments(strips.size());
  parallel(strips.size(), [&](size_t i) { fragments[i] = render_strip(renderer, strips[i], family); });
  return fragments;
}

void tell_of(const SumRenderer& renderer, RenderedAnswer& answer) {
  answer.drawing = renderer.drawing();
  answer.pixels = static_cast<size_t>(renderer.rect().width()) * renderer.rect().height();
}

}  // namespace

RenderedAnswer render_answer(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             const AnswerForm& form, ByteBuffer memory, const ParallelFor& parallel) {
  if (header.family == PixelFamily::kNone)  // no camera has an image yet
    return {.bytes = wire::AnswerWriter(header, 0, std::move(memory)).finish()};
  const uint64_t begin = now_ns();
  const SumRenderer renderer(job.plan(), job.runs(), sources, header.family, Coordinates::kGrid, form.card, parallel,
                             form.may_stay && form.codec == wire::Codec::kRaw16);
  if (std::shared_ptr<gl::CardSum> sum = renderer.card_sum()) {
    RenderedAnswer answer = before(header, std::move(sum), std::move(memory));
    tell_of(renderer, answer);
    answer.render_ns = now_ns() - begin;
    return answer;
  }
  std::vector<CameraIndex> cameras;
  for (const Source& source : sources) cameras.push_back(source.camera);
  const std::vector<Rect> tiles = sum_tiles(job.plan(), job.runs(), cameras, header.family, form.spare_pixels);
  RenderedAnswer answer;
  if (form.codec == wire::Codec::kRaw16) {
    answer = render_sums16(header, renderer, tiles, std::move(memory), parallel);
    tell_of(renderer, answer);
    answer.render_ns = now_ns() - begin;
    return answer;
  }
  const std::vector<Fragment> strips = render_strips(renderer, tiles, header.family, form.strip_pixels, parallel);
  const uint64_t rendered = now_ns();
  std::vector<wire::AnswerFragment> fragments;
  for (const Fragment& strip : strips) fragments.push_back({{}, planes_of(strip)});
  answer.bytes = wire::encode_fragments(header, fragments, form.quality, std::move(memory), parallel);
  answer.fragments = fragments.size();
  tell_of(renderer, answer);
  answer.render_ns = rendered - begin;
  answer.encode_ns = now_ns() - rendered;
  return answer;
}

}  // namespace lf
