// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <GLES3/gl31.h>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "image/image.h"
#include "render/gl/objects.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"

namespace lf::gl {

// Puts camera images that are already on the GPU, for example from a hardware decoder, into the texture of a pass
// without a download. It copies regions of the images to the buffer that the texture is then uploaded from. It also
// divides and sharpens them according to their GpuPixels, with the same bits as on the CPU. The context must be current
// for all calls.
class TextureStager {
 public:
  // Number of one-byte samples that a shader invocation writes at once, as a 32-bit word. In planes with one byte per
  // pixel, regions therefore begin at whole words.
  static constexpr int kWord = 4;

  TextureStager() = default;
  ~TextureStager();
  TextureStager(const TextureStager&) = delete;
  TextureStager& operator=(const TextureStager&) = delete;

  // Starts filling a buffer of `bytes` bytes, until end(). Throws Error if that is not possible.
  void begin(size_t bytes, Programs& programs);
  GLuint name() const { return bytes_.name(); }
  // Region `part` of a plane with width x height pixels, and its place in the buffer. Up to one word beyond the end of
  // each row may be overwritten.
  struct Plane {
    int index, width, height;
    Rect part;
    size_t first;  // index of the word for the first pixel of `part`
    int row;       // words from row to row
  };
  // Copies a region of the image, between begin() and end().
  void copy(const ImageView& image, const Plane& plane);
  void end();

 private:
  GLuint nearest_ = 0;
  Buffer bytes_{Buffer::Use::kComputed};
  const Program* program_ = nullptr;
};

struct GlesView {
  const simd::SumTask* task = nullptr;
  std::span<const Source> sources;  // images that the task was made from
  Rect rect;                        // region of the view to render
};

// Selects the region of each camera image that is needed, and whether chroma is needed.
struct NeededPixels {
  std::function<Rect(const GlesView&, const Source&)> part;
  bool colours = true;
};

// A texture with the regions of camera images that the views of a pass need. GPUs are slow with many small uploads, so
// all regions are in one texture and uploaded at once. If views are blended by the mesh, the texture is a few times as
// large as a view, regardless of the number and size of the images. Otherwise its size grows with the number of cameras
// per pixel. An image that several views need is uploaded only once, with the union of the regions. Images that are
// already on the GPU are copied there.
//
// Calls need no context unless stated otherwise, so that the slow part, fill(), can run while the GPU renders another
// pass.
//
// Samples are bytes. In kI420, the luma regions are at the top. If colours are needed, the Cb regions are below and the
// Cr regions to the right of the Cb regions, both in the same arrangement at half the size.
class ImageAtlas {
 public:
  static constexpr size_t kMaxBytes = 512'000'000;

  // Places the images of sources that are used by their view's task. The texture has at most `max_size` pixels per side
  // and at most kMaxBytes bytes. Returns false if the images do not fit. All images are of one family, and must stay
  // valid until they are uploaded.
  bool lay_out(std::span<const GlesView> views, const NeededPixels& needed, int max_size);

  // Position of pixel (0, 0) of an image in the atlas. It is even and may be negative.
  struct Offset {
    int x = 0, y = 0;
  };
  // Returns the offsets for a view, by slot of its task.
  std::span<const Offset> offsets(size_t view) const { return offsets_[view]; }
  // Returns the offset of Cb (1) and Cr (2) for an image at (0, 0), in kI420.
  Offset chroma_offset(int plane) const { return {plane == 1 ? 0 : width_ / 2, height_}; }

  // If has_room() returns true, reserve() is unnecessary. reserve() needs the current context.
  bool has_room() const { return texture_.has_room(upload_size()); }
  void reserve() { texture_.reserve(upload_size()); }
  // Copies the regions to upload memory. The results of the previous pass must have been read before.
  void fill(const ParallelFor& parallel);
  // Uploads the texture, copies the regions of images that are on the GPU with `pieces`, and binds the texture. The
  // context must be current. Throws Error if images on the GPU are unavailable.
  void send(TextureStager& pieces, Programs& programs);

 private:
  struct Piece {
    const ImageView* image;
    Rect part;
    Offset at;
  };
  struct Use {
    size_t view, slot, piece;
  };
  void find_pieces(std::span<const GlesView> views, const NeededPixels& needed);
  int place_pieces();
  void copy(const Piece& piece, uint8_t* to) const;
  void copy_on_gpu(const Piece& piece, TextureStager& pieces) const;
  int all_rows() const { return has_chroma_ ? height_ + height_ / 2 : height_; }
  size_t size() const { return static_cast<size_t>(width_) * all_rows() * static_cast<size_t>(bytes_); }
  // Without any image, an empty texture is uploaded.
  size_t upload_size() const { return has_uploads_ || !has_gpu_ ? size() : 0; }

  std::vector<Piece> pieces_;
  std::vector<Use> uses_;
  std::vector<std::vector<Offset>> offsets_;  // by view and slot
  int width_ = 0, height_ = 0;                // size of the RGB or luma plane
  int bytes_ = 1;
  bool has_chroma_ = false;
  bool has_uploads_ = false, has_gpu_ = false;  // some images are in CPU memory, or on the GPU
  UploadTexture texture_;
};

}  // namespace lf::gl
