// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_renderer.h"

#include <algorithm>
#include <atomic>
#include <optional>
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
      writer.add(wire::FragmentHeader{{}, header.family, sum->rect(), wire::Codec::kRaw16, 0, sum->has_lost()}).size();
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

class PendingSum : public PendingAnswer {
 public:
  PendingSum(const wire::AnswerHeader& header, const RenderJob& job, std::vector<Source> sources,
             const AnswerForm& form)
      : header_(header), job_(job), sources_(std::move(sources)), form_(form) {
    const uint64_t begun = now_ns();
    if (header_.family != PixelFamily::kNone)  // else no camera has an image yet
      renderer_.emplace(job_.plan(), job_.runs(), sources_, header_.family, Coordinates::kGrid, nullptr, serial_for,
                        form_.may_stay && form_.codec == wire::Codec::kRaw16);
    ns_ = now_ns() - begun;
  }
  SumRenderer* sum() override { return renderer_ ? &*renderer_ : nullptr; }
  RenderedAnswer finish(ByteBuffer memory, const ParallelFor& parallel) override {
    if (!renderer_) return {.bytes = wire::AnswerWriter(header_, 0, std::move(memory)).finish()};
    const uint64_t begun = now_ns();
    renderer_->fetch(parallel);
    RenderedAnswer answer = write(std::move(memory), parallel);
    answer.drawing = renderer_->drawing();
    const Rect& rect = renderer_->rect();
    answer.pixels = job_.plan().blend() ? renderer_->samples() / 3 : static_cast<size_t>(rect.width()) * rect.height();
    answer.render_ns = ns_ + (now_ns() - begun) - answer.encode_ns;
    return answer;
  }

 private:
  RenderedAnswer write(ByteBuffer memory, const ParallelFor& parallel) const {
    if (std::shared_ptr<gl::CardSum> sum = renderer_->card_sum())
      return before(header_, std::move(sum), std::move(memory));
    std::vector<CameraIndex> cameras;
    for (const Source& source : sources_) cameras.push_back(source.camera);
    const std::vector<Rect> tiles = sum_tiles(job_.plan(), job_.runs(), cameras, header_.family, form_.spare_pixels);
    if (form_.codec == wire::Codec::kRaw16)
      return render_sums16(header_, *renderer_, tiles, std::move(memory), parallel);
    const std::vector<Fragment> strips = render_strips(*renderer_, tiles, header_.family, form_.strip_pixels, parallel);
    const uint64_t rendered = now_ns();
    std::vector<wire::AnswerFragment> fragments;
    for (const Fragment& strip : strips) fragments.push_back({{}, planes_of(strip)});
    RenderedAnswer answer;
    answer.bytes = wire::encode_fragments(header_, fragments, form_.quality, std::move(memory), parallel);
    answer.fragments = fragments.size();
    answer.encode_ns = now_ns() - rendered;
    return answer;
  }

  const wire::AnswerHeader header_;
  const RenderJob& job_;
  const std::vector<Source> sources_;
  const AnswerForm form_;
  std::optional<SumRenderer> renderer_;
  uint64_t ns_ = 0;  // of rendering so far
};

}  // namespace

std::unique_ptr<PendingAnswer> begin_answer(const wire::AnswerHeader& header, const RenderJob& job,
                                            std::vector<Source> sources, const AnswerForm& form) {
  return std::make_unique<PendingSum>(header, job, std::move(sources), form);
}

std::vector<RenderedAnswer> finish_answers(std::span<PendingAnswer* const> answers, gl::SumDrawer* card,
                                           const std::function<ByteBuffer()>& memory, const ParallelFor& parallel) {
  const uint64_t begun = now_ns();
  std::vector<SumRenderer*> sums;
  for (PendingAnswer* const answer : answers)
    if (SumRenderer* const sum = answer->sum()) sums.push_back(sum);
  if (card && !sums.empty()) SumRenderer::draw(sums, *card, parallel);
  const uint64_t drawing = now_ns() - begun;
  std::vector<RenderedAnswer> finished;
  for (PendingAnswer* const answer : answers) {
    finished.push_back(answer->finish(memory(), parallel));
    if (answer->sum()) finished.back().render_ns += drawing / sums.size();
  }
  return finished;
}

RenderedAnswer render_answer(const wire::AnswerHeader& header, const RenderJob& job, std::span<const Source> sources,
                             const AnswerForm& form, ByteBuffer memory, const ParallelFor& parallel) {
  PendingSum answer(header, job, {sources.begin(), sources.end()}, form);
  PendingAnswer* const only = &answer;
  return std::move(finish_answers(
                       {&only, 1}, form.card, [&] { return std::move(memory); }, parallel)
                       .front());
}

}  // namespace lf
