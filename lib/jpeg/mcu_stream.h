// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "jpeg/header.h"
#include "jpeg/huffman_table.h"
#include "jpeg/scan_data.h"

namespace lf::jpeg {

// The MCUs of a baseline scan, from left to right and from top to bottom, in any order that its reader likes: restart
// markers let it jump, between them it passes over what it is not asked for, once. Not thread-safe.
class McuStream {
 public:
  static constexpr int kMaxBlocks = 10;
  // The dequantised coefficients of one MCU as idct() takes them, block after block in the scan's order.
  struct Mcu {
    alignas(64) int16_t block[kMaxBlocks][64];
    unsigned last[kMaxBlocks];  // no coefficient beyond this one, in zigzag order, is other than zero
  };

  // `header`: one_baseline_scan. `frame`, the bytes it was read from, has to outlive the stream. Check error() before
  // use.
  McuStream(const Header& header, std::span<const uint8_t> frame);
  McuStream(const McuStream&) = delete;
  McuStream& operator=(const McuStream&) = delete;

  // Nullptr, or why nothing can be read.
  const char* error() const { return error_; }

  // Goes to MCU x of row y. False if what lies before it is damaged.
  bool seek(int x, int y);
  // Reads or passes over the next MCU, or `count` MCUs, within the row of the last seek(). False if they are damaged.
  bool read(Mcu& mcu);
  bool pass(int count);

 private:
  struct Block {
    int component;
    const uint16_t* quant;
    const DcTable* dc;
    const AcTable* ac;
  };
  // The place in the data where an MCU begins.
  struct Position {
    int64_t mcu = -1;  // -1: not known
    uint64_t bit = 0;
    int32_t predictor[3] = {};
  };

  Position start_of_segment(int64_t segment);
  Position nearest_before(int64_t mcu);
  bool start_next();
  bool pass_to(int64_t mcu);
  bool move_to(const Position& next);

  const char* error_ = nullptr;
  int mcus_x_ = 0, mcus_y_ = 0;
  int64_t segment_mcus_ = 0;  // MCUs between restart markers
  uint16_t quant_[4][64];
  std::vector<Block> blocks_;
  std::vector<std::shared_ptr<const void>> tables_;
  std::optional<ScanData> data_;
  std::vector<Position> rows_;  // where rows of MCUs begin, as far as it is known
  Position at_;                 // position of the next MCU; where a segment has ended, at its end
  int64_t run_end_ = -1;        // MCUs up to this one lie in the same row and segment as at_, whose
  uint64_t end_of_data_ = 0;    // bits end here; both not known if run_end_ <= at_.mcu
};

}  // namespace lf::jpeg
