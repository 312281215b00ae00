// SPDX-License-Identifier: LGPL-2.1-or-later
#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "base/text.h"
#include "calibration/tracks.h"
#include "fuzz/fuzz.h"
#include "rig/colmap_model.h"
#include "rig/exchange.h"
#include "rig/mesh.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

using lf::fuzz::require;

namespace {

constexpr char kName[] = "input.json";

bool same(const lf::Camera& a, const lf::Camera& b) {
  return a.id == b.id && a.name == b.name && a.width == b.width && a.height == b.height && a.lens == b.lens &&
         a.pose == b.pose && a.image == b.image && a.source == b.source && a.time_offset == b.time_offset;
}

void rig(const std::string& text) {
  const lf::Rig rig = lf::parse_rig(text, kName);
  require(!rig.cameras.empty() && rig.cameras.size() <= lf::kMaxCameras);
  const std::string written = lf::rig_to_json(rig);
  const lf::Rig again = lf::parse_rig(written, kName);
  require(lf::rig_to_json(again) == written && again.cameras.size() == rig.cameras.size());
  for (size_t i = 0; i < rig.cameras.size(); i++) require(same(rig.cameras[i], again.cameras[i]));
  // Either the rig has a mesh, or an error states the reason.
  if (rig.cameras.size() <= 16)
    for (const lf::MeshFace& face : lf::build_mesh(rig).faces)
      for (int i = 0; i < face.corners(); i++) require(face.camera[i] < rig.cameras.size());
}

void views(const std::string& text) {
  const std::vector<lf::NamedView> views = lf::parse_views(text, kName);
  require(!views.empty());
  const std::vector<lf::NamedView> again = lf::parse_views(lf::views_to_json(views), kName);
  require(again.size() == views.size());
  for (size_t i = 0; i < views.size(); i++)
    require(again[i].name == views[i].name && again[i].time == views[i].time && again[i].view == views[i].view);
}

void tracks(const std::string& text) {
  const lf::Tracks tracks = lf::parse_tracks(text, kName);
  for (const lf::Observation& o : tracks.observations)
    require(o.camera < tracks.cameras.size() && o.position < tracks.num_positions);
  const std::string written = lf::tracks_to_json(tracks);
  require(lf::tracks_to_json(lf::parse_tracks(written, kName)) == written);
}

}  // namespace

// Rigs, views and tracks in JSON: a letter selects the format, the text follows. Accepted input is written as an
// equivalent text; errors name the file.
LF_FUZZ_TARGET(json)(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] == 'r') rig(text);
    if (data[0] == 'v') views(text);
    if (data[0] == 't') tracks(text);
  } catch (const lf::Error& error) {
    require(error.what()[0] != 0);
  }
  return 0;
}

namespace {

constexpr uint8_t kPicture[] = {  // a PNG of 1 x 1
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00,
    0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0x00, 0x00, 0x00, 0x02, 0x00, 0x01,
    0x48, 0xaf, 0xa4, 0x71, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

lf::RigImport import_names(const std::string& text) {
  constexpr size_t kMaxFiles = 32, kLongestName = 200;
  const TempDir folder;
  size_t files = 0;
  for (size_t begin = 0; begin < text.size() && files < kMaxFiles; files++) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string name = text.substr(begin, std::min(end - begin, kLongestName));
    begin = end + 1;
    if (name.empty() || name == "." || name == ".." || name.find('/') != name.npos || name.find('\0') != name.npos)
      continue;
    folder.write(name, {reinterpret_cast<const char*>(kPicture), sizeof(kPicture)});
  }
  return lf::import_stanford(folder.path(), {.f = 1});
}

// `text` is parameters.cfg; the images have 1 x 1 pixels.
lf::RigImport import_benchmark(const std::string& text) {
  static const TempDir folder;
  for (const char* number : {"000", "001", "002", "003"})
    folder.write("input_Cam" + std::string(number) + ".png",
                 {reinterpret_cast<const char*>(kPicture), sizeof(kPicture)});
  folder.write("parameters.cfg", text);
  return lf::import_hci(folder.path());
}

// `text` is a file of a format that lists pictures of 1 x 1 pixels in another folder or beside the file.
lf::RigImport import_with_pictures(char kind, const std::string& text) {
  static const TempDir llff, technicolor;
  for (const char* number : {"00", "01", "02", "03"}) {
    const std::string picture(reinterpret_cast<const char*>(kPicture), sizeof(kPicture));
    (kind == 'l' ? llff : technicolor).write("images/A_undist_00001_" + std::string(number) + ".png", picture);
  }
  if (kind == 'l') {
    llff.write("poses_bounds.npy", text);
    return lf::import_llff(llff.path());
  }
  technicolor.write("cameras_parameters.txt", text);
  return lf::import_technicolor(technicolor.path());
}

// Writes a COLMAP model with the cameras 1 and 2, which have the images 1 and 2.
bool write_binary_model(const TempDir& folder) {
  const lf::ColmapCamera camera{"PINHOLE", 8, 6, {9, 9, 4, 3}, 2};
  folder.write("cameras.bin", lf::colmap_cameras_file({{1, camera}, {2, camera}}, true));
  folder.write("images.bin",
               lf::colmap_images_file(
                   {{1, 1, {1, 0, 0, 0}, {0, 0, 0}, "a.png"}, {2, 2, {1, 0, 0, 0}, {-1, 0, 0}, "b.png"}}, true));
  return true;
}

lf::RigImport import(const TempDir& folder, char kind, const std::string& text) {
  if (kind == 's') return import_names(text);
  if (kind == 'h') return import_benchmark(text);
  if (kind == 'l' || kind == 'a') return import_with_pictures(kind, text);
  if (kind == 'b') {
    const size_t size = text.empty() ? 0 : std::min(size_t{8} * static_cast<uint8_t>(text[0]), text.size() - 1);
    static const TempDir binary;  // without cameras.txt, which would be preferred
    binary.write("cameras.bin", text.substr(std::min<size_t>(1, text.size()), size));
    binary.write("images.bin", text.substr(std::min(1 + size, text.size())));
    return lf::import_colmap(binary.path());
  }
  if (kind == 'e' || kind == 'q') {
    static const TempDir model;
    static const bool is_written = write_binary_model(model);
    require(is_written);
    model.write(kind == 'e' ? "frames.bin" : "rigs.bin", text);
    return kind == 'e' ? lf::import_colmap(model.path(), {.frame = 6}) : lf::import_colmap(model.path(), {.rig = 6});
  }
  const size_t end = std::min(text.find('\f'), text.size());
  const std::string first = text.substr(0, end), second = end < text.size() ? text.substr(end + 1) : "";
  if (kind == 'f' || kind == 'r') {
    const size_t third = std::min(second.find('\f'), second.size());
    static const TempDir model;
    model.write("cameras.txt", first);
    model.write("images.txt", second.substr(0, third));
    model.write(kind == 'f' ? "frames.txt" : "rigs.txt", third < second.size() ? second.substr(third + 1) : "");
    return kind == 'f' ? lf::import_colmap(model.path(), {.frame = 6}) : lf::import_colmap(model.path(), {.rig = 6});
  }
  if (kind == 'c' || kind == 'g') {
    folder.write("cameras.txt", first);
    folder.write("images.txt", second);
    const int side = kind == 'g' ? 2 : 0;
    return lf::import_colmap(folder.path(), {.rows = side, .columns = side});
  }
  using Importer = lf::RigImport(const std::string& path);
  const std::pair<char, Importer*> importers[] = {{'d', lf::import_deepview},
                                                  {'k', lf::import_kalibr},
                                                  {'m', lf::import_mrcal},
                                                  {'n', lf::import_nerf},
                                                  {'v', lf::import_miv}};
  for (const auto& [letter, importer] : importers)
    if (kind == letter) return importer(folder.write("input", text));
  if (kind == 't' || kind == 'u') return lf::import_caliscope(folder.write("input", text), kind == 'u');
  folder.write("extrinsics.yml", second);
  return lf::import_opencv_yaml(folder.write("input", first), kind == 'p');
}

}  // namespace

// Files of other programs: the first letter selects the importer, the text follows. c, g: COLMAP's cameras.txt and
// images.txt, separated by a form feed, g as a grid of 2x2; b: COLMAP's cameras.bin, with its size divided by 8 in the
// first byte, and images.bin; e: frame 6 of COLMAP's frames.bin; q: rig 6 of rigs.bin; f: frame 6 of COLMAP's
// cameras.txt, images.txt and frames.txt; r: rig 6 of cameras.txt, images.txt and rigs.txt; a: Technicolor's
// cameras_parameters.txt; d: DeepView Video; h: parameters.cfg of the 4D Light Field Benchmark; k: Kalibr; l: LLFF's
// poses_bounds.npy; m: mrcal; n: NeRF; o: OpenCV, with extrinsics.yml after a form feed; p: OpenCV with undistorted
// pictures; s: file names of a Stanford archive folder, one per line; t, u: Caliscope, u with undistorted videos; v:
// MPEG Immersive Video. Every accepted rig can be written, read again and meshed.
LF_FUZZ_TARGET(import)(const uint8_t* data, size_t size) {
  static const TempDir folder;
  static const char* const only = std::getenv("LF_IMPORTER");  // a letter: a run for a single importer
  if (size == 0) return 0;
  const char kind = only ? *only : static_cast<char>(data[0]);
  try {
    const lf::Rig rig = import(folder, kind, {reinterpret_cast<const char*>(data) + 1, size - 1}).rig;
    require(!rig.cameras.empty() && rig.cameras.size() <= lf::kMaxCameras);
    const std::string written = lf::rig_to_json(rig);
    require(lf::rig_to_json(lf::parse_rig(written, "rig.json")) == written);
    require(!lf::build_mesh(rig).faces.empty());
  } catch (const lf::Error& error) {
    require(error.what()[0] != 0);
  }
  return 0;
}
