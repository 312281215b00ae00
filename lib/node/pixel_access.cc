// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/pixel_access.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/schedule.h"
#include "render/camera_projection.h"
#include "render/sum_planes.h"
#include "wire/fragment_codec.h"
#include "wire/strips.h"

namespace lf {
namespace {

constexpr uint8_t kChromaOffset = 128;

// R, G, B in this order without padding between pixels.
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

// Chroma without its offset.
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

wire::AnswerFragment cut(const PixelSource& from, const Rect& rect, ByteBuffer& memory) {
  const ImageView& image = from.source.image;
  wire::AnswerFragment fragment{from.source.camera, {.family = image.family, .rect = rect}};
  image.family == PixelFamily::kRgb ? pack_rgb(image, fragment.planes, memory)
                                    : pack_i420(image, fragment.planes, memory);
  return fragment;
}

class PendingPixels : public PendingAnswer {
 public:
  PendingPixels(const wire::AnswerHeader& header, std::vector<PixelSource> pixels, int quality, int strip_pixels)
      : header_(header), pixels_(std::move(pixels)), quality_(quality), strip_pixels_(strip_pixels) {}
  RenderedAnswer finish(ByteBuffer memory, const ParallelFor& parallel) override {
    return pixel_answer(header_, pixels_, quality_, strip_pixels_, std::move(memory), parallel);
  }

 private:
  const wire::AnswerHeader header_;
  const std::vector<PixelSource> pixels_;
  const int quality_, strip_pixels_;
};

class PixelTask : public AnswerTask {
 public:
  PixelTask(const Rig& rig, const wire::PixelCommand& command, std::span<const CameraIndex> own)
      : quality_(command.quality) {
    for (const wire::PixelCommand::Region& region : command.regions) {
      if (!std::ranges::binary_search(own, region.camera)) continue;
      const Camera& camera = rig.cameras[region.camera];
      if (intersect(region.rect, {0, 0, camera.width, camera.height}) != region.rect)
        throw Error("camera " + std::to_string(camera.id) + ": pixels outside of its image are asked for");
      cameras_.push_back(region.camera);
      regions_.push_back(region.rect);
    }
  }

  const std::vector<CameraIndex>& cameras() const override { return cameras_; }
  Rect region(CameraIndex camera) const override {
    return regions_[static_cast<size_t>(std::ranges::lower_bound(cameras_, camera) - cameras_.begin())];
  }
  std::unique_ptr<PendingAnswer> begin(const wire::AnswerHeader& header, std::span<const Source> sources,
                                       const Options& options) const override {
    std::vector<PixelSource> pixels;
    for (const Source& source : sources)
      if (source.image.family != PixelFamily::kNone) pixels.push_back({source, region(source.camera)});
    const CodedAs form = choose_codec(options.codec, options.in_process, quality_);
    return std::make_unique<PendingPixels>(header, std::move(pixels), form.quality, options.strip_pixels);
  }

 private:
  const int quality_;
  std::vector<CameraIndex> cameras_;
  std::vector<Rect> regions_;  // of these
};

class PixelAccess : public CameraAccess {
 public:
  wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const override {
    const ViewPlan plan(rig, mesh, request.view);
    wire::PixelCommand command{request, request.view.width, request.view.height, {}};
    for (const CameraIndex camera : plan.contributors())
      command.regions.push_back({camera, needed_pixels(plan, camera, rig.cameras[camera])});
    return command;
  }
  std::unique_ptr<AnswerTask> task(const Rig& rig, const wire::AnyRequest& command, std::span<const CameraIndex> own,
                                   const ParallelFor&) const override {
    return std::make_unique<PixelTask>(rig, std::get<wire::PixelCommand>(command), own);
  }
};

}  // namespace

const CameraAccess& pixel_access() {
  static const PixelAccess access;
  return access;
}

RenderedAnswer pixel_answer(const wire::AnswerHeader& header, std::span<const PixelSource> sources, int quality,
                            int strip_pixels, ByteBuffer memory, const ParallelFor& parallel) {
  const uint64_t begin = now_ns();
  std::vector<std::pair<const PixelSource*, Rect>> pieces;
  for (const PixelSource& source : sources) {
    check_image(*source.source.rig_camera, source.source.image);
    const int rows = quality > 0 ? wire::strip_rows(source.rect.width(), strip_pixels) : source.rect.height();
    for (const Rect& rect : wire::cut_rows(source.rect, rows)) pieces.emplace_back(&source, rect);
  }
  std::vector<ByteBuffer> packed(pieces.size());
  std::vector<wire::AnswerFragment> fragments(pieces.size());
  parallel(pieces.size(), [&](size_t i) { fragments[i] = cut(*pieces[i].first, pieces[i].second, packed[i]); });
  const uint64_t cut_out = now_ns();
  RenderedAnswer answer;
  answer.bytes = wire::encode_fragments(header, fragments, quality, std::move(memory), parallel);
  answer.fragments = fragments.size();
  answer.render_ns = cut_out - begin;
  answer.encode_ns = now_ns() - cut_out;
  return answer;
}

}  // namespace lf
