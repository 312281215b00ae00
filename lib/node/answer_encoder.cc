// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_encoder.h"

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "base/schedule.h"
#include "node/request_plan.h"
#include "node/request_renderer.h"
#include "render/gl/gpu_sum.h"
#include "render/sum_planes.h"
#include "wire/fragment_codec.h"

namespace lf {

Coding choose_coding(CodecChoice codec, bool in_process, int quality) {
  if (codec == CodecChoice::kRaw16 || (codec == CodecChoice::kAuto && in_process)) return {wire::Codec::kRaw16, 0};
  if (codec != CodecChoice::kRaw && quality > 0) return {wire::Codec::kJpeg, quality};
  return {wire::Codec::kRaw, 0};
}

// If answers are sent over a network, one more fragment costs at least 20 bytes for its entry in the fragment table.
// JPEG needs only 4 bytes for 16 x 16 empty pixels, so a fragment must save many pixels. Within a process, a fragment
// costs only about a microsecond, but the compositor can use a single sum of the whole view without a copy.
size_t max_extra_pixels(const View& view, wire::Codec codec, bool in_process) {
  if (in_process) return static_cast<size_t>(view.width) * view.height / 4;
  return codec == wire::Codec::kJpeg ? 12 * 16 * 16 : 16;
}

namespace {

// A multiple of the renderer's bands (8 rows), so that two threads never share a cache line.
constexpr int kBandRows = 32;

void encode_sums16(const wire::AnswerHeader& header, const SumRenderer& renderer, std::span<const Rect> tiles,
                   const ParallelFor& parallel, ByteBuffer memory, RenderedAnswer& answer) {
  wire::AnswerWriter writer(header, tiles.size(), std::move(memory));
  std::vector<wire::FragmentHeader> fragments;
  size_t bytes = 0;
  for (const Rect& tile : tiles) {
    fragments.push_back({{}, header.family, tile, wire::Codec::kRaw16, 0, true});
    bytes += wire::raw_size(fragments.back());
  }
  writer.reserve_payloads(bytes);
  std::vector<SumPlanes> planes;
  std::vector<std::pair<size_t, Rect>> bands;  // (tile index, rows)
  for (size_t i = 0; i < tiles.size(); i++) {
    planes.push_back(writer.add_sums(fragments[i]));
    for (const Rect& band : wire::cut_rows(tiles[i], kBandRows)) bands.emplace_back(i, band);
  }
  std::vector<std::atomic<bool>> any_missing(tiles.size());
  parallel(bands.size(), [&](size_t i) {
    const auto& [tile, band] = bands[i];
    if (renderer.render_rows(band.y0, band.y1, planes[tile])) any_missing[tile] = true;
  });
  writer.drop_missing([&](size_t i) { return !any_missing[i]; });
  answer.bytes = writer.finish();
  answer.fragments = tiles.size();
}

void encode_gpu_sum(const wire::AnswerHeader& header, std::shared_ptr<gl::GpuSum> sum, ByteBuffer memory,
                    RenderedAnswer& answer) {
  wire::AnswerWriter writer(header, 1, std::move(memory));
  const size_t payload =
      writer.add(wire::FragmentHeader{{}, header.family, sum->rect(), wire::Codec::kRaw16, 0, sum->has_missing()})
          .size();
  answer.bytes = writer.finish();
  answer.bytes.resize(answer.bytes.size() - payload);
  answer.fragments = 1;
  answer.payload = std::move(sum);
}

Fragment render_strip(const SumRenderer& renderer, const Rect& rect, PixelFamily family) {
  thread_local UninitializedVector<int16_t> samples;
  thread_local UninitializedVector<uint16_t> lost;
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  samples.resize(std::max(samples.size(), 3 * area));
  lost.resize(std::max(lost.size(), area));
  const SumPlanes out = packed_sums(family, rect, samples.data(), lost.data());
  const bool any_missing = renderer.render_rows(rect.y0, rect.y1, out);
  return rounded_fragment(
      packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), any_missing ? lost.data() : nullptr));
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

constexpr uint8_t kChromaOffset = 128;

void pack_rgb(const ImageView& image, FragmentPlanes& planes, ByteBuffer& memory) {
  const Rect& rect = planes.rect;
  const RgbLayout& layout = image.layout;
  const uint8_t* row = image.plane[0] + rect.y0 * image.stride[0] + rect.x0 * layout.pixel_stride;
  planes.plane[0] = row;
  planes.stride[0] = image.stride[0];
  if (layout == RgbLayout{}) return;
  planes.stride[0] = 3 * static_cast<ptrdiff_t>(rect.width());
  memory.resize(static_cast<size_t>(planes.stride[0]) * rect.height());
  planes.plane[0] = memory.data();
  uint8_t* to = memory.data();
  for (int y = 0; y < rect.height(); y++, row += image.stride[0]) {
    const uint8_t* from = row;
    for (int x = 0; x < rect.width(); x++, from += layout.pixel_stride, to += 3) {
      to[0] = from[layout.r];
      to[1] = from[layout.g];
      to[2] = from[layout.b];
    }
  }
}

void pack_i420(const ImageView& image, FragmentPlanes& planes, ByteBuffer& memory) {
  const Rect& rect = planes.rect;
  planes.plane[0] = image.plane[0] + rect.y0 * image.stride[0] + rect.x0;
  planes.stride[0] = image.stride[0];
  const int width = chroma_size(rect.width()), height = chroma_size(rect.height());
  const size_t area = static_cast<size_t>(width) * height;
  memory.resize(2 * area);
  for (int c = 1; c < 3; c++) {
    uint8_t* to = memory.data() + (c - 1) * area;
    planes.plane[c] = to;
    planes.stride[c] = width;
    const uint8_t* row = image.plane[c] + rect.y0 / 2 * image.stride[c] + rect.x0 / 2;
    for (int y = 0; y < height; y++, row += image.stride[c], to += width)
      for (int x = 0; x < width; x++) to[x] = static_cast<uint8_t>(row[x] - kChromaOffset);
  }
}

wire::AnswerFragment cut(const Source& source, const Rect& rect, ByteBuffer& memory) {
  const ImageView& image = source.image;
  wire::AnswerFragment fragment{source.camera, {.family = image.family, .rect = rect}};
  image.family == PixelFamily::kRgb ? pack_rgb(image, fragment.planes, memory)
                                    : pack_i420(image, fragment.planes, memory);
  return fragment;
}

}  // namespace

void encode_sum(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                const SumRenderer& sum, const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer) {
  if (std::shared_ptr<gl::GpuSum> on_gpu = sum.gpu_sum())
    return encode_gpu_sum(header, std::move(on_gpu), std::move(memory), answer);
  const RenderJob& job = *plan.sum();
  const Coding coding = choose_coding(options.codec, options.in_process, plan.quality());
  std::vector<CameraIndex> cameras;
  for (const Source& source : sources) cameras.push_back(source.camera);
  const std::vector<Rect> tiles = sum_tiles(job.plan(), job.runs(), cameras, header.family,
                                            max_extra_pixels(job.plan().view(), coding.codec, options.in_process));
  if (coding.codec == wire::Codec::kRaw16)
    return encode_sums16(header, sum, tiles, options.parallel, std::move(memory), answer);
  const std::vector<Fragment> strips = render_strips(sum, tiles, header.family, options.strip_pixels, options.parallel);
  const uint64_t rendered = now_ns();
  std::vector<wire::AnswerFragment> fragments;
  for (const Fragment& strip : strips) fragments.push_back({{}, planes_of(strip)});
  answer.bytes = wire::encode_fragments(header, fragments, coding.quality, std::move(memory), options.parallel);
  answer.fragments = fragments.size();
  answer.encode_ns = now_ns() - rendered;
}

void encode_pixels(const wire::AnswerHeader& header, const RequestPlan& plan, std::span<const Source> sources,
                   const RenderOptions& options, ByteBuffer memory, RenderedAnswer& answer) {
  const int quality = choose_coding(options.codec, options.in_process, plan.quality()).quality;
  std::vector<std::pair<const Source*, Rect>> pieces;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone) continue;
    check_image(*source.rig_camera, source.image);
    const Rect region = plan.answer_region(source.camera);
    const int rows = quality > 0 ? wire::strip_rows(region.width(), options.strip_pixels) : region.height();
    for (const Rect& rect : wire::cut_rows(region, rows)) pieces.emplace_back(&source, rect);
  }
  std::vector<ByteBuffer> packed(pieces.size());
  std::vector<wire::AnswerFragment> fragments(pieces.size());
  options.parallel(pieces.size(), [&](size_t i) { fragments[i] = cut(*pieces[i].first, pieces[i].second, packed[i]); });
  const uint64_t cut_out = now_ns();
  answer.bytes = wire::encode_fragments(header, fragments, quality, std::move(memory), options.parallel);
  answer.fragments = fragments.size();
  answer.encode_ns = now_ns() - cut_out;
}

}  // namespace lf
