// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_source.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "image/image_file.h"
#include "rig/source_security.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using Kind = CameraSource::Kind;
using Codec = CameraSource::Codec;

bool exists(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error);
}

// Returns `text` with "%20" and the like decoded, or nullopt for an invalid escape.
std::optional<std::string> percent_decoded(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string decoded;
  for (size_t i = 0; i < text.size(); i++) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    if (i + 2 >= text.size() || digit(text[i + 1]) < 0 || digit(text[i + 2]) < 0) return std::nullopt;
    decoded += static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2]));
    i += 2;
  }
  return decoded;
}

// Returns a hint about a likely mistake in the name of a missing file. The hint starts with a semicolon, or is empty.
std::string naming_advice(const Rig& rig, const std::string& text) {
  if (text.starts_with("\xef\xbb\xbf"))
    return "; the name begins with a byte order mark (three invisible bytes): remove it";
  if (std::isspace(static_cast<unsigned char>(text.front())) || std::isspace(static_cast<unsigned char>(text.back())))
    return "; the name begins or ends with white space: remove it";
  if (text.find('\\') != std::string::npos) return "; folders are separated by /, not by back-slashes: write / instead";
  const auto decoded = percent_decoded(text);
  if (decoded && *decoded != text && exists(rig.resolve(*decoded)))
    return "; \"" + *decoded + "\" exists: names of files are not percent-encoded";
  return "";
}

std::string path_of_file_uri(const std::string& uri) {
  std::string_view rest = std::string_view(uri).substr(sizeof("file:") - 1);
  if (rest.starts_with("//")) rest.remove_prefix(2);
  if (rest.starts_with("localhost/")) rest.remove_prefix(sizeof("localhost") - 1);
  const auto path = percent_decoded(rest);
  if (!path || !path->starts_with('/') || path->find('\0') != std::string::npos)
    throw Error("source \"" + uri +
                "\": not a file URI with an absolute path. Write it as file:///folder/name, with % as %25");
  return *path;
}

std::vector<uint8_t> first_bytes(std::ifstream& file, size_t count) {
  std::vector<uint8_t> bytes(count);
  file.clear();
  file.seekg(0);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

bool has_second_picture(std::ifstream& file, uintmax_t size) {
  constexpr size_t kHeaders = 1 << 16, kMaxBytes = 1 << 26;
  for (size_t count = 1 << 20; count <= kMaxBytes; count *= 2) {
    const std::vector<uint8_t> bytes = first_bytes(file, count);
    const std::optional<size_t> end = jpeg_end(bytes);
    const bool is_all = bytes.size() == size;
    if (end && *end == size) return false;
    if (is_all || (end && bytes.size() - *end >= kHeaders)) return is_jpeg_stream(bytes);
  }
  return false;
}

// Throws MissingFile if the path is not a readable file.
std::ifstream open_file(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw MissingFile(path + ": no such file");
  if (!fs::is_regular_file(path, error)) throw MissingFile(path + ": not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw MissingFile(path + ": can't be opened for reading");
  return file;
}

CameraSource source_of_file(const std::string& path, bool is_image) {
  std::ifstream file = open_file(path);
  const std::vector<uint8_t> magic = first_bytes(file, 4);
  const ImageCoding coding = detect_image_coding(magic);
  std::error_code error;
  if (coding == ImageCoding::kPng) return {.kind = Kind::kStill, .codec = Codec::kPng, .location = path};
  if (coding == ImageCoding::kJpeg) {
    const bool stream = !is_image && has_second_picture(file, fs::file_size(path, error));
    return {.kind = stream ? Kind::kJpegStream : Kind::kStill, .codec = Codec::kJpeg, .location = path};
  }
  if (is_image) return {.kind = Kind::kStill, .location = path};
  const bool matroska =
      std::string_view(reinterpret_cast<const char*>(magic.data()), magic.size()) == "\x1a\x45\xdf\xa3";
  return {.kind = matroska ? Kind::kMatroska : Kind::kFile, .location = path};
}

// Returns the number of %d, %4d, %04d in `text`, or nullopt if it contains another printf conversion. "%%" is a literal
// %.
std::optional<int> count_conversions(const std::string& text) {
  int count = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') continue;
    if (++i < text.size() && text[i] == '%') continue;
    const size_t digits = i;
    while (i < text.size() && std::isdigit(static_cast<unsigned char>(text[i]))) ++i;
    if (i >= text.size() || text[i] != 'd' || i - digits > 2) return std::nullopt;
    ++count;
  }
  return count;
}

// Doubles every %, because the folder of a pattern is not a pattern.
std::string escape_percent(const std::string& path) {
  std::string escaped;
  for (const char c : path) escaped.append(c == '%' ? 2 : 1, c);
  return escaped;
}

std::string numbered(const std::string& pattern, int number) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  const int size = std::snprintf(nullptr, 0, pattern.c_str(), number);  // the caller has checked that there is one %d
  std::string path(static_cast<size_t>(std::max(size, 0)), '\0');
  std::snprintf(path.data(), path.size() + 1, pattern.c_str(), number);
#pragma GCC diagnostic pop
  return path;
}

// Returns the pattern of a sequence as a path, and its first number. Returns nullopt if neither number 0 nor number 1
// exists.
std::optional<CameraSource> pattern_of(const Rig& rig, const std::string& text) {
  if (is_uri(text) || count_conversions(text) != 1) return std::nullopt;
  const std::string resolved = rig.resolve(text);
  const std::string folder = resolved.substr(0, resolved.size() - text.size());
  CameraSource source{.kind = Kind::kSequence, .location = escape_percent(folder) + text};
  for (source.first = 0; source.first <= 1; source.first++)
    if (exists(sequence_file(source, 0))) return source;
  return std::nullopt;
}

// Tests names one by one instead of listing the folder, because the folder may hold the files of all cameras.
int count_pictures(const CameraSource& sequence) {
  int count = 1;
  while (exists(sequence_file(sequence, count))) count++;
  return count;
}

std::string file_behind_gap(const CameraSource& sequence) {
  constexpr int kMinLook = 256;
  for (int ahead = 1; ahead <= std::max(kMinLook, sequence.count); ahead++)
    if (std::string file = sequence_file(sequence, sequence.count + ahead); exists(file)) return file;
  return "";
}

// A sequence that starts with 1 may have lost its number 0. It then ends with the same number as the sequences of other
// cameras that start with 0. Compares a few cameras only, so that the cost does not grow with the array.
void require_first_picture(const Rig& rig, const std::string& text, const CameraSource& sequence) {
  if (sequence.first == 0) return;
  constexpr int kMaxOthers = 3;
  int others = 0;
  for (const Camera& camera : rig.cameras) {
    if (others == kMaxOthers) return;
    if (camera.source == text || camera.source.find('%') == std::string::npos) continue;
    others++;
    CameraSource other = pattern_of(rig, camera.source).value_or(CameraSource{.first = 1});
    if (other.first != 0 || !exists(sequence_file(other, sequence.count)) ||
        exists(sequence_file(other, sequence.count + 1)))
      continue;
    CameraSource from_zero = sequence;
    from_zero.first = 0;
    throw MissingFile(sequence_file(from_zero, 0) + ": missing, while the other cameras' sequences start at " +
                      sequence_file(other, 0) + ": add the missing picture");
  }
}

CameraSource find_sequence(const Rig& rig, const std::string& text) {
  if (count_conversions(text) != 1)
    throw Error("source \"" + text +
                "\": no such file, and not an image sequence. The name of an image sequence contains exactly one %d "
                "(or %04d) for the number of the file; write %% for a percent sign");
  std::optional<CameraSource> source = pattern_of(rig, text);
  if (!source)
    throw MissingFile(rig.resolve(text) + ": no such files (the first file must have number 0 or 1)" +
                      naming_advice(rig, text));
  source->count = count_pictures(*source);
  if (const std::string behind = file_behind_gap(*source); !behind.empty())
    throw MissingFile(sequence_file(*source, source->count) + ": missing, while " + behind +
                      " exists: add the missing picture, or renumber the files of all cameras");
  require_first_picture(rig, text, *source);
  const std::string first = sequence_file(*source, 0);
  source->codec = source_of_file(first, true).codec;
  if (source->codec == Codec::kOther)
    throw Error(first +
                ": is neither PNG nor JPEG, the only formats of image sequences; convert the pictures to one of them");
  return *source;
}

}  // namespace

std::string sequence_file(const CameraSource& sequence, int index) {
  return numbered(sequence.location, sequence.first + index);
}

CameraSource find_source(const Rig& rig, const std::string& text, bool is_image) {
  if (is_uri(text)) {
    if (text.starts_with("file:")) return source_of_file(path_of_file_uri(text), is_image);
    return {.kind = Kind::kUri, .location = text};
  }
  const std::string path = rig.resolve(text);
  const bool has_percent = !is_image && text.find('%') != std::string::npos;
  if (exists(path) && !(has_percent && pattern_of(rig, text))) return source_of_file(path, is_image);
  if (!is_image && is_launch_line(rig, text)) return {.kind = Kind::kBin, .location = text};
  if (has_percent) return find_sequence(rig, text);
  throw MissingFile(path + ": no such file" + naming_advice(rig, text));
}

CameraSource find_camera_source(const Rig& rig, const Camera& camera) {
  if (!camera.source.empty()) return find_source(rig, camera.source, false);
  if (!camera.image.empty()) return find_source(rig, camera.image, true);
  return {};
}

bool has_no_pictures(const Rig& rig) {
  return std::ranges::all_of(rig.cameras,
                             [](const Camera& camera) { return camera.source.empty() && camera.image.empty(); });
}

RigColourCorrections::RigColourCorrections(const Rig& rig) {
  if (!rig.has_colour()) return;
  for (const Camera& camera : rig.cameras) {
    cameras_.push_back(nullptr);
    if (!camera.colour || *camera.colour == ColourModel()) continue;
    cameras_.back() = std::make_unique<CameraEntry>();
    cameras_.back()->model = *camera.colour;
    cameras_.back()->width = camera.width;
    cameras_.back()->height = camera.height;
    cameras_.back()->centre = camera.principal_point();
  }
}

const ColourCorrection* RigColourCorrections::of(CameraIndex camera, PixelFamily family) const {
  if (camera >= cameras_.size() || !cameras_[camera]) return nullptr;
  CameraEntry& found = *cameras_[camera];
  const size_t i = family == PixelFamily::kRgb ? 0 : 1;
  std::call_once(found.made[i], [&] {
    found.correction[i] =
        std::make_unique<const ColourCorrection>(found.model, family, found.width, found.height, found.centre);
  });
  return found.correction[i].get();
}

}  // namespace lf
