// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_source.h"

#include <gst/gst.h>

#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>

#include "rig/bin_description.h"

namespace lf {
namespace {

enum class FileType { kOther, kPng, kJpeg, kMatroska };

// By the first bytes. Throws MissingFile if there is nothing to read.
FileType sniff(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw MissingFile(path + ": no such file");
  if (!std::filesystem::is_regular_file(path, error)) throw MissingFile(path + ": not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw MissingFile(path + ": can't be opened for reading");
  std::array<char, 4> bytes{};
  file.read(bytes.data(), bytes.size());
  const std::string_view magic(bytes.data(), static_cast<size_t>(file.gcount()));
  if (magic == "\x89PNG") return FileType::kPng;
  if (magic.substr(0, 3) == "\xff\xd8\xff") return FileType::kJpeg;
  if (magic == "\x1a\x45\xdf\xa3") return FileType::kMatroska;
  return FileType::kOther;
}

CameraSource::Codec codec_of(FileType type) {
  switch (type) {
    case FileType::kPng: return CameraSource::Codec::kPng;
    case FileType::kJpeg: return CameraSource::Codec::kJpeg;
    default: return CameraSource::Codec::kOther;
  }
}

// How many %d, %4d, %04d `text` holds; nothing if it holds another printf conversion. "%%" is a plain %.
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

// `path` with every % doubled: the folder in front of a pattern is no pattern.
std::string escape_percent(const std::string& path) {
  std::string escaped;
  for (const char c : path) escaped.append(c == '%' ? 2 : 1, c);
  return escaped;
}

std::string numbered(const std::string& pattern, int number) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  g_autofree gchar* path = g_strdup_printf(pattern.c_str(), number);  // one %d, as checked by the caller
#pragma GCC diagnostic pop
  return path;
}

CameraSource find_sequence(const std::string& text, const std::string& resolved) {
  if (count_conversions(text) != 1)
    throw Error("source \"" + text + "\": an image sequence has exactly one %d (or %04d); a plain % is written %%");
  const std::string folder = resolved.substr(0, resolved.size() - text.size());
  CameraSource source{.kind = CameraSource::Kind::kSequence, .location = escape_percent(folder) + text};
  std::error_code error;
  if (!std::filesystem::exists(numbered(source.location, 0), error)) source.first = 1;
  const std::string first = numbered(source.location, source.first);
  if (!std::filesystem::exists(first, error))
    throw MissingFile(resolved + ": no such files (the first number is 0 or 1)");
  source.codec = codec_of(sniff(first));
  if (source.codec == CameraSource::Codec::kOther) throw Error(first + ": an image sequence must be PNG or JPEG files");
  return source;
}

// What GStreamer's own URI of the file is.
std::string file_uri(const std::string& path) {
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* uri = gst_filename_to_uri(path.c_str(), &error);
  if (!uri) throw Error(path + ": " + error->message);
  return uri;
}

// Whether the source of the URI has pictures on a pad of its own, in place of bytes or packets.
bool gives_pictures(const std::string& uri) {
  GstElement* source = gst_element_make_from_uri(GST_URI_SRC, uri.c_str(), nullptr, nullptr);
  if (!source) return false;
  gst_object_ref_sink(source);
  bool pictures = false;
  if (GstPad* pad = gst_element_get_static_pad(source, "src")) {
    GstCaps* caps = gst_pad_get_pad_template_caps(pad);
    for (guint i = 0; i < gst_caps_get_size(caps) && !gst_caps_is_any(caps); i++) {
      const gchar* name = gst_structure_get_name(gst_caps_get_structure(caps, i));
      pictures |= g_str_equal(name, "video/x-raw") || g_str_equal(name, "image/jpeg");
    }
    gst_caps_unref(caps);
    gst_object_unref(pad);
  }
  gst_object_unref(source);
  return pictures;
}

}  // namespace

CameraSource find_camera_source(const Rig& rig, const Camera& camera) {
  using Kind = CameraSource::Kind;
  if (camera.source.empty() && camera.image.empty()) return {};

  const bool still = camera.source.empty();
  const std::string& text = still ? camera.image : camera.source;
  if (!still && is_bin_description(text)) return {.kind = Kind::kBin, .location = text};
  std::string path = rig.resolve(text);
  if (gst_uri_is_valid(path.c_str())) {
    if (!gst_uri_has_protocol(path.c_str(), "file"))
      return {.kind = gives_pictures(path) ? Kind::kDevice : Kind::kUri, .location = path};
    g_autofree gchar* local = g_filename_from_uri(path.c_str(), nullptr, nullptr);
    if (!local) throw Error("source \"" + text + "\": not a file URI with an absolute path");
    path = local;
  } else if (!still && text.find('%') != std::string::npos) {
    return find_sequence(text, path);
  }

  const FileType type = sniff(path);
  const CameraSource::Codec codec = codec_of(type);
  if (codec != CameraSource::Codec::kOther) return {.kind = Kind::kStill, .codec = codec, .location = path};
  if (still) return {.kind = Kind::kStill, .location = file_uri(path)};
  if (type == FileType::kMatroska) return {.kind = Kind::kMatroska, .location = path};
  return {.kind = Kind::kUri, .location = file_uri(path)};
}

}  // namespace lf
