// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/mcu_stream.h"

#include <algorithm>
#include <cstring>

#include "jpeg/block_codec.h"

namespace lf::jpeg {
namespace {

// The DC coefficients of 8-bit samples have 11 bits and a sign even where an encoder rounds carelessly: beyond that the
// data is damaged, and predictors that stay in bounds can't overflow.
bool plausible(const int32_t (&predictor)[3]) {
  return std::all_of(predictor, predictor + 3, [](int32_t dc) { return dc >= -2048 && dc <= 2048; });
}

}  // namespace

McuStream::McuStream(const Header& header, std::span<const uint8_t> frame)
    : mcus_x_(header.mcus_x()), mcus_y_(header.mcus_y()) {
  std::memcpy(quant_, header.quant, sizeof quant_);
  for (int i = 0; i < header.components; i++) {
    const Component& c = header.component[i];
    const auto dc = dc_table(header.dc[c.dc]);
    const auto ac = ac_table(header.ac[c.ac]);
    if (!dc || !ac) {
      error_ = "a Huffman table is missing or damaged";
      return;
    }
    blocks_.insert(blocks_.end(), static_cast<size_t>(c.h * c.v), {i, quant_[c.quant], dc.get(), ac.get()});
    tables_.insert(tables_.end(), {dc, ac});
  }
  const int64_t mcus = int64_t{mcus_x_} * mcus_y_;
  segment_mcus_ = header.restart_interval > 0 ? header.restart_interval : mcus;
  data_.emplace(frame.subspan(header.scan), static_cast<size_t>((mcus + segment_mcus_ - 1) / segment_mcus_));
  rows_.resize(static_cast<size_t>(mcus_y_));
}

McuStream::Position McuStream::start_of_segment(int64_t segment) {
  Position start;
  start.mcu = segment * segment_mcus_;
  start.bit = uint64_t{data_->segment(static_cast<size_t>(segment)).begin} * 8;
  return start;
}

// The last known position from which the MCU can be reached.
McuStream::Position McuStream::nearest_before(int64_t mcu) {
  Position best = start_of_segment(mcu / segment_mcus_);
  for (int64_t row = mcu / mcus_x_; row * mcus_x_ > best.mcu; row--)
    if (const Position& start = rows_[static_cast<size_t>(row)]; start.mcu >= 0) {
      best = start;
      break;
    }
  return at_.mcu > best.mcu && at_.mcu <= mcu ? at_ : best;
}

bool McuStream::seek(int x, int y) {
  const int64_t mcu = int64_t{y} * mcus_x_ + x;
  at_ = nearest_before(mcu);
  run_end_ = -1;
  return pass_to(mcu);
}

bool McuStream::pass(int count) { return pass_to(at_.mcu + count); }

// Before an MCU is read: goes on in the next segment where one ends, and remembers where rows begin.
bool McuStream::start_next() {
  if (at_.mcu >= run_end_) {
    const int64_t segment = at_.mcu / segment_mcus_, row = at_.mcu / mcus_x_;
    if (at_.mcu == segment * segment_mcus_) at_ = start_of_segment(segment);
    if (at_.mcu == row * mcus_x_) rows_[static_cast<size_t>(row)] = at_;
    run_end_ = std::min((segment + 1) * segment_mcus_, (row + 1) * mcus_x_);
    end_of_data_ = uint64_t{data_->segment(static_cast<size_t>(segment)).end} * 8;
  }
  return at_.bit < end_of_data_;
}

// Whole bytes left over before a restart marker tell of damage just as bits that are missing. After the last MCU of all
// some cameras send padding.
bool McuStream::move_to(const Position& next) {
  if (next.bit > end_of_data_) return false;
  if (next.mcu == run_end_ && next.mcu % segment_mcus_ == 0 && next.mcu < int64_t{mcus_x_} * mcus_y_ &&
      end_of_data_ - next.bit >= 8)
    return false;
  at_ = next;
  return true;
}

bool McuStream::pass_to(int64_t mcu) {
  while (at_.mcu < mcu) {
    if (!start_next()) return false;
    const int64_t stop = std::min(mcu, run_end_);
    BitReader reader(data_->bytes(), at_.bit);
    int32_t predictor[3] = {at_.predictor[0], at_.predictor[1], at_.predictor[2]};
    for (int64_t i = at_.mcu; i < stop; i++) {
      for (const Block& block : blocks_) {
        reader.refill();
        if (!read_dc(reader, *block.dc, predictor[block.component]) || !skip_ac(reader, *block.ac)) return false;
      }
      if (reader.position() > end_of_data_ || !plausible(predictor)) return false;
    }
    if (!move_to({stop, reader.position(), {predictor[0], predictor[1], predictor[2]}})) return false;
  }
  return true;
}

bool McuStream::read(Mcu& mcu) {
  if (!start_next()) return false;
  BitReader reader(data_->bytes(), at_.bit);
  Position next = at_;
  std::memset(mcu.block, 0, sizeof mcu.block[0] * blocks_.size());
  for (size_t i = 0; i < blocks_.size(); i++) {
    const Block& block = blocks_[i];
    int32_t& predictor = next.predictor[block.component];
    reader.refill();
    if (!read_dc(reader, *block.dc, predictor)) return false;
    reader.refill();
    if (!read_ac(reader, *block.ac, block.quant, mcu.block[i], &mcu.last[i])) return false;
    mcu.block[i][0] = static_cast<int16_t>(predictor * block.quant[0]);
  }
  next.bit = reader.position();
  next.mcu++;
  return plausible(next.predictor) && move_to(next);
}

}  // namespace lf::jpeg
