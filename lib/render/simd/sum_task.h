// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/pose.h"
#include "image/image.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "render/view_plan.h"

// The data of SumRenderer's vector code. It processes a band of kBandRows rows of a view at a time, in blocks of kBlock
// pixels that are aligned to the view. Therefore results do not depend on where a rectangle begins. A slot is a place
// in the list of contributing cameras.
namespace lf::simd {

inline constexpr int kBlock = 16;       // pixels
inline constexpr int kChromaBlock = 8;  // chroma samples per block
inline constexpr int kBandRows = 8;     // rows of pixels; keeps a band's data in the innermost caches
inline constexpr int kBandPairs = kBandRows / 2;
inline constexpr int kPositionBits = 11;  // fractional bits of positions relative to a block's window

// A CameraProjection near a position of the view, in float. Camera coordinates are from + i along + j down, plus
// (inverse distance - near) times per_from + i per_along + j per_down.
struct ProjectionTerms {
  double near = 0;
  float from[3] = {}, along[3] = {}, down[3] = {};
  float per_from[3] = {}, per_along[3] = {}, per_down[3] = {};
};

struct Slot {
  CameraIndex camera = 0;
  ImageView image;  // if its family is kNone, all weight is missing
  Rect rect;        // bounds the pixels with a weight of the camera; x0 and y0 are even
  // For RGB: byte indices into two runs of eight bytes. They select R, G and B of a run's first pixel and its right
  // neighbour, alternating.
  alignas(16) uint8_t pixel_pairs[16] = {};
  alignas(16) uint8_t pixel_taps[16] = {};  // byte indices into four pixels: all R, then G, then B
  const CameraProjection* projection = nullptr;
  // Camera coordinates of pixel (x, y) of the view are from_pixel * (x, y, 1), up to a positive factor. A focal map
  // adds the inverse distance times per_inverse * (x, y, 1).
  Mat3 from_pixel;
  Mat3 per_inverse{0};
  ProjectionTerms terms;   // with a focal map: at the first pixel of the first block and band of `rect`
  float eye_distance = 0;  // see ViewPlan
  float fx = 0, fy = 0, cx = 0, cy = 0, k1 = 0, k2 = 0, p1 = 0, p2 = 0, max_r2 = 0;
  bool radial = false, tangential = false;
  // In these rows, all of the camera's pixels are well inside its image, nearly upright and at about its scale, so that
  // the fastest loops can be used. See find_interior_rows().
  int interior_y0 = 0, interior_y1 = 0;
  bool is_interior(int y0, int y1) const { return interior_y0 <= y0 && y1 <= interior_y1; }
};

// One camera's weights in one block of a band; 32767 is weight 1.
struct alignas(64) BlockWeights {
  int16_t w[kBandRows][kBlock];
  int32_t slot;
  int32_t next;   // index of the block's next BlockWeights, or -1
  uint32_t rows;  // bit r is set if row r has non-zero weights
};

// Says how the samples of one plane and row of a block are read.
enum class Fetch : int16_t {
  kMixed,  // project each sample, because some are missing, near the border, or not accurately interpolated
  kLost,
  kGather,   // read pixel by pixel; all are inside the image
  kShuffle,  // byte shuffles of 16-byte windows of three image rows
};

// Positions of the samples of one plane and row of a block, relative to its window's corner, in fixed point
// (kPositionBits). They are p(t) = p0 + t D + t (t - 1)/4 S for t = 0..1 along the block, by Bessel interpolation of
// four nodes.
struct WindowPositions {
  uint16_t x0, dx;
  int16_t sx, y0, dy, sy;
  uint16_t x0_half;  // x0 in the window of the block's second half
  int16_t half;      // columns from the corner to the window of the second half
};

struct PlanePositions {
  std::vector<float> node_x, node_y;  // positions at the left edges of blocks, starting one block before the first
  std::vector<WindowPositions> window;
  std::vector<int32_t> corner;  // byte offset of the window in the plane
  std::vector<int32_t> fetch;   // Fetch of each entry of `window`
  void resize(size_t n);
};

// If a focal map has nodes kCell pixels apart, positions are interpolated quadratically where the error is provably at
// most kGridError (cells-inl.h). The nodes are between pixels 1 and 2 of every four, so each half of a block's row lies
// between four nodes. Chroma has the same nodes, for each pair of rows.
inline constexpr int kCell = FocalMap::kMinStep;
inline constexpr int kHalf = kBlock / 2;
inline constexpr int kCellRows = kBandRows / kCell + 2;  // rows of nodes around a band

// Values at the nodes of kCellRows rows, or of the cells to the right or below, in even and odd columns. The first even
// node is to the left of the first pixel.
struct CellNodes {
  std::vector<float> even[kCellRows], odd[kCellRows];
  void resize(size_t n);
};
// Temporary data of one slot's cells: bends along rows and down, and the largest error in a cell, in pixels.
struct CellWork {
  CellNodes along_x, along_y, down_x, down_y, doubt;
  void resize(size_t n);
};
// The positions of one slot in a band, for a focal map with nodes kCell apart. Half h of row k of nodes, or of the
// cells below, is at entry(k, h). The next band reuses the last rows of nodes.
struct SurfaceBand {
  int pitch = 0;      // entries per row of halves; whole vectors and a margin
  int first_row = 0;  // index of row 0 of nodes in the arrays
  int row(int k) const { return (first_row + k) % kCellRows; }
  size_t entry(int k, size_t half) const { return static_cast<size_t>(row(k)) * pitch + half; }
  CellNodes x, y, z, per_z;  // rows of nodes by row(); per_z: 1 / z
  // Bounds of the samples between a half's nodes, if the whole view were at this row of nodes. NaN means outside the
  // range of fixed point.
  std::vector<float> low_x, high_x, low_y, high_y;
  // How far positions may exceed the bounds of the rows of nodes above and below. NaN means that they are not accurate.
  std::vector<float> slack_x, slack_y;
  // Eight values per entry: four of x and four of y, in fixed point (kPositionBits) modulo 2^16. `nodes` are relative
  // to an arbitrary multiple of 2^16. `along` are the bends to the right of the nodes, and the last one is 0. `down`
  // are the bends down.
  std::vector<int16_t> nodes, along, down;
  // Byte offsets of windows, and their origins in fixed point (x in the low bits, then y). Row r, half h is at r *
  // pitch + h, and pair p, block b at p * pitch / 2 + b. Chroma origins are in luma pixels.
  std::vector<int32_t> luma_corner, chroma_corner;
  std::vector<uint32_t> luma_origin, chroma_origin;
  std::vector<int32_t> interior_pairs;  // for each block; bit p: pair p can be shuffled
  void resize(int blocks);
};

// The positions of one slot in a band. Entry (row, block) is at row * pitch + block. Rows of chroma are pairs of rows.
struct SlotBand {
  // How a pair of rows of a block is processed. kTall means shuffled from windows of more than three rows, which only
  // happens with a focal map.
  enum Verdict : int32_t { kProject, kAllMissing, kSample, kTall, kShuffle };

  int y = -1;  // first row of the band; -1 if the slot has not been placed yet
  const Slot* slot = nullptr;
  bool interior = false;  // all verdicts are kShuffle
  bool mapped = false;
  int first_block = 0, blocks = 0;
  int pitch = 0;                     // blocks + 3 nodes
  std::vector<float> columns, rows;  // positions of the nodes for this pitch, in pixels from the first node
  std::vector<float> node_z;
  PlanePositions luma, chroma;   // `luma` also has the positions of RGB
  std::vector<int32_t> verdict;  // Verdict of pair p of block b at p * verdict_pitch + b
  int verdict_pitch = 0;
  SurfaceBand surface;  // positions with a focal map, instead of the above
  // Bit p is set if the verdict of pair p of a block is kShuffle. May be incomplete.
  uint32_t interior_pairs(int block) const {
    if (interior) return ~0u;
    return mapped ? static_cast<uint32_t>(surface.interior_pairs[block]) : 0;
  }
};

struct FaceBlock {
  int32_t face;
  uint8_t corners;   // bit k: corner k is local
  bool smooth;       // see fit_weights()
  int32_t entry[3];  // indices of the BlockWeights of local corners
  // If `smooth`, row r has pixels [x0, x1) of the block if bit r of `rows` is set. Their weights are w(t) = at + t rise
  // + t (t - 1)/4 bend, with t = 0..1 along the block.
  uint32_t rows;
  uint8_t x0[kBandRows], x1[kBandRows];
  alignas(32) uint32_t at[3][kBandRows];         // 2^30 = 1, plus kWeightOffset
  alignas(32) uint32_t rise_bend[3][kBandRows];  // two int16_t, 2^15 = 1: rise in the low bits
};

// The latest two faces of a block, because the next row mostly has the same faces.
struct LastFaces {
  int32_t face[2] = {-1, -1};
  int32_t number[2] = {};  // index into Scratch::faces
};

// The working memory of one thread, which is reused from band to band.
struct Scratch {
  CellNodes inverse;  // inverse distances of a focal map with nodes kCell apart, around the band, over the whole view
  CellWork cells;
  std::vector<BlockWeights> weights;
  size_t weights_used = 0;
  std::vector<int32_t> head;  // for each block of the rectangle, its first BlockWeights, or -1
  std::vector<FaceBlock> faces;
  size_t faces_used = 0;
  std::vector<LastFaces> last_faces;  // per block of the rectangle
  // Pixels of the face without corners, for views with a WeightGrid: bit x of entry (block, row) at block * kBandRows +
  // row.
  std::vector<uint16_t> grid_pixels;
  std::vector<SlotBand> bands;  // per slot
  // The sums, in whole blocks: [row][plane] for RGB, luma [row][0] and chroma [pair][1..2]. They point to the memory
  // below or directly to the output.
  int16_t* sum[kBandRows][3] = {};
  uint16_t* lost[kBandRows] = {};
  std::vector<int16_t> sum_memory[kBandRows][3];
  std::vector<uint16_t> missing_memory[kBandRows];
  bool any_missing = false;
};

// The whole task, which all rows and threads share.
struct SumTask {
  const ViewPlan* plan = nullptr;
  const FaceRuns* runs = nullptr;
  std::vector<Slot> slots;
  std::vector<int32_t> slot_of_camera;  // -1: not local
  std::vector<uint8_t> face_corners;    // per plan.faces(); bit k: corner k is local
  PixelFamily family = PixelFamily::kNone;
  bool exact = false;
};

// Computes rows y to y + kBandRows - 1, clipped to `rect`, into scratch.sum and scratch.lost. They must have room for
// all blocks that intersect `rect`. y must be a multiple of kBandRows, and rect.y0 must be even in I420.
void render_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch);
const char* target_name();

// Returns the projection into a slot's camera near (x, y) of the view. It is scaled to a depth of about 1 there, far
// from the limits of float; the scale does not affect the result. The result's `near` is `inverse` if there is a focal
// map.
ProjectionTerms terms_at(const Slot& slot, double x, double y);
ProjectionTerms terms_at(const Slot& slot, double x, double y, double inverse);

// Sets interior_y0 and interior_y1. In these rows, all blocks of the slot's rectangle can be shuffled and interpolated
// accurately, so no test per block is needed. Tests nodes kBlock rows apart, with a margin for the rows between.
// from_pixel, lens and image must be set.
void find_interior_rows(PixelFamily family, Slot& slot);

// Adds a camera's contribution to rows y + 2 pair and y + 2 pair + 1 (before y_end) of one block to scratch.sum and
// scratch.lost. It works pixel by pixel in double, because float cannot decide whether a sample is missing. `x` is the
// left edge of the block, and `out` its index in scratch.
void add_mixed_block(const SumTask& task, const BlockWeights& weights, int pair, int x, int out, int y_end, int y,
                     Scratch& scratch);

// A task together with the data that its slots point to. Not movable.
struct PreparedTask {
  // See SumRenderer.
  PreparedTask(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources, PixelFamily family,
               Coordinates coordinates);
  PreparedTask(const PreparedTask&) = delete;
  PreparedTask& operator=(const PreparedTask&) = delete;

  SumTask task;
  Rect rect;  // bounds the rectangles of all slots

 private:
  std::vector<CameraProjection> projections;
};

// Replaces a slot's image on a GPU by the same image in this process's memory.
void place_image(const SumTask& task, Slot& slot, const ImageView& image);

// Returns the sum over the cameras of their pixels in `rect`.
size_t samples_of(const SumTask& task, const Rect& rect);

// Returns the memory of the calling thread, with room for a rectangle and a number of slots. Its previous contents are
// lost.
Scratch& scratch_for(const Rect& rect, size_t slots);

// Provides the images of a task's slots in this process's memory. The needed region of an image on a GPU is downloaded
// on first use. Thread-safe for different slots.
class FetchedImages {
 public:
  // `task` and `sources` must outlive this object. `sources` are the images that the task was made from.
  FetchedImages(const SumTask& task, std::span<const Source> sources)
      : task_(task), sources_(sources), fetched_(task.slots.size()) {}

  // Returns the image of one of the task's slots, valid as long as this object. The result is kNone if there is no
  // image or it is unavailable. The slot must not change.
  const ImageView& of(const Slot& slot) {
    if (!slot.image.on_gpu.image) return slot.image;
    std::unique_ptr<Fetched>& fetched = fetched_[static_cast<size_t>(&slot - task_.slots.data())];
    for (const Source& source : sources_)
      if (!fetched && source.camera == slot.camera)
        fetched = std::make_unique<Fetched>(slot.image, needed_pixels(*task_.plan, slot.camera, *source.rig_camera));
    return fetched->image;
  }

 private:
  struct Fetched {
    Fetched(const ImageView& from, const Rect& part) : image(fetched(from, part, memory)) {}
    FetchBuffers memory;
    ImageView image;
  };
  const SumTask& task_;
  const std::span<const Source> sources_;
  std::vector<std::unique_ptr<Fetched>> fetched_;  // by slot; null until used
};

}  // namespace lf::simd
