// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_drawer.h"

#include <algorithm>

#include "render/camera_projection.h"
#include "render/gl/objects.h"
#include "render/gl/sum_tables.h"

namespace lf::gl {
namespace {

// A part of a plane of bytes into a layer of the bound array.
void upload(const uint8_t* plane, ptrdiff_t stride, int bytes, const Rect& part, int layer, GLenum format,
            std::vector<uint8_t>& packed) {
  const size_t row = static_cast<size_t>(part.width()) * static_cast<size_t>(bytes);
  const uint8_t* from = plane + part.y0 * stride + ptrdiff_t{part.x0} * bytes;
  if (stride > 0 && stride % bytes == 0) {
    glPixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(stride / bytes));
  } else {
    packed.resize(row * static_cast<size_t>(part.height()));
    for (int y = 0; y < part.height(); y++) std::copy_n(from + y * stride, row, &packed[static_cast<size_t>(y) * row]);
    from = packed.data();
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
  }
  glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, part.x0, part.y0, layer, part.width(), part.height(), 1, format,
                  GL_UNSIGNED_BYTE, from);
}

// Pixels of four bytes of an image of three, or the other way round: an array has one format.
void repack(const ImageView& image, const Rect& part, int bytes, std::vector<uint8_t>& out) {
  out.assign(static_cast<size_t>(part.width()) * part.height() * static_cast<size_t>(bytes), 0);
  uint8_t* to = out.data();
  const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
  for (int y = part.y0; y < part.y1; y++)
    for (int x = part.x0; x < part.x1; x++, to += bytes)
      for (int c = 0; c < 3; c++)
        to[c] = image.plane[0][y * image.stride[0] + ptrdiff_t{x} * image.layout.pixel_stride + offset[c]];
}

}  // namespace

struct SumDrawer::Objects {
  Texture owners{GL_TEXTURE_2D}, tables{GL_TEXTURE_2D}, levels{GL_TEXTURE_2D}, rays{GL_TEXTURE_2D},
      centre_rays{GL_TEXTURE_2D}, images{GL_TEXTURE_2D_ARRAY}, chroma_images{GL_TEXTURE_2D_ARRAY},
      pixels{GL_TEXTURE_2D}, luma_seen{GL_TEXTURE_2D}, chroma{GL_TEXTURE_2D};
  Program rgb, luma, chroma_program;
  GLuint frame = 0;
  GLint max_size = 0, max_layers = 0;
  std::vector<uint16_t> owner_memory;
  std::vector<float> table_memory, ray_memory;
  std::vector<uint8_t> packed;

  Objects() {
    glGenFramebuffers(1, &frame);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_size);
    glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &max_layers);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
  }
  ~Objects() { glDeleteFramebuffers(1, &frame); }

  void upload_owners(const simd::SumTask& task, const Rect& rect) {
    const int width = rect.width(), height = rect.height();
    owner_memory.assign(static_cast<size_t>(width) * height, 0);
    for (int y = rect.y0; y < rect.y1; y++) {
      uint16_t* row = &owner_memory[static_cast<size_t>(y - rect.y0) * width];
      for (const OwnerRun& run : task.runs->row(y, rect.x0, rect.x1)) {
        const int x0 = std::max(run.x0, rect.x0), x1 = std::min(run.x1, rect.x1);
        if (x1 > x0) std::fill_n(row + (x0 - rect.x0), x1 - x0, static_cast<uint16_t>(run.face + 1));
      }
    }
    owners.bind(kOwners, GL_R16UI, width, height);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RED_INTEGER, GL_UNSIGNED_SHORT, owner_memory.data());
  }

  // The first slot's texel.
  int upload_tables(const simd::SumTask& task) {
    const int first_slot = make_tables(task, table_memory);
    const int rows = static_cast<int>(table_memory.size()) / (4 * kTableWidth);
    tables.bind(kTables, GL_RGBA32F, kTableWidth, rows);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, kTableWidth, rows, GL_RGBA, GL_FLOAT, table_memory.data());
    return first_slot;
  }

  void upload_rays(const Rays& view_rays, const Rect& rect, bool centres) {
    const int step = centres ? 2 : 1, width = centres ? chroma_size(rect.width()) : rect.width(),
              height = centres ? chroma_size(rect.height()) : rect.height();
    ray_memory.clear();
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++) {
        const int i = rect.x0 + step * x, j = rect.y0 + step * y;
        const Vec2 ray = centres ? view_rays.at_centre_of_four(i, j) : view_rays.at(i, j);
        ray_memory.push_back(static_cast<float>(ray.x));
        ray_memory.push_back(static_cast<float>(ray.y));
      }
    (centres ? centre_rays : rays).bind(centres ? kCentreRays : kRays, GL_RG32F, width, height);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RG, GL_FLOAT, ray_memory.data());
  }

  // What the view needs of the sources' images.
  void upload_images(const simd::SumTask& task, std::span<const Source> sources, int width, int height) {
    const bool rgb_family = task.family == PixelFamily::kRgb;
    const int layers = static_cast<int>(task.slots.size());
    int bytes = 1;
    if (rgb_family)
      for (const simd::Slot& slot : task.slots)
        if (slot.image.family != PixelFamily::kNone) bytes = std::max(bytes, slot.image.layout.pixel_stride);
    const GLenum format = bytes == 1 ? GL_RED : bytes == 3 ? GL_RGB : GL_RGBA;
    images.bind(kImages, bytes == 1 ? GL_R8 : bytes == 3 ? GL_RGB8 : GL_RGBA8, width, height, layers);
    if (!rgb_family) {
      chroma_images.bind(kChromaImages, GL_RG8, chroma_size(width), chroma_size(height), layers);
      glActiveTexture(GL_TEXTURE0 + kImages);
    }
    for (const Source& source : sources) {
      const int layer = task.slot_of_camera[source.camera];
      if (layer < 0 || source.image.family == PixelFamily::kNone) continue;
      const ImageView& image = source.image;
      const Rect part = needed_pixels(*task.plan, source.camera, *source.rig_camera);
      glActiveTexture(GL_TEXTURE0 + kImages);
      if (rgb_family && image.layout.pixel_stride != bytes) {
        std::vector<uint8_t> whole;
        repack(image, part, bytes, whole);
        glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
        glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, part.x0, part.y0, layer, part.width(), part.height(), 1, format,
                        GL_UNSIGNED_BYTE, whole.data());
        continue;
      }
      upload(image.plane[0], image.stride[0], bytes, part, layer, format, packed);
      if (rgb_family) continue;
      const Rect half{part.x0 / 2, part.y0 / 2, chroma_size(part.x1), chroma_size(part.y1)};
      packed.resize(2 * static_cast<size_t>(half.width()) * half.height());
      uint8_t* to = packed.data();
      for (int y = half.y0; y < half.y1; y++)
        for (int x = half.x0; x < half.x1; x++)
          for (int c = 1; c < 3; c++) *to++ = image.plane[c][y * image.stride[c] + x];
      glActiveTexture(GL_TEXTURE0 + kChromaImages);
      glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
      glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, half.x0, half.y0, layer, half.width(), half.height(), 1, GL_RG,
                      GL_UNSIGNED_BYTE, packed.data());
    }
  }
};

SumDrawer::SumDrawer(std::unique_ptr<Context> context) : context_(std::move(context)) {}

SumDrawer::~SumDrawer() {
  const Context::Current current(*context_);
  objects_.reset();
}

std::unique_ptr<SumDrawer> SumDrawer::create(Context::Drivers drivers, std::string& why) {
  auto context = Context::create(drivers, why);
  if (!context) return nullptr;
  std::unique_ptr<SumDrawer> drawer(new SumDrawer(std::move(context)));
  const Context::Current current(*drawer->context_);
  if (!current) return nullptr;
  drawer->objects_ = std::make_unique<Objects>();
  // A driver that can't compile them is told from one that can before there is anything to draw.
  Objects& objects = *drawer->objects_;
  if (objects.rgb.use(SumProgram::kRgb, why) && objects.luma.use(SumProgram::kLuma, why) &&
      objects.chroma_program.use(SumProgram::kChroma, why))
    return drawer;
  return nullptr;
}

std::string SumDrawer::why_not() const {
  const std::lock_guard lock(why_mutex_);
  return why_not_;
}

bool SumDrawer::refuse(std::string why) {
  const std::lock_guard lock(why_mutex_);
  why_not_ = std::move(why);
  return false;
}

bool SumDrawer::draw(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect, DrawnSum& out) {
  {
    const Context::Current current(*context_);
    if (!current) {
      lost_ = true;
      return refuse("the context is lost");
    }
    if (!draw_now(task, sources, rect, out)) return false;
  }
  mended_ = mend(task, out);
  return true;
}

bool SumDrawer::draw_now(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect, DrawnSum& out) {
  Objects& o = *objects_;
  const ViewPlan& plan = *task.plan;
  const bool rgb = task.family == PixelFamily::kRgb;
  const FocalMap* map = plan.view().focus.map.get();
  int width = 1, height = 1;  // of the largest image
  for (const simd::Slot& slot : task.slots) {
    width = std::max(width, slot.image.width);
    height = std::max(height, slot.image.height);
  }
  if (plan.blend()) return refuse("the view is not blended by its mesh");
  if (plan.faces().size() >= 65535) return refuse("too many faces");
  if (static_cast<int>(task.slots.size()) > o.max_layers) return refuse("too many cameras");
  const int largest = std::max({width, height, rect.width(), rect.height()});
  if (largest > o.max_size) return refuse("an image or a view is too large");

  o.upload_owners(task, rect);
  const int first_slot = o.upload_tables(task);
  if (!plan.rays().separable()) {
    o.upload_rays(plan.rays(), rect, false);
    if (!rgb) o.upload_rays(plan.rays(), rect, true);
  }
  if (map) {
    o.levels.bind(kLevels, GL_R8UI, map->columns, map->rows, 0, true);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, map->columns, map->rows, GL_RED_INTEGER, GL_UNSIGNED_BYTE,
                    map->levels.data());
  }
  o.upload_images(task, sources, width, height);

  glBindFramebuffer(GL_FRAMEBUFFER, o.frame);
  const auto draw = [&](Program& program, SumProgram what, int w, int h) {
    if (std::string why; !program.use(what, why)) return refuse(why);
    program.set("origin", rect.x0, rect.y0);
    program.set("size", rect.width(), rect.height());
    program.set("first_slot", first_slot);
    program.set("has_rays", !plan.rays().separable());
    program.set("has_map", map != nullptr);
    if (map) program.set("map_scale", double(map->step), (map->nearest - map->farthest) / FocalMap::kLevels);
    glViewport(0, 0, w, h);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    return true;
  };
  const auto attach = [&](GLenum where, Texture& texture, GLenum format, int w, int h) {
    texture.bind(kTargets, format, w, h);
    glFramebufferTexture2D(GL_FRAMEBUFFER, where, GL_TEXTURE_2D, texture.name(), 0);
  };
  out.family = task.family;
  out.rect = rect;
  const int w = rect.width(), h = rect.height();
  out.pixels.resize(static_cast<size_t>(w) * h * (rgb ? 4 : 2));
  attach(GL_COLOR_ATTACHMENT0, o.pixels, rgb ? GL_RGBA16UI : GL_RG16UI, w, h);
  if (rgb)
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, 0, 0);
  else
    attach(GL_COLOR_ATTACHMENT1, o.luma_seen, GL_R8UI, w, h);
  const GLenum both[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(rgb ? 1 : 2, both);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return refuse("16-bit targets can't be drawn to");
  if (!draw(rgb ? o.rgb : o.luma, rgb ? SumProgram::kRgb : SumProgram::kLuma, w, h)) return false;
  glReadPixels(0, 0, w, h, rgb ? GL_RGBA_INTEGER : GL_RG_INTEGER, GL_UNSIGNED_SHORT, out.pixels.data());
  if (!rgb) {
    const int cw = chroma_size(w), ch = chroma_size(h);
    out.chroma.resize(2 * static_cast<size_t>(cw) * ch);
    attach(GL_COLOR_ATTACHMENT0, o.chroma, GL_RG16UI, cw, ch);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, 0, 0);
    glDrawBuffers(1, both);
    glActiveTexture(GL_TEXTURE0 + kLumaSeen);
    glBindTexture(GL_TEXTURE_2D, o.luma_seen.name());
    if (!draw(o.chroma_program, SumProgram::kChroma, cw, ch)) return false;
    glReadPixels(0, 0, cw, ch, GL_RG_INTEGER, GL_UNSIGNED_SHORT, out.chroma.data());
  }
  if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
    lost_ = error == GL_OUT_OF_MEMORY || lost_;
    return refuse("OpenGL error " + std::to_string(error));
  }
  return true;
}

}  // namespace lf::gl
