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

// What the vector code of SumRenderer works on: a band of kBandRows rows of a view at a time, in blocks of kBlock
// pixels aligned to the view: results don't depend on where a rectangle begins.
namespace lf::simd {

inline constexpr int kBlock = 16;       // pixels
inline constexpr int kChromaBlock = 8;  // chroma samples of a block
inline constexpr int kBandRows = 8;     // rows of pixels: as many as keep a band's data in the nearest caches
inline constexpr int kBandPairs = kBandRows / 2;
inline constexpr int kPositionBits = 11;  // bits of fraction in positions relative to a block's window

// CameraProjection near a place of the view, in float: from + i along + j down, and times the inverse distance that is
// more than `near`, per_from + i per_along + j per_down.
struct ProjectionTerms {
  double near = 0;
  float from[3] = {}, along[3] = {}, down[3] = {};
  float per_from[3] = {}, per_along[3] = {}, per_down[3] = {};
};

// A source camera of the sum.
struct Slot {
  CameraIndex camera = 0;
  ImageView image;  // family kNone: all lost
  Rect rect;        // bounds the pixels in which the camera has a weight; even in x0, y0
  // RGB: which bytes of two runs of eight are R, G and B of a run's first pixel and of its right neighbour, in turn.
  alignas(16) uint8_t pixel_pairs[16] = {};
  alignas(16) uint8_t pixel_taps[16] = {};  // which bytes of four pixels are R, then G, then B
  const CameraProjection* projection = nullptr;
  // Camera coordinates of pixel (x, y) of the view, up to a positive factor: from_pixel * (x, y, 1).
  Mat3 from_pixel;
  // With a focal map from_pixel is that of inverse distance 0, and per_inverse times the inverse distance is added.
  Mat3 per_inverse{0};
  ProjectionTerms terms;   // with a focal map: at the first pixel of the first block and band of its rectangle
  float eye_distance = 0;  // see ViewPlan
  float fx = 0, fy = 0, cx = 0, cy = 0, k1 = 0, k2 = 0, p1 = 0, p2 = 0, max_r2 = 0;
  bool radial = false, tangential = false;
  // Rows in which all pixels that the camera has a weight in lie well inside its image, nearly upright and at about its
  // scale: see find_calm_rows().
  int calm_y0 = 0, calm_y1 = 0;
  bool is_calm(int y0, int y1) const { return calm_y0 <= y0 && y1 <= calm_y1; }
};

// One camera's weights in one block of a band, 32767 = 1.
struct alignas(64) BlockWeights {
  int16_t w[kBandRows][kBlock];
  int32_t slot;
  int32_t next;   // number of the block's next BlockWeights, -1: none
  uint32_t rows;  // bit r: row r has weights that are not 0
};

// How the samples of one plane and row of a block are fetched.
enum class Fetch : int16_t {
  kMixed,    // some lost, or near the border, or positions don't interpolate well: each sample is projected
  kLost,     // all samples are lost
  kGather,   // inside the image, byte by byte
  kShuffle,  // by a byte shuffle within windows of 16 bytes of three image rows
};

// Positions of the samples of one plane and row of a block relative to its window's corner, in fixed point
// (kPositionBits): p(t) = p0 + t D + t (t - 1)/4 S for t = 0..1 along the block (Bessel's interpolation of four nodes).
struct WindowPositions {
  uint16_t x0, dx;
  int16_t sx, y0, dy, sy;
  uint16_t x0_half;  // x0 in the window of the block's second half
  int16_t half;      // columns from the corner to that window
};

struct PlanePositions {
  std::vector<float> node_x, node_y;  // positions at blocks' left edges, from one block before the first
  std::vector<WindowPositions> window;
  std::vector<int32_t> corner;  // byte offset of the window in the plane
  std::vector<int32_t> fetch;   // Fetch of each entry of `window`
  void resize(size_t n);
};

// Through a focal map whose nodes are kCell pixels apart, positions are quadratic from node to node wherever that can
// be proved good to kGridError (cells-inl.h). Nodes stand between pixels 1 and 2 of every four. Each half of a block
// and row lies between four of them; those of chroma are of the same places, per pair of rows.
inline constexpr int kCell = FocalMap::kFinestStep;
inline constexpr int kHalf = kBlock / 2;
inline constexpr int kCellRows = kBandRows / kCell + 2;  // rows of nodes that a band lies between

// Values at the nodes of kCellRows rows, or of the cells to the right of them or below: in even and odd columns, the
// first even one to the left of the first pixel.
struct CellNodes {
  std::vector<float> even[kCellRows], odd[kCellRows];
  void resize(size_t n);
};
// What is needed of one slot's cells only while they are placed: how positions bend along rows and down, and what they
// are off by at most in a cell, pixels.
struct CellWork {
  CellNodes along_x, along_y, down_x, down_y, doubt;
  void resize(size_t n);
};
// One slot's positions in a band, through a focal map whose nodes are kCell apart. Half h of row k of nodes, or of the
// cells below, is at entry(k, h): a band's last rows of nodes stay where they are for the next one.
struct SurfaceBand {
  int pitch = 0;      // entries for a row of halves; whole vectors, and some more
  int first_row = 0;  // place of row 0 of nodes in the arrays
  int row(int k) const { return (first_row + k) % kCellRows; }
  size_t entry(int k, size_t half) const { return static_cast<size_t>(row(k)) * pitch + half; }
  CellNodes x, y, z, per_z;  // rows of nodes by row(); per_z: 1 / z
  // Bounds of what lies between a half's nodes if all the view were at this row of them; NaN where fixed point doesn't
  // reach.
  std::vector<float> low_x, high_x, low_y, high_y;
  // How far positions may be outside of what lies between the bounds above and below; NaN: they are not good enough.
  std::vector<float> slack_x, slack_y;
  // Eight values an entry: four of x and four of y, in fixed point (kPositionBits) modulo 2^16. nodes: counted from any
  // multiple of 2^16; along: bends to the right of them, the last one 0; bends down.
  std::vector<int16_t> nodes, along, down;
  // Half h of the band's row r at r * pitch + h, block b of its pair p at p * pitch / 2 + b: byte offsets of windows,
  // and where these begin in fixed point, x in the low bits and y; of chroma, in luma's pixels.
  std::vector<int32_t> luma_corner, chroma_corner;
  std::vector<uint32_t> luma_origin, chroma_origin;
  std::vector<int32_t> calm_pairs;  // for each block: bit p: pair p is to be shuffled
  void resize(int blocks);
};

// One slot's positions in a band. Entry (row, block) is at row * pitch + block; rows of chroma are pairs of rows.
struct SlotBand {
  // What is done with a pair of rows of a block.
  // kTall: shuffled, but from windows of more than three rows; only with a focal map.
  enum Verdict : int32_t { kProject, kAllLost, kSample, kTall, kShuffle };

  int y = -1;  // first row of the band; -1: none yet
  const Slot* slot = nullptr;
  bool calm = false;    // all verdicts are kShuffle
  bool mapped = false;  // `surface` has the positions
  int first_block = 0, blocks = 0;
  int pitch = 0;                     // blocks + 3 nodes
  std::vector<float> columns, rows;  // where nodes are, pixels from the first one; for this pitch
  std::vector<float> node_z;
  PlanePositions luma, chroma;   // `luma` has the positions of RGB, too
  std::vector<int32_t> verdict;  // Verdict on block b in pair p at p * verdict_pitch + b
  int verdict_pitch = 0;
  SurfaceBand surface;  // positions of a view with a focal map, in place of the above
  // Bit p: the verdict on pair p of a block is kShuffle. Not all need be told.
  uint32_t calm_pairs(int block) const {
    if (calm) return ~0u;
    return mapped ? static_cast<uint32_t>(surface.calm_pairs[block]) : 0;
  }
};

// A face in one block of a band.
struct FaceBlock {
  int32_t face;
  uint8_t corners;   // bit k: corner k is ours
  bool smooth;       // see fit_weights()
  int32_t entry[3];  // numbers of the BlockWeights of corners that are ours
  // Where `smooth`: bit r: row r has pixels [x0, x1) of the block, whose weights are w(t) = at + t rise + t (t - 1)/4
  // bend, t = 0..1 along the block.
  uint32_t rows;
  uint8_t x0[kBandRows], x1[kBandRows];
  alignas(32) uint32_t at[3][kBandRows];         // 2^30 = 1, raised by kWeightOffset
  alignas(32) uint32_t rise_bend[3][kBandRows];  // two int16_t, 2^15 = 1: rise in the low bits
};

// The two faces that a block met last: those of the next row are mostly the same.
struct LastFaces {
  int32_t face[2] = {-1, -1};
  int32_t number[2] = {};  // index into Scratch::faces
};

// Memory of one thread, reused from band to band.
struct Scratch {
  CellNodes inverse;  // distances of a focal map around the band over the whole view, if it has nodes kCell apart
  CellWork cells;
  std::vector<BlockWeights> weights;
  size_t weights_used = 0;
  std::vector<int32_t> head;  // per block of the rectangle: first BlockWeights, -1: none
  std::vector<FaceBlock> faces;
  size_t faces_used = 0;
  std::vector<LastFaces> last_faces;  // per block of the rectangle
  std::vector<SlotBand> bands;        // per slot
  // The sums, whole blocks: [row][plane] for RGB, luma [row][0] and chroma [pair][1..2]: in the memory below or right
  // where they are wanted.
  int16_t* sum[kBandRows][3] = {};
  uint16_t* lost[kBandRows] = {};
  std::vector<int16_t> sum_memory[kBandRows][3];
  std::vector<uint16_t> lost_memory[kBandRows];
  bool any_lost = false;
};

// The whole task, the same for all rows.
struct SumTask {
  const ViewPlan* plan = nullptr;
  const OwnerRuns* runs = nullptr;
  std::vector<Slot> slots;
  std::vector<int32_t> slot_of_camera;  // -1: not ours
  std::vector<uint8_t> face_corners;    // per plan.faces(): bit k: corner k is ours
  PixelFamily family = PixelFamily::kNone;
  bool exact = false;  // Coordinates::kExact
};

// Computes rows y to y + kBandRows - 1 (as far as `rect` has them; y a multiple of kBandRows) into scratch.sum and
// scratch.lost, which are large enough: all blocks that rect touches. In I420 rect.y0 is even.
void render_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch);
const char* target_name();

// The projection into a slot's camera near (x, y) of the view, times a factor, which changes nothing, that brings the
// depth there to about 1, far from the ends of float. With a focal map distances count from `inverse`.
ProjectionTerms terms_at(const Slot& slot, double x, double y);
ProjectionTerms terms_at(const Slot& slot, double x, double y, double inverse);

// Sets calm_y0 and calm_y1: every block of these rows of the slot's rectangle can be shuffled and interpolates well. It
// looks at nodes kBlock rows apart, with room for what happens between, which saves asking for each block. from_pixel,
// lens and image are set.
void find_calm_rows(PixelFamily family, Slot& slot);

// Adds a camera's contribution where projecting each pixel in float leaves doubt: to rows y + 2 pair and y + 2 pair + 1
// (before y_end) of one block pixel by pixel, in double, to scratch.sum and scratch.lost. `x`: the block's left edge;
// `out`: its number in scratch.
void add_mixed_block(const SumTask& task, const BlockWeights& weights, int pair, int x, int out, int y_end, int y,
                     Scratch& scratch);

// A task with what its slots point at. Stays where it was made.
struct PreparedTask {
  // See SumRenderer.
  PreparedTask(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources, PixelFamily family,
               Coordinates coordinates);
  PreparedTask(const PreparedTask&) = delete;
  PreparedTask& operator=(const PreparedTask&) = delete;

  SumTask task;
  Rect rect;  // bounds the rectangles of all slots

 private:
  std::vector<CameraProjection> projections;
};

// Gives a slot of a task its image in this process's memory, in place of the same image on a card.
void place_image(const SumTask& task, Slot& slot, const ImageView& image);

// Pixels of the rectangle times cameras that may have a weight there.
size_t samples_of(const SumTask& task, const Rect& rect);

// The calling thread's memory, with room for a rectangle and a number of slots, and nothing known of them.
Scratch& scratch_for(const Rect& rect, size_t slots);

// The images of a task's slots in this process's memory: what a view needs of those that are on a card comes from there
// when it is asked for. Thread-safe for different slots.
class FetchedImages {
 public:
  // Both must outlive this; `sources`: what the task was made of.
  FetchedImages(const SumTask& task, std::span<const Source> sources)
      : task_(task), sources_(sources), fetched_(task.slots.size()) {}

  // Of one of the task's slots, which must stay as it is; valid as long as this lives. kNone: it has none, or none can
  // be had.
  const ImageView& of(const Slot& slot) {
    if (!slot.image.on_card.image) return slot.image;
    std::unique_ptr<Fetched>& fetched = fetched_[static_cast<size_t>(&slot - task_.slots.data())];
    for (const Source& source : sources_)
      if (!fetched && source.camera == slot.camera)
        fetched = std::make_unique<Fetched>(slot.image, needed_pixels(*task_.plan, slot.camera, *source.rig_camera));
    return fetched->image;
  }

 private:
  struct Fetched {
    Fetched(const ImageView& from, const Rect& part) : image(fetched(from, part, memory)) {}
    FetchedMemory memory;
    ImageView image;
  };
  const SumTask& task_;
  const std::span<const Source> sources_;
  std::vector<std::unique_ptr<Fetched>> fetched_;  // by slot; null: not asked for yet
};

}  // namespace lf::simd
