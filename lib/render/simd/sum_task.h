// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/lens.h"
#include "geometry/pose.h"
#include "image/image.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "render/view_plan.h"

// Data that the vector code of SumRenderer uses. The code renders one band of kBandRows rows of the view at a time, and
// divides the band into blocks of kBlock pixels. Bands and blocks are aligned to the view, so that a pixel does not
// depend on where the rendered rectangle begins.
//
// Terms: a slot is one contributing camera with its image and projection. A window is a piece of an image plane, 16
// bytes wide, that contains the samples of half a row of a block. The fast path reads windows with vector loads and
// selects the samples with byte shuffles ("shuffled"), instead of loading each sample separately ("gathered").
namespace lf::simd {

inline constexpr int kBlock = 16;       // pixels
inline constexpr int kChromaBlock = 8;  // chroma samples per block
inline constexpr int kBandRows = 8;     // rows of pixels; keeps a band's data in the innermost caches
inline constexpr int kBandPairs = kBandRows / 2;
inline constexpr int kPositionBits = 11;  // fractional bits of positions relative to a block's window

// A CameraProjection that is linearised around one pixel of the view, so that float is precise enough. The pixel with
// the offset (i, j) from that pixel has the camera coordinates from + i along + j down, up to a positive factor. A
// focal map adds (inverse distance - near) times per_from + i per_along + j per_down.
struct ProjectionTerms {
  double near = 0;
  float from[3] = {}, along[3] = {}, down[3] = {};
  float per_from[3] = {}, per_along[3] = {}, per_down[3] = {};
};

// Bounds of the derivatives of a position in the image, in focal lengths, by (u, v), or for a fisheye lens by the
// direction of the point. A point on a straight line then moves on a great circle with angular velocity w and relative
// change e of its distance: w' = -2 e w and w'' = 6 e^2 w - 2 w^3. The first three derivatives of (a, b) along a great
// circle grow with the angle from the axis.
struct Bends {
  // `angle`: largest angle from the axis of a fisheye lens, radians.
  Bends(const Lens::Steepness& of, bool fisheye, double angle = kFisheyeFieldDegrees * M_PI / 180);
  float first, second, third;
};

// A camera of the task, with its image and its projection in float. Cameras without an image also have a slot, because
// their weight counts as missing.
struct Slot {
  CameraIndex camera = 0;
  ImageView image;                             // if its family is kNone, all weight is missing
  const VisibilityMask* visibility = nullptr;  // reduces the weights, see Source; may be null
  const DepthEdges* edges = nullptr;           // may be null
  Rect rect;                                   // bounds the pixels with a weight of the camera; x0 and y0 are even
  // For RGB images, shuffle indices. `pixel_pairs` selects from two groups of eight bytes, each with a pixel and its
  // right neighbour. It selects R of the pixel, R of the neighbour, then G and B in the same way. The first indices are
  // 0 3 1 4 2 5 if pixels have three bytes.
  alignas(16) uint8_t pixel_pairs[16] = {};
  alignas(16) uint8_t pixel_taps[16] = {};  // selects from four pixels: all R, then G, then B
  const CameraProjection* projection = nullptr;
  // Camera coordinates of pixel (x, y) of the view are from_pixel * (x, y, 1), up to a positive factor. A focal map
  // adds the inverse distance times per_inverse * (x, y, 1).
  Mat3 from_pixel;
  Mat3 per_inverse{0};
  ProjectionTerms terms;   // with a focal map: at the first pixel of the first block and band of `rect`
  float eye_distance = 0;  // see ViewPlan
  float fx = 0, fy = 0, cx = 0, cy = 0;
  Distortion<float> distortion;  // limit is slightly less than in the lens, so that rounding does not cross the fold
  bool is_distorted = false;
  Lens::Steepness steepness;  // in the image; only for lenses with Distortion::is_general
  // Longest block, in pixels of the image, where the third differences of positions bound the interpolation error: in
  // the whole image, and within `inner_radius` pixels of the principal point.
  float longest_block = INFINITY, longest_inner_block = INFINITY;
  float inner_radius = 0;
  bool needs_double = false;  // terms of the distortion cancel, so that float is not precise enough
  // Rows [y0, y1) of the view, in which all samples are taken far from the border of the camera's image, and the image
  // appears nearly upright and at nearly its original size. In these rows, the fastest loops can run without a test of
  // each block. In `flat` rows, all windows can be flat. In `sloped` rows, which only lenses that bend rows have, all
  // windows can be tall. See find_interior_rows().
  struct InteriorRows {
    int y0 = 0, y1 = 0;
    bool contain(int from, int to) const { return y0 <= from && to <= y1; }
  };
  InteriorRows flat, sloped;
};

// One camera's weights in one block of a band; 32767 is weight 1.
struct alignas(64) BlockWeights {
  int16_t w[kBandRows][kBlock];
  int32_t slot;
  int32_t next;   // index of the block's next BlockWeights, or -1
  uint32_t rows;  // bit r is set if row r has non-zero weights
};

// The possible ways of reading the samples of one plane in a block or in half of it. A block uses the fastest way that
// is possible for all its planes, rows and halves. kSampleBit: pixel by pixel; all are inside the image. kFlatBit: byte
// shuffles of windows of three image rows. kTallBit: byte shuffles of windows of more rows, which may extend beyond the
// end of the image where a flat window does not. kLostBit: no sample is visible to the camera. Without any bit, each
// sample is projected, because some are missing, near the border, or not accurately interpolated.
enum FetchBits : int32_t { kSampleBit = 1, kTallBit = 2, kFlatBit = 4, kLostBit = 8 };

// Shows where in a plane of the image the samples of one row of a block are. Positions are relative to the corner of
// the block's window, in fixed point with kPositionBits fractional bits, so that 16 bits suffice. For example, 2048 is
// one pixel. Exact positions are computed only at the edges of blocks. Positions inside a block are interpolated from
// the exact positions at the four nearest edges (Bessel interpolation): p(t) = p0 + t D + t (t - 1)/4 S, where t is 0
// to 1 along the block. D is the difference between the edges of the block (dx and dy), and S is the sum of the second
// differences at both edges (sx and sy).
struct WindowPositions {
  uint16_t x0, dx;
  int16_t sx, y0, dy, sy;
  uint16_t x0_half;  // x0 in the window of the block's second half
  // Columns, plus 256 times the rows, from the corner to the window of the second half. Flat windows begin in one row.
  int16_t half;
  int columns_to_half() const { return half & 0xff; }
  int rows_to_half() const { return half >> 8; }
};

// Positions of the samples of one plane in a band, with one entry for each row and block.
struct PlanePositions {
  std::vector<float> node_x, node_y;  // positions at the left edges of blocks, starting one block before the first
  std::vector<WindowPositions> window;
  std::vector<int32_t> corner;  // byte offset of the window in the plane
  std::vector<int32_t> fetch;   // FetchBits of each entry of `window`
  void resize(size_t n);
};

// Focal maps with the smallest distance between nodes, kCell pixels, have a fast path. The map is divided into cells
// between four nodes. The exact position in the image is computed at the nodes, and interpolated quadratically in
// between if the error is provably at most kGridError (cells-inl.h). The nodes are between pixels 1 and 2 of every
// four, so each half of a block's row lies between four nodes. Chroma is interpolated from the same nodes, once for
// each pair of rows.
inline constexpr int kCell = FocalMap::kMinStep;
inline constexpr int kHalf = kBlock / 2;
inline constexpr int kCellRows = kBandRows / kCell + 2;  // rows of nodes around a band

// One value for each node of a focal map in kCellRows rows, or for each cell to the right of or below a node. Even and
// odd columns are separate, so that vectors can load every second node. The first even node is to the left of the first
// pixel.
struct CellNodes {
  std::vector<float> even[kCellRows], odd[kCellRows];
  void resize(size_t n);
};
// Temporary data for the cells of one slot. A bend is the coefficient of the quadratic term of the interpolation along
// a side of a cell. The bends along_x and along_y belong to the upper sides, and down_x and down_y to the left sides.
// `error_bound` is an upper bound of the position error in a cell. All are in pixels of the image.
struct CellWork {
  CellNodes along_x, along_y, down_x, down_y, error_bound;
  void resize(size_t n);
};
// The positions of one camera's samples in a band, for a focal map with nodes kCell pixels apart. Values at row k of
// the nodes, or in the cells below this row, are stored at entry(k, h) for half-block h. Rows of nodes are stored in a
// ring, so that the next band reuses the last rows.
struct SurfaceBand {
  int pitch = 0;      // entries per row of half-blocks; whole vectors and a margin
  int first_row = 0;  // index of row 0 of nodes in the arrays
  int row(int k) const { return (first_row + k) % kCellRows; }
  size_t entry(int k, size_t half) const { return static_cast<size_t>(row(k)) * pitch + half; }
  CellNodes x, y, z, per_z;  // rows of nodes by row(); per_z: 1 / z
  // Bounds of the samples of a half-block, computed as if the whole view were at this row of nodes. NaN means that the
  // positions are outside the range of fixed point.
  std::vector<float> low_x, high_x, low_y, high_y;
  // How far the positions in the cells between two rows of nodes may exceed the bounds of these two rows, because
  // vertical sides bend. NaN means that the interpolation is not accurate enough.
  std::vector<float> slack_x, slack_y;
  // Input of the interpolation: eight values per entry, the x of four nodes and then the y of four nodes, in fixed
  // point (kPositionBits) modulo 2^16. `nodes` are positions relative to an arbitrary multiple of 2^16. `along` are the
  // bends from each node to its right neighbour, and the last of the four is 0. `down` are the bends from each node to
  // the node below.
  std::vector<int16_t> nodes, along, down;
  // For each window, its byte offset in the plane, and the position of its corner in fixed point, with x in the low and
  // y in the high 16 bits. The luma window of row r and half-block h is at index r * pitch + h. The chroma window of
  // the pair p of rows and of block b is at index p * pitch / 2 + b. Origins of chroma windows are in luma pixels.
  std::vector<int32_t> luma_corner, chroma_corner;
  std::vector<uint32_t> luma_origin, chroma_origin;
  std::vector<int32_t> interior_pairs;  // for each block; bit p: pair p can be shuffled
  void resize(int blocks);
};

// The positions of one camera's samples in a band, and how they are read. Entry (row, block) is at row * pitch + block.
// A row of chroma samples belongs to a pair of rows.
struct SlotBand {
  // How a pair of rows of a block is rendered. For kProject, each sample is projected. For kAllMissing, the camera sees
  // none of the samples. For kSample, positions are interpolated and samples are gathered. For kShuffle, positions are
  // interpolated and samples are shuffled. The same holds for kTall, if samples spread over more than three rows of the
  // image, because the focal map has a depth step, or because the lens bends the rows of the view.
  enum SampleMethod : int32_t { kProject, kAllMissing, kSample, kTall, kShuffle };

  int y = -1;  // first row of the band; -1 if the slot has not been placed yet
  const Slot* slot = nullptr;
  SampleMethod interior = kProject;  // kShuffle or kTall if all blocks have this method; otherwise kProject
  bool mapped = false;
  int first_block = 0, blocks = 0;
  int pitch = 0;                     // blocks + 3 nodes
  std::vector<float> columns, rows;  // positions of the nodes for this pitch, in pixels from the first node
  std::vector<float> node_z;
  PlanePositions luma, chroma;  // `luma` also has the positions of RGB
  std::vector<int32_t> method;  // SampleMethod of pair p of block b at p * method_pitch + b
  int method_pitch = 0;
  SurfaceBand surface;  // positions with a focal map, instead of the above
  // Bit p is set if the method of pair p of a block is kShuffle, or kTall in sloped rows. May be incomplete.
  uint32_t interior_pairs(int block) const {
    if (interior != kProject) return ~0u;
    return mapped ? static_cast<uint32_t>(surface.interior_pairs[block]) : 0;
  }
};

// The weights of the cameras of one mesh face in one block of a band.
struct FaceBlock {
  int32_t face;
  uint8_t corners;   // bit k is set if the camera of corner k is local
  bool smooth;       // the weights are a parabola along each row; see fit_weights()
  int32_t entry[3];  // indices of the BlockWeights of local corners
  // Only if `smooth`. Bit r of `rows` is set if the face has pixels in row r; these are pixels [x0[r], x1[r]) of the
  // block. The weights of a corner are w(t) = at + t rise + t (t - 1)/4 bend, with t = 0..1 along the block.
  uint32_t rows;
  uint8_t x0[kBandRows], x1[kBandRows];
  alignas(32) uint32_t at[3][kBandRows];         // weight 1 is 2^30; kWeightOffset is added
  alignas(32) uint32_t rise_bend[3][kBandRows];  // weight 1 is 2^15; int16_t: rise low, bend high
};

// A cache of the latest two faces of a block, because the next row mostly has the same faces.
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
  // For views with a WeightGrid, which pixels belong to the face without corners. Bit x of the entry at block *
  // kBandRows + row is set if the pixel x of the block in that row does.
  std::vector<uint16_t> grid_pixels;
  std::vector<SlotBand> bands;  // per slot
  // The sums of the band, in whole blocks. RGB is at [row][plane]. I420 has luma at [row][0], and chroma at [pair of
  // rows][1..2]. The pointers refer to the memory below or directly to the output.
  int16_t* sum[kBandRows][3] = {};
  uint16_t* lost[kBandRows] = {};
  std::vector<int16_t> sum_memory[kBandRows][3];
  std::vector<uint16_t> missing_memory[kBandRows];
  bool any_missing = false;
};

// Input of the renderer for one sum: the view, the faces of its pixels, and the cameras. The task is shared by all
// bands and threads.
struct SumTask {
  const ViewPlan* plan = nullptr;
  const FaceRuns* runs = nullptr;
  std::vector<Slot> slots;
  std::vector<int32_t> slot_of_camera;  // -1: not local
  std::vector<uint8_t> face_corners;    // per plan.faces(); bit k is set if the camera of corner k is local
  PixelFamily family = PixelFamily::kNone;
  bool exact = false;
  bool has_visibility = false;  // some slots have a visibility mask or depth edges
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

// Sets `flat` and `sloped`. In these rows, all blocks of the slot's rectangle can be shuffled and interpolated
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

// Sets the image of a slot to a copy in CPU memory, after the image on a GPU has been downloaded. Also finds the slot's
// interior rows again, because they depend on the strides of the image.
void place_image(const SumTask& task, Slot& slot, const ImageView& image);

// Returns an upper bound of the work in `rect`: the number of pixels that each camera may contribute to, added up over
// the cameras.
size_t samples_of(const SumTask& task, const Rect& rect);

// Returns the calling thread's working memory, with room for a rectangle and a number of slots. Its previous contents
// are lost.
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
