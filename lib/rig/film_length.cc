// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/film_length.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"

namespace lf {
namespace {

// EBML element ids of Matroska (RFC 9559).
enum ElementId : uint32_t {
  kSegment = 0x18538067,
  kInfo = 0x1549A966,
  kTimestampScale = 0x2AD7B1,
  kTracks = 0x1654AE6B,
  kTrackEntry = 0xAE,
  kTrackNumber = 0xD7,
  kTrackType = 0x83,
  kCluster = 0x1F43B675,
  kClusterTimestamp = 0xE7,
  kSimpleBlock = 0xA3,
  kBlockGroup = 0xA0,
  kBlock = 0xA1,
};
constexpr uint64_t kVideo = 1;  // TrackType
constexpr uint64_t kUnknownSize = std::numeric_limits<uint64_t>::max();

// Parent elements that the reader enters. It skips all other elements.
bool is_parent(uint32_t id) {
  return id == kSegment || id == kInfo || id == kTracks || id == kTrackEntry || id == kCluster || id == kBlockGroup;
}

class MatroskaReader {
 public:
  explicit MatroskaReader(const std::string& path) : file_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
    struct stat status {};
    if (file_ >= 0 && fstat(file_, &status) == 0 && S_ISREG(status.st_mode))
      size_ = static_cast<uint64_t>(status.st_size);
  }
  ~MatroskaReader() {
    if (file_ >= 0) close(file_);
  }
  MatroskaReader(const MatroskaReader&) = delete;
  MatroskaReader& operator=(const MatroskaReader&) = delete;

  std::optional<FilmLength> length() {
    while (at_ < size_ && !length_.is_cut_off) read_element();
    if (length_.frames == 0) return std::nullopt;
    // The duration of the last frame is assumed to be the mean duration of all other frames.
    const auto frames = static_cast<double>(length_.frames);
    if (length_.frames > 1)
      length_.seconds =
          static_cast<double>(last_ - first_) * static_cast<double>(scale_) * 1e-9 * frames / (frames - 1);
    return length_;
  }

 private:
  // Reads a number of variable length at bytes_[used_]. Returns nullopt at the end of the bytes. `keeps_marker`: ids
  // include the bit that marks their length.
  std::optional<uint64_t> read_number(size_t most, bool keeps_marker) {
    if (used_ >= count_ || bytes_[used_] == 0) return std::nullopt;
    size_t length = 1;
    while (!(bytes_[used_] & (0x80 >> (length - 1)))) length++;
    if (length > most || used_ + length > count_) return std::nullopt;
    uint64_t value = bytes_[used_];
    if (!keeps_marker) value &= 0x7F >> (length - 1);
    for (size_t i = 1; i < length; i++) value = value << 8 | bytes_[used_ + i];
    used_ += length;
    return !keeps_marker && value + 1 == uint64_t{1} << (7 * length) ? kUnknownSize : value;
  }

  uint64_t read_unsigned(uint64_t size) const {
    uint64_t value = 0;
    for (size_t i = 0; i < std::min<uint64_t>(size, 8) && used_ + i < count_; i++)
      value = value << 8 | bytes_[used_ + i];
    return value;
  }

  void read_element() {
    const ssize_t count = pread(file_, bytes_.data(), bytes_.size(), static_cast<off_t>(at_));
    count_ = static_cast<size_t>(std::max<ssize_t>(count, 0));
    used_ = 0;
    const auto id = read_number(4, true);
    const auto size = id ? read_number(8, false) : std::nullopt;
    if (!size) {
      length_.is_cut_off = true;
      return;
    }
    const uint64_t data = at_ + used_, left = data < size_ ? size_ - data : 0;
    const bool fits = *size <= left;
    const auto kind = static_cast<uint32_t>(*id);
    if (is_parent(kind)) {
      if (kind == kSegment && *size != kUnknownSize) segment_fits_ = fits;
      if (kind == kTrackEntry) number_ = type_ = 0;
      at_ = data;
    } else if (fits) {
      read_leaf(kind, *size);
      at_ = data + *size;
    } else {
      length_.is_cut_off = true;
    }
    if (at_ >= size_ && !segment_fits_) length_.is_cut_off = true;
  }

  void read_leaf(uint32_t kind, uint64_t size) {
    if (kind == kTimestampScale) scale_ = read_unsigned(size);
    if (kind == kTrackNumber) number_ = read_unsigned(size);
    if (kind == kTrackType) type_ = read_unsigned(size);
    if (kind == kClusterTimestamp) cluster_ = static_cast<int64_t>(std::min(read_unsigned(size), kMaxTimestamp));
    if (video_ == 0 && type_ == kVideo) video_ = number_;
    if (kind != kSimpleBlock && kind != kBlock) return;
    const auto track = read_number(8, false);
    if (!track || video_ == 0 || *track != video_ || used_ + 2 > count_) return;
    const int64_t time = cluster_ + static_cast<int16_t>(bytes_[used_] << 8 | bytes_[used_ + 1]);
    first_ = length_.frames == 0 ? time : std::min(first_, time);
    last_ = length_.frames == 0 ? time : std::max(last_, time);
    length_.frames++;
  }

  static constexpr uint64_t kMaxTimestamp = uint64_t{1} << 60;
  const int file_;
  uint64_t size_ = 0, at_ = 0;
  std::array<uint8_t, 32> bytes_{};  // at `at_`: id, size and the first bytes of the content
  size_t count_ = 0, used_ = 0;
  uint64_t scale_ = 1000000, number_ = 0, type_ = 0, video_ = 0;
  int64_t cluster_ = 0, first_ = 0, last_ = 0;
  bool segment_fits_ = true;
  FilmLength length_;
};

std::string length_text(const FilmLength& length, const char* unit) {
  std::string text = std::to_string(length.frames) + unit;
  if (length.seconds > 0) text += format_text(" (%.2f s)", length.seconds);
  return text;
}

}  // namespace

std::optional<FilmLength> matroska_length(const std::string& path) { return MatroskaReader(path).length(); }

std::vector<RigFinding> compare_film_lengths(const std::vector<Film>& films) {
  std::vector<RigFinding> findings;
  if (films.empty()) return findings;
  const bool timed = std::ranges::all_of(films, [](const Film& film) { return film.length.seconds > 0; });
  const auto length_of = [&](const Film& film) {
    return timed ? film.length.seconds : static_cast<double>(film.length.frames);
  };
  std::vector<const Film*> sorted;
  for (const Film& film : films) sorted.push_back(&film);
  std::ranges::stable_sort(sorted, {}, [&](const Film* film) { return length_of(*film); });
  const Film& usual = *sorted[sorted.size() / 2];
  const double frame = length_of(usual) / static_cast<double>(usual.length.frames);
  const auto differs = [&](const Film& film, double tolerance) {
    return std::abs(length_of(film) - length_of(usual)) > tolerance;
  };
  const auto count = std::ranges::count_if(films, [&](const Film& film) { return differs(film, frame / 2); });
  const bool is_alone = count == 1 && films.size() > 2;
  const double tolerance = is_alone ? frame / 2 : std::max(2.5 * frame, 0.01 * length_of(usual));
  constexpr size_t kMaxFindings = 8;
  size_t more = 0;
  for (const Film& film : films) {
    const bool is_other = differs(film, tolerance), is_shorter = length_of(film) < length_of(usual);
    if (!is_other && !film.length.is_cut_off) continue;
    if (findings.size() == kMaxFindings && ++more) continue;
    std::string text =
        film.place + (film.length.is_cut_off ? " is truncated after " : " has ") + length_text(film.length, " frames");
    if (is_other) text += std::string(", most others have ") + length_text(usual.length, "");
    text += film.length.is_cut_off || is_shorter ? ": copy or record the film again" : ": is this the right film?";
    findings.push_back({RigFinding::Severity::kWarning, text});
  }
  if (more > 0)
    findings.push_back({RigFinding::Severity::kWarning,
                        std::to_string(more) + " more videos are truncated, or have another length than most videos"});
  return findings;
}

}  // namespace lf
