// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/gl/passes.h"
#include "render/gl/sum_drawer.h"

namespace lf::gl {

// A sum as kBlocks of sum_shader-inl.h leaves it on the card. All calls while the context is current.
struct BlockSum {
  // Where the parts of it are, 32-bit words: a word for each row of blocks of two by two pixels, the number of the draw
  // if that has lost weight there; another one, the same if it has left something open; the samples.
  struct Parts {
    uint32_t lost_rows = 0, open_rows = 0, pixels = 0, chroma = 0, lost = 0, end = 0;
  };

  PixelFamily family = PixelFamily::kNone;
  Rect rect;  // of the view
  Parts parts;
  uint32_t draw = 0;                // number of the draw that it is of: rows with another have lost nothing
  std::shared_ptr<Computed> words;  // those of all sums of its pass

  // Replaces the rows of lost_rect by what they are now.
  void write_back(const DrawnSum& from);
};

// How a sum is to be read.
struct SumReading {
  BlockSum* sum = nullptr;
  // What it comes to; family and rectangle are the sum's.
  DrawnSum* out = nullptr;
  // Only those rows of it are to come, as lost_rect says, in which something is open that the CPU has to mend.
  bool only_open = false;
  bool any_lost = false;  // result: whether weight is lost anywhere
};
// Waits for sums of one pass, and reads them. False if the card does not answer. While the context is current.
bool read_sums(std::span<SumReading> sums);

// Computes sums, two by two pixels an invocation. (Not by fragment shaders: only 4 of the 132 multiprocessors of an
// H100 or H200 take them.) All calls while the context is current, but for fits().
class BlockSums {
 public:
  BlockSums() : most_words_(Computed::most_words()) {}
  // Whether the sums of views are few enough for one pass.
  bool fits(std::span<const DrawnView> views) const;
  // Has the card begin with the sums of views, which one program draws, whose numbers those are and whose textures are
  // there. False with the reason in `why`.
  bool begin(std::span<const DrawnView> views, PassNumbers& numbers, const ViewTextures& textures, Programs& programs,
             Stopwatch& stopwatch, std::string& why);
  // Has the card add sums, of one family and of the same view, up in the sum of all of that, saturating: what is where
  // none of them is is nothing. They may be of another drawer whose context shares with this one, once they have been
  // waited for, and have to be held until what they come to has been. Null with the reason in `why`.
  std::shared_ptr<BlockSum> add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view, Programs& programs,
                                std::string& why);
  // What was begun last; as long as somebody holds one of them nothing else is drawn there.
  std::span<const std::shared_ptr<BlockSum>> latest() const { return latest_; }

 private:
  std::shared_ptr<Computed> next();

  const size_t most_words_;
  PassNumbers::Buffers numbers_;
  std::vector<std::shared_ptr<Computed>> words_;  // that somebody holds or held
  std::vector<std::shared_ptr<BlockSum>> latest_;
  uint32_t draw_ = 0;  // number of the latest
};

// Computes moments by a compute shader. All calls while the context is current.
class MomentSums {
 public:
  // Has the card begin with the moments in `rect`, which bounds the slots, of a view whose numbers those are and whose
  // textures are there. False with the reason in `why`.
  bool begin(const MomentTask& task, const Rect& rect, const PassNumbers& numbers, const ViewTextures& textures,
             Programs& programs, Stopwatch& stopwatch, std::string& why);
  // Waits for it. False if the card does not answer.
  bool read(DrawnMoments& out);

 private:
  void upload_surfaces(const MomentTask& task, const Rect& rect);

  PassNumbers::Buffers numbers_;
  Buffer surfaces_{Buffer::Use::kNumbers};
  Computed result_;
  std::vector<uint8_t> surface_memory_;
  size_t words_ = 0;  // of the result
};

}  // namespace lf::gl
