// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/consistency_codec.h"

#include <algorithm>
#include <iterator>

#include "base/maths.h"
#include "base/text.h"
#include "focus/hypothesis_levels.h"
#include "rig/rig.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

// The sums of a single camera follow from few values: the weight and, for each hypothesis, a luma or "not visible".
// This is their compact form; see spec.md.
size_t packed_bytes(size_t nodes, size_t hypotheses) { return nodes * (4 + hypotheses); }

struct SeenByOne {
  std::vector<uint16_t> weight;
  std::vector<uint16_t> blind;  // bit t: not visible in hypothesis t
  std::vector<std::vector<uint8_t>> luma;
};

// Returns the luma of a camera with this weight that yields both sums, or -1 if there is none.
int luma_that_adds(uint16_t weight, uint16_t luma, uint16_t square) {
  if (weight == 0) return luma == 0 && square == 0 ? 0 : -1;
  const int first = std::max((256 * luma - 128 + weight - 1) / weight, 0);
  for (int value = first; value <= 255 && PhotoConsistency::luma_of(weight, value) == luma; value++)
    if (PhotoConsistency::square_of(luma, value) == square) return value;
  return -1;
}

// Returns nullopt if the sums contain several cameras.
std::optional<SeenByOne> seen_by_one(std::span<const PhotoConsistency> hypotheses, const Rect& rect) {
  const size_t nodes = static_cast<size_t>(rect.width()) * static_cast<size_t>(rect.height());
  SeenByOne seen{std::vector<uint16_t>(nodes), std::vector<uint16_t>(nodes),
                 std::vector(hypotheses.size(), std::vector<uint8_t>(nodes))};
  size_t i = 0;
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++, i++) {
      const size_t node = static_cast<size_t>(y) * hypotheses[0].columns + x;
      for (const PhotoConsistency& moments : hypotheses)
        seen.weight[i] = std::max(seen.weight[i], moments.weight[node]);
      for (size_t t = 0; t < hypotheses.size(); t++) {
        const uint16_t weight = hypotheses[t].weight[node];
        const int value = luma_that_adds(weight, hypotheses[t].luma[node], hypotheses[t].square[node]);
        if (value < 0 || (weight != 0 && weight != seen.weight[i])) return std::nullopt;
        if (weight != seen.weight[i]) seen.blind[i] |= static_cast<uint16_t>(1 << t);
        seen.luma[t][i] = static_cast<uint8_t>(value);
      }
    }
  return seen;
}

// Predicts a luma from the nodes to the left, above and diagonally above.
int predicted(const std::vector<uint8_t>& luma, size_t i, size_t width) {
  const int left = i % width > 0 ? luma[i - 1] : 0, above = i >= width ? luma[i - width] : left;
  if (i < width || i % width == 0) return above;
  const int between = luma[i - width - 1];
  if (between >= std::max(left, above)) return std::min(left, above);
  if (between <= std::min(left, above)) return std::max(left, above);
  return left + above - between;
}

// Predicts a weight by linear extrapolation of the two weights on the left.
uint16_t bend(const std::vector<uint16_t>& weight, size_t i, size_t width) {
  const size_t x = i % width;
  return static_cast<uint16_t>((x > 0 ? 2 * weight[i - 1] : 0) - (x > 1 ? weight[i - 2] : 0));
}

std::vector<uint8_t> pack(const SeenByOne& seen, size_t width) {
  const size_t nodes = seen.weight.size();
  std::vector<uint8_t> out(packed_bytes(nodes, seen.luma.size()));
  for (size_t i = 0; i < nodes; i++) {
    const auto off = static_cast<uint16_t>(seen.weight[i] - bend(seen.weight, i, width));
    out[i] = static_cast<uint8_t>(off >> 8);
    out[nodes + i] = static_cast<uint8_t>(off);
    out[2 * nodes + i] = static_cast<uint8_t>(seen.blind[i] >> 8);
    out[3 * nodes + i] = static_cast<uint8_t>(seen.blind[i]);
    for (size_t t = 0; t < seen.luma.size(); t++)
      out[(4 + t) * nodes + i] = static_cast<uint8_t>(seen.luma[t][i] - predicted(seen.luma[t], i, width));
  }
  return out;
}

// Packs the sums of the nodes in a rectangle. Returns nullopt if the sums contain several cameras.
std::optional<std::vector<uint8_t>> pack_one_camera(std::span<const PhotoConsistency> hypotheses, const Rect& rect) {
  const std::optional<SeenByOne> seen = seen_by_one(hypotheses, rect);
  if (!seen) return std::nullopt;
  return pack(*seen, static_cast<size_t>(rect.width()));
}

// `packed` contains packed_bytes() for all nodes of `hypotheses`, which must be zero. Throws Error for impossible
// values.
void unpack_one_camera(std::span<const uint8_t> packed, std::span<PhotoConsistency> hypotheses) {
  const auto width = static_cast<size_t>(hypotheses[0].columns), nodes = hypotheses[0].weight.size();
  SeenByOne seen{std::vector<uint16_t>(nodes), std::vector<uint16_t>(nodes),
                 std::vector(hypotheses.size(), std::vector<uint8_t>(nodes))};
  for (size_t i = 0; i < nodes; i++) {
    seen.weight[i] = static_cast<uint16_t>(bend(seen.weight, i, width) + (packed[i] << 8 | packed[nodes + i]));
    seen.blind[i] = static_cast<uint16_t>(packed[2 * nodes + i] << 8 | packed[3 * nodes + i]);
    if (seen.weight[i] > PhotoConsistency::kWeightOne) throw Error("weight: must be at most 1");
    if (seen.blind[i] >> hypotheses.size() != 0) throw Error("depth hypotheses: a node uses an unknown hypothesis");
    for (size_t t = 0; t < hypotheses.size(); t++) {
      std::vector<uint8_t>& luma = seen.luma[t];
      luma[i] = static_cast<uint8_t>(packed[(4 + t) * nodes + i] + predicted(luma, i, width));
      if (seen.blind[i] >> t & 1) continue;
      hypotheses[t].weight[i] = seen.weight[i];
      hypotheses[t].luma[i] = PhotoConsistency::luma_of(seen.weight[i], luma[i]);
      hypotheses[t].square[i] = PhotoConsistency::square_of(hypotheses[t].luma[i], luma[i]);
    }
  }
}

constexpr size_t kHeaderBytes = kUnitHeaderBytes + 4 + 4 + 8 + 4 + 2 + 2 + 2 + 8;
constexpr uint16_t kOfGains = 1, kOfOneCamera = 2;  // unit flags
constexpr uint8_t kHasWeight = 1;                   // flag of a hypothesis; without it, every node has the full weight

Rect seen_nodes(std::span<const PhotoConsistency> hypotheses) {
  Rect rect;
  for (const PhotoConsistency& moments : hypotheses)
    for (int y = 0; y < moments.rows; y++) {
      const uint16_t* const row = moments.weight.data() + static_cast<size_t>(y) * moments.columns;
      const auto has = [](uint16_t w) { return w != 0; };
      const uint16_t* const first = std::find_if(row, row + moments.columns, has);
      if (first == row + moments.columns) continue;
      const auto last = std::find_if(std::reverse_iterator(row + moments.columns), std::reverse_iterator(row), has);
      rect = unite(rect, {static_cast<int>(first - row), y, static_cast<int>(last.base() - row), y + 1});
    }
  return rect;
}

template <class Plane, class Fn>
void for_rows(Plane& values, int columns, const Rect& rect, const Fn& fn) {
  for (int y = rect.y0; y < rect.y1; y++) {
    const auto row = values.data() + static_cast<size_t>(y) * columns;
    fn(row + rect.x0, row + rect.x1);
  }
}

bool is_whole(const PhotoConsistency& moments, const Rect& rect) {
  bool whole = true;
  for_rows(moments.weight, moments.columns, rect, [&](const uint16_t* first, const uint16_t* past) {
    whole = whole && std::all_of(first, past, [](uint16_t w) { return w == PhotoConsistency::kWeightOne; });
  });
  return whole;
}

void put_plane(BufferWriter& out, const std::vector<uint16_t>& values, int columns, const Rect& rect) {
  for_rows(values, columns, rect, [&](const uint16_t* first, const uint16_t* past) {
    for (; first < past; first++) out.put(*first);
  });
}

void read_plane(Reader& in, std::vector<uint16_t>& values) {
  const std::span<const uint8_t> bytes = in.get_bytes(2 * values.size());
  for (size_t i = 0; i < bytes.size() / 2; i++) values[i] = static_cast<uint16_t>(bytes[2 * i] << 8 | bytes[2 * i + 1]);
}

// The fields between the unit header and the rectangle. Gains are optional. `reserved` must be 0.
template <typename Io, typename Header, typename Shape, typename Reserved>
void head_fields(Io& io, Header& header, Shape& shape, Reserved& reserved) {
  field<uint32_t>(io, header.view_id);
  field<uint32_t>(io, header.sequence);
  field<uint64_t>(io, header.rig_hash);
  field<uint32_t>(io, header.node);
  field<uint16_t>(io, shape.columns);
  field<uint16_t>(io, shape.rows);
  field<uint8_t>(io, shape.hypotheses);
  field<uint8_t>(io, reserved);
  if (!header.gains) return;
  field<uint32_t>(io, header.gains->weight);
  field<uint32_t>(io, header.gains->log2);
}

Reader read_header(std::span<const uint8_t> bytes, ConsistencyHeader& moments, ConsistencyShape& shape, bool& of_one) {
  const UnitHeader header = read_unit_header(bytes, UnitKind::kAnswer, kConsistencyType, kOfGains | kOfOneCamera);
  check_unit_size(bytes, header);
  of_one = header.flags & kOfOneCamera;
  if (of_one && header.flags & kOfGains) throw Error("flags: gains and one camera exclude each other");
  Reader in(bytes.subspan(kUnitHeaderBytes));
  if (header.flags & kOfGains) moments.gains.emplace();
  uint8_t reserved;
  head_fields(in, moments, shape, reserved);
  if (!in.ok()) throw Error("photo-consistency: the unit ends before its hypotheses");
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  if (shape.hypotheses < 1 || shape.hypotheses > kMaxHypotheses)
    throw Error("depth hypotheses: must be 1 to " + std::to_string(kMaxHypotheses) + ", not " +
                std::to_string(shape.hypotheses));
  if (shape.columns < 1 || shape.columns > kMaxImageSize || shape.rows < 1 || shape.rows > kMaxImageSize)
    throw Error("photo-consistency: no view has " + std::to_string(shape.columns) + " x " + std::to_string(shape.rows) +
                " nodes");
  return in;
}

void read_hypotheses(Reader& in, ConsistencyUnit& unit) {
  for (PhotoConsistency& moments : unit.hypotheses) {
    const uint8_t flags = in.get<uint8_t>();
    if (flags > kHasWeight) throw Error("depth hypotheses: unknown flags " + std::to_string(flags));
    if (flags & kHasWeight)
      read_plane(in, moments.weight);
    else
      std::ranges::fill(moments.weight, PhotoConsistency::kWeightOne);
    read_plane(in, moments.luma);
    read_plane(in, moments.square);
  }
  if (!in.ok() || in.left() != 0) throw Error("photo-consistency: the unit's length does not fit its hypotheses");
}

ConsistencyUnit read_consistency(std::span<const uint8_t> bytes, const ConsistencyShape& expected) {
  ConsistencyUnit unit;
  bool of_one;
  Reader in = read_header(bytes, unit, unit.shape, of_one);
  if (unit.shape != expected)
    throw Error("photo-consistency: the number of nodes and hypotheses must be as in the request");
  const auto [columns, rows, hypotheses] = unit.shape;
  const int x = in.get<uint16_t>(), y = in.get<uint16_t>(), w = in.get<uint16_t>(), h = in.get<uint16_t>();
  unit.rect = {x, y, x + w, y + h};
  if (unit.rect.x1 > columns || unit.rect.y1 > rows || (w == 0) != (h == 0))
    throw Error("rectangle: is not inside the map");
  const size_t nodes = static_cast<size_t>(w) * static_cast<size_t>(h);
  std::vector<uint8_t> packed;
  if (of_one)
    packed = inflate_exactly(in.get_bytes(in.left()), packed_bytes(nodes, hypotheses));
  else if (in.left() < hypotheses * (1 + 4 * nodes))
    throw Error("photo-consistency: the unit ends before its hypotheses do");
  unit.hypotheses.resize(hypotheses);
  for (PhotoConsistency& moments : unit.hypotheses) moments.reset(w, h);
  if (of_one)
    unpack_one_camera(packed, unit.hypotheses);
  else
    read_hypotheses(in, unit);
  return unit;
}

}  // namespace

void ConsistencyUnit::add_to(std::span<PhotoConsistency> sums) const {
  for (size_t t = 0; t < hypotheses.size(); t++) sums[t].add(hypotheses[t], rect.x0, rect.y0);
}

std::vector<PhotoConsistency> ConsistencyUnit::sums() const {
  std::vector<PhotoConsistency> sums(hypotheses.size());
  for (PhotoConsistency& sum : sums) sum.reset(shape.columns, shape.rows);
  add_to(sums);
  return sums;
}

bool is_consistency(std::span<const uint8_t> bytes) {
  const std::optional<UnitHeader> header = peek_unit(bytes);
  return header && header->kind == UnitKind::kAnswer && header->type == kConsistencyType;
}

ByteBuffer encode_consistency(const ConsistencyHeader& header, std::span<const PhotoConsistency> hypotheses,
                              bool small) {
  if (hypotheses.empty() || hypotheses.size() > kMaxHypotheses)
    throw Error("depth hypotheses: must be 1 to " + std::to_string(kMaxHypotheses) + ", not " +
                std::to_string(hypotheses.size()));
  const Rect rect = seen_nodes(hypotheses);
  const size_t nodes = static_cast<size_t>(rect.width()) * static_cast<size_t>(rect.height());
  size_t size = kHeaderBytes + (header.gains ? 8 : 0);
  std::vector<uint8_t> packed;
  if (small && !header.gains && !rect.empty())
    if (const std::optional<std::vector<uint8_t>> one = pack_one_camera(hypotheses, rect)) packed = deflate_all(*one);
  std::vector<bool> whole;
  for (const PhotoConsistency& moments : hypotheses) {
    if (moments.columns != hypotheses[0].columns || moments.rows != hypotheses[0].rows)
      throw Error("depth hypotheses: all depth hypotheses must have the same number of nodes");
    whole.push_back(is_whole(moments, rect));
    size += 1 + 2 * nodes * (whole.back() ? 2 : 3);
  }
  if (!packed.empty()) size = kHeaderBytes + packed.size();
  ByteBuffer bytes(size);
  BufferWriter out(bytes.data());
  const uint16_t flags = header.gains ? kOfGains : packed.empty() ? uint16_t{0} : kOfOneCamera;
  put_unit_header(out, UnitKind::kAnswer, kConsistencyType, flags, size);
  const ConsistencyShape shape{hypotheses[0].columns, hypotheses[0].rows, hypotheses.size()};
  constexpr uint8_t kReserved = 0;
  head_fields(out, header, shape, kReserved);
  for (const int v : {rect.x0, rect.y0, rect.width(), rect.height()}) out.put(static_cast<uint16_t>(v));
  out.put_bytes(packed);
  for (size_t t = 0; t < hypotheses.size() && packed.empty(); t++) {
    out.put(whole[t] ? uint8_t{0} : kHasWeight);
    const int columns = hypotheses[t].columns;
    if (!whole[t]) put_plane(out, hypotheses[t].weight, columns, rect);
    put_plane(out, hypotheses[t].luma, columns, rect);
    put_plane(out, hypotheses[t].square, columns, rect);
  }
  return bytes;
}

std::optional<ConsistencyHeader> parse_consistency_header(std::span<const uint8_t> bytes, ConsistencyShape* shape,
                                                          std::string* reason) {
  return catch_reason(reason, [&] {
    ConsistencyHeader header;
    ConsistencyShape read;
    bool of_one;
    read_header(bytes, header, read, of_one);
    if (shape) *shape = read;
    return header;
  });
}

std::optional<ConsistencyUnit> decode_consistency(std::span<const uint8_t> bytes, const ConsistencyShape& expected,
                                                  std::string* reason) {
  return catch_reason(reason, [&] { return read_consistency(bytes, expected); });
}

}  // namespace lf::wire
