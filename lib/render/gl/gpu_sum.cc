// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/gpu_sum.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "render/gl/gles_renderer.h"
#include "render/gl/objects.h"
#include "render/gl/sums.h"

namespace lf::gl {

GpuSum::GpuSum(std::shared_ptr<GlesRenderer> renderer, std::shared_ptr<BlockSum> sum, const Rect& view,
               bool has_missing)
    : renderer_(std::move(renderer)), sum_(std::move(sum)), view_(view), has_missing_(has_missing) {}

GpuSum::~GpuSum() = default;

PixelFamily GpuSum::family() const { return sum_->family; }

const Rect& GpuSum::rect() const { return sum_->rect; }

ShareGroup GpuSum::group() const { return renderer_->group(); }

ConstSumPlanes GpuSum::fetch() {
  const std::lock_guard lock(mutex_);
  if (!memory_.empty()) return fetched_;
  ReadbackBuffer drawn{.family = sum_->family, .rect = sum_->rect};
  try {
    SumReadback reading{sum_.get(), &drawn};
    renderer_->work([&](Programs&, Buffer&) { read_sums({&reading, 1}); });
  } catch (const Error&) {
    is_gone_ = true;
  }
  const Rect& rect = sum_->rect;
  const size_t samples = packed_size(drawn.family, rect.width(), rect.height()),
               pixels = static_cast<size_t>(rect.width()) * rect.height();
  const bool has_missing = has_missing_ || is_gone_;
  memory_.resize(samples + (has_missing ? pixels : 0));
  auto* const lost = has_missing ? reinterpret_cast<uint16_t*>(memory_.data() + samples) : nullptr;
  const SumPlanes planes = packed_sums(drawn.family, rect, memory_.data(), lost);
  if (is_gone_) {
    std::fill_n(memory_.data(), samples, int16_t{0});
    std::fill_n(lost, pixels, uint16_t{kMissingOne});
  } else {
    drawn.copy_rows(rect.y0, rect.y1, planes);
  }
  fetched_ = packed_sums<const int16_t, const uint16_t>(drawn.family, rect, memory_.data(), lost);
  return fetched_;
}

std::shared_ptr<GpuSum> GpuSum::add(std::span<const std::shared_ptr<GpuSum>> sums, std::string& why) {
  const GpuSum& first = *sums.front();
  std::vector<std::shared_ptr<BlockSum>> parts;
  bool has_missing = false;
  for (const std::shared_ptr<GpuSum>& sum : sums) {
    parts.push_back(sum->sum_);
    has_missing = has_missing || sum->has_missing_;
  }
  try {
    auto sum =
        std::make_shared<GpuSum>(first.renderer_, first.renderer_->add(parts, first.view_), first.view_, has_missing);
    sum->parts_ = std::move(parts);
    return sum;
  } catch (const Error& error) {
    why = error.what();
    return nullptr;
  }
}

namespace {

GLuint words_of(int bytes) { return static_cast<GLuint>(bytes + 3) / 4; }

struct Plane {
  int width = 0, height = 0, bytes = 1;  // size in pixels; bytes per pixel
  size_t first = 0;

  GLuint row() const { return words_of(width * bytes); }
  size_t end() const { return first + size_t{row()} * static_cast<size_t>(height); }
  GLenum format() const {
    constexpr GLenum kFormats[] = {GL_RED, GL_RG, GL_RGB, GL_RGBA};
    return kFormats[bytes - 1];
  }
};

int lay_out(PixelFamily family, const Rect& view, const GpuPicture& picture, Plane (&planes)[3]) {
  const bool rgb = family == PixelFamily::kRgb;
  planes[0] = {view.width(), view.height(), rgb ? picture.layout.pixel_stride : 1, 0};
  const int count = rgb ? 1 : picture.is_interleaved ? 2 : 3;
  for (int i = 1; i < count; i++)
    planes[i] = {chroma_size(view.width()), chroma_size(view.height()), picture.is_interleaved ? 2 : 1,
                 planes[i - 1].end()};
  return count;
}

}  // namespace

bool GpuSum::draw(const GpuPicture& picture, std::string& why) {
  const bool rgb = sum_->family == PixelFamily::kRgb;
  Plane planes[3];
  const int count = lay_out(sum_->family, view_, picture, planes);
  const auto make = [&](Programs& programs, Buffer& bytes) {
    SumProgram what;
    what.output = rgb ? SumProgram::Output::kPictureRgb : SumProgram::Output::kPictureI420;
    if (auto* const fence = static_cast<GLsync>(picture.fence)) {
      glWaitSync(fence, 0, GL_TIMEOUT_IGNORED);
      glDeleteSync(fence);
    }
    const Program& program = programs.use(what);
    bytes.reserve(sizeof(uint32_t) * planes[count - 1].end());
    const BlockSum& sum = *sum_;
    glUniform2i(program.origin, sum.rect.x0, sum.rect.y0);
    glUniform2i(program.size, sum.rect.width(), sum.rect.height());
    glUniform2i(program.extent, view_.width(), view_.height());
    glUniform1ui(program.missing_rows, sum.parts.missing_rows);
    glUniform4ui(program.parts, sum.parts.pixels, sum.parts.chroma, sum.parts.lost, sum.draw);
    glUniform4ui(program.planes, planes[0].row(), planes[1].row(), static_cast<GLuint>(planes[1].first),
                 static_cast<GLuint>(planes[2].first));
    glUniform3f(program.byte_levels, picture.gain, picture.offset, picture.chroma_gain);
    glUniform4f(program.background, picture.background[0], picture.background[1], picture.background[2],
                static_cast<float>(picture.least_weight));
    const RgbLayout& layout = picture.layout;
    const int opaque = 6 - layout.r - layout.g - layout.b;
    glUniform4i(program.channels, 8 * layout.r, 8 * layout.g, 8 * layout.b,
                rgb ? (layout.pixel_stride == 4 ? 8 * opaque : -1) : picture.is_interleaved);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, sum.words->name());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kPictureBinding, bytes.name());
    const int columns = rgb ? 4 : 8, rows = rgb ? 1 : 2;  // pixels per invocation
    const auto groups = [](int pixels, int of_one) {
      return static_cast<GLuint>((pixels + kGroup * of_one - 1) / (kGroup * of_one));
    };
    glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);  // wait until the previous picture has been uploaded from the buffer
    glDispatchCompute(groups(view_.width(), columns), groups(view_.height(), rows), 1);
    glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, bytes.name());
    glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    glActiveTexture(GL_TEXTURE0 + kTargets);
    for (int i = 0; i < count; i++) {
      const Plane& plane = planes[i];
      glBindTexture(GL_TEXTURE_2D, picture.textures[i]);
      const int halves = i > 0 ? 2 : 1;
      glTexSubImage2D(GL_TEXTURE_2D, 0, picture.x / halves, picture.y / halves, plane.width, plane.height,
                      plane.format(), GL_UNSIGNED_BYTE, reinterpret_cast<const void*>(sizeof(uint32_t) * plane.first));
    }
    glBindTexture(GL_TEXTURE_2D, 0);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  };
  return work(make, why);
}

bool GpuSum::wait(std::string& why) {
  return work([](Programs&, Buffer&) { wait_for_gpu(); }, why);
}

bool GpuSum::work(const std::function<void(Programs&, Buffer&)>& job, std::string& why) {
  try {
    renderer_->work(job);
    return true;
  } catch (const Error& error) {
    why = error.what();
    return false;
  }
}

}  // namespace lf::gl
