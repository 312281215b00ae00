// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_drawer.h"

#include <GLES3/gl31.h>

#include <algorithm>
#include <cmath>

#include "render/camera_projection.h"
#include "render/gl/sum_shader.h"

namespace lf::gl {
namespace {

// A texture that keeps its memory as long as it is large enough.
class Texture {
 public:
  explicit Texture(GLenum target) : target_(target) {}
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (name_) glDeleteTextures(1, &name_);
  }
  // Binds it, with room for as much; `layers` 0: of one image. Exactly as much where `exact`.
  void bind(int unit, GLenum format, int width, int height, int layers = 0, bool exact = false) {
    glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    const bool fits = exact ? width == width_ && height == height_ : width <= width_ && height <= height_;
    if (name_ && format == format_ && fits && layers <= layers_) {
      glBindTexture(target_, name_);
      return;
    }
    if (name_) glDeleteTextures(1, &name_);
    glGenTextures(1, &name_);
    glBindTexture(target_, name_);
    if (target_ == GL_TEXTURE_2D_ARRAY)
      glTexStorage3D(target_, 1, format, width, height, layers);
    else
      glTexStorage2D(target_, 1, format, width, height);
    glTexParameteri(target_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(target_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    format_ = format;
    width_ = width;
    height_ = height;
    layers_ = layers;
  }
  GLuint name() const { return name_; }

 private:
  GLenum target_, format_ = 0;
  GLuint name_ = 0;
  int width_ = 0, height_ = 0, layers_ = 0;
};

// Textures' units.
enum Unit { kOwners, kTables, kLevels, kRays, kCentreRays, kImages, kChromaImages, kLumaSeen, kTargets };

class Program {
 public:
  Program() = default;
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (name_) glDeleteProgram(name_);
  }
  // Compiles and links it the first time; false with what the driver says in `why`.
  bool use(SumProgram what, std::string& why) {
    if (!name_ && !make(what, why)) return false;
    glUseProgram(name_);
    return true;
  }
  void set(const char* name, int value) { glUniform1i(at(name), value); }
  void set(const char* name, int x, int y) { glUniform2i(at(name), x, y); }
  void set(const char* name, double x, double y) {
    glUniform2f(at(name), static_cast<float>(x), static_cast<float>(y));
  }

 private:
  GLint at(const char* name) const { return glGetUniformLocation(name_, name); }
  bool make(SumProgram what, std::string& why) {
    const GLuint vertex = compile(GL_VERTEX_SHADER, vertex_shader(), why);
    const GLuint fragment = vertex ? compile(GL_FRAGMENT_SHADER, sum_shader(what), why) : 0;
    if (fragment) {
      name_ = glCreateProgram();
      glAttachShader(name_, vertex);
      glAttachShader(name_, fragment);
      glLinkProgram(name_);
      GLint linked = 0;
      glGetProgramiv(name_, GL_LINK_STATUS, &linked);
      if (!linked) {
        char text[512] = "";
        glGetProgramInfoLog(name_, sizeof text, nullptr, text);
        why = std::string("a shader does not link: ") + text;
        glDeleteProgram(name_);
        name_ = 0;
      }
    }
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    if (!name_) return false;
    glUseProgram(name_);
    for (const auto& [name, unit] :
         {std::pair("owners", kOwners), std::pair("tables", kTables), std::pair("levels", kLevels),
          std::pair("rays", kRays), std::pair("centre_rays", kCentreRays), std::pair("images", kImages),
          std::pair("chroma_images", kChromaImages), std::pair("luma_seen", kLumaSeen)})
      set(name, unit);
    return true;
  }
  static GLuint compile(GLenum kind, const std::string& text, std::string& why) {
    const GLuint shader = glCreateShader(kind);
    const char* source = text.c_str();
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    GLint compiled = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
    if (compiled) return shader;
    char log[512] = "";
    glGetShaderInfoLog(shader, sizeof log, nullptr, log);
    why = std::string("a shader does not compile: ") + log;
    glDeleteShader(shader);
    return 0;
  }
  GLuint name_ = 0;
};

// Texels of faces and slots.
class Tables {
 public:
  explicit Tables(std::vector<float>& values) : values_(values) { values_.clear(); }
  void add(double x, double y, double z, double w) {
    for (const double v : {x, y, z, w}) values_.push_back(static_cast<float>(v));
  }
  void add(const float* v, double w) { add(v[0], v[1], v[2], w); }
  int texels() const { return static_cast<int>(values_.size() / 4); }

 private:
  std::vector<float>& values_;
};

void add_face(Tables& tables, const simd::SumTask& task, const FacePlan& face) {
  const Rays& rays = task.plan->rays();
  Vec3 edge[3] = {face.edge[0], face.edge[1], face.edge[2]};
  Vec2 anchor(0);
  if (rays.separable()) {  // linear in the pixel, and small near where it is 0
    const Vec2 first = rays.at(0, 0);
    const Vec2 step(rays.at(1, 0).x - first.x, rays.at(0, 1).y - first.y);
    anchor = Vec2((face.rect.x0 + face.rect.x1) / 2, (face.rect.y0 + face.rect.y1) / 2);
    const Vec2 ray = rays.at(static_cast<int>(anchor.x), static_cast<int>(anchor.y));
    for (Vec3& e : edge) e = Vec3(e.x * step.x, e.y * step.y, FacePlan::evaluate(e, ray));
  }
  double largest = 0;
  for (const Vec3& e : edge)
    largest = std::max({largest, std::abs(e.x) * face.rect.width(), std::abs(e.y) * face.rect.height(), std::abs(e.z)});
  tables.add(anchor.x, anchor.y, 0, 0);
  for (int k = 0; k < 3; k++) {
    const Vec3 e = largest > 0 ? edge[k] / largest : edge[k];
    const int32_t slot = face.camera[k] == MeshFace::kNone ? -1 : task.slot_of_camera[face.camera[k]];
    tables.add(e.x, e.y, e.z, slot);
  }
}

void add_slot(Tables& tables, const simd::SumTask& task, const simd::Slot& slot, int layer) {
  const ViewPlan& plan = *task.plan;
  const FocalMap* map = plan.view().focus.map.get();
  simd::ProjectionTerms terms;
  int x = 0, y = 0;
  if (plan.rays().separable()) {
    x = (slot.rect.x0 + slot.rect.x1) / 2;
    y = (slot.rect.y0 + slot.rect.y1) / 2;
    terms = map ? simd::terms_at(slot, x, y, plan.inverse_at(x, y)) : simd::terms_at(slot, x, y);
  } else {
    terms.near = map ? plan.inverse_at(plan.view().width / 2.0, plan.view().height / 2.0) : 0;
    const Mat3& per = slot.projection->per_inverse();
    const Mat3 from = map ? slot.projection->camera_from_ray() + terms.near * per : slot.projection->camera_from_ray();
    double largest = 1e-300;
    for (int c = 0; c < 3; c++)
      for (int r = 0; r < 3; r++) largest = std::max(largest, std::abs(from[c][r]));
    for (int r = 0; r < 3; r++) {
      const auto scaled = [&](double v) { return static_cast<float>(v / largest); };
      terms.along[r] = scaled(from[0][r]);
      terms.down[r] = scaled(from[1][r]);
      terms.from[r] = scaled(from[2][r]);
      terms.per_along[r] = map ? scaled(per[0][r]) : 0;
      terms.per_down[r] = map ? scaled(per[1][r]) : 0;
      terms.per_from[r] = map ? scaled(per[2][r]) : 0;
    }
  }
  const double level = map && map->nearest != map->farthest
                           ? (terms.near - map->farthest) / (map->nearest - map->farthest) * FocalMap::kLevels
                           : 0;
  const int flags = (slot.image.family != PixelFamily::kNone ? kHasImage : 0) |
                    (slot.radial || slot.tangential ? kIsDistorted : 0) | (slot.is_cubic() ? kIsCubic : 0);
  tables.add(terms.from, x);
  tables.add(terms.along, y);
  tables.add(terms.down, flags);
  tables.add(terms.per_from, level);
  tables.add(terms.per_along, plan.eye_distance());
  tables.add(terms.per_down, terms.near);
  tables.add(slot.fx, slot.fy, slot.cx, slot.cy);
  tables.add(slot.k1, slot.k2, slot.p1, slot.p2);
  tables.add(slot.max_r2, slot.image.width, slot.image.height, layer);
  const RgbLayout& layout = slot.image.layout;
  tables.add(layout.r, layout.g, layout.b, 0);
}

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
    Tables table(table_memory);
    for (const FacePlan& face : task.plan->faces()) add_face(table, task, face);
    const int first_slot = table.texels();
    int layer = 0;
    for (const simd::Slot& slot : task.slots) add_slot(table, task, slot, layer++);
    const int rows = (table.texels() + kTableWidth - 1) / kTableWidth;
    table_memory.resize(static_cast<size_t>(rows) * kTableWidth * 4);
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
