// SPDX-License-Identifier: LGPL-2.1-or-later
// Files of other programs: the first letter selects the importer, the text follows. c, g: COLMAP's cameras.txt and
// images.txt, divided by a form feed, g as a grid of 2x2; k: Kalibr; n: NeRF; o: OpenCV, with extrinsics.yml behind a
// form feed; s: the names of a folder in the Stanford archive's way, a line each. Every rig that an importer accepts
// can be written, read again and meshed.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "fuzz/fuzz.h"
#include "rig/exchange.h"
#include "rig/mesh.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"

using lf::fuzz::require;

namespace {

constexpr uint8_t kPicture[] = {  // a PNG of 1 x 1
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00,
    0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0x00, 0x00, 0x00, 0x02, 0x00, 0x01,
    0x48, 0xaf, 0xa4, 0x71, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

lf::RigImport import_names(const std::string& text) {
  constexpr size_t kMostFiles = 32, kLongestName = 200;
  const TempDir folder;
  size_t files = 0;
  for (size_t begin = 0; begin < text.size() && files < kMostFiles; files++) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string name = text.substr(begin, std::min(end - begin, kLongestName));
    begin = end + 1;
    if (name.empty() || name == "." || name == ".." || name.find('/') != name.npos || name.find('\0') != name.npos)
      continue;
    folder.write(name, {reinterpret_cast<const char*>(kPicture), sizeof(kPicture)});
  }
  return lf::import_stanford(folder.path(), {.f = 1});
}

lf::RigImport import(const TempDir& folder, char kind, const std::string& text) {
  if (kind == 's') return import_names(text);
  const size_t end = std::min(text.find('\f'), text.size());
  const std::string first = text.substr(0, end), second = end < text.size() ? text.substr(end + 1) : "";
  if (kind == 'c' || kind == 'g') {
    folder.write("cameras.txt", first);
    folder.write("images.txt", second);
    const int side = kind == 'g' ? 2 : 0;
    return lf::import_colmap(folder.path(), {.rows = side, .columns = side});
  }
  if (kind == 'k' || kind == 'n') {
    const std::string path = folder.write("input", text);
    return kind == 'k' ? lf::import_kalibr(path) : lf::import_nerf(path);
  }
  folder.write("extrinsics.yml", second);
  return lf::import_opencv_yaml(folder.write("input", first));
}

}  // namespace

LF_FUZZ_TARGET(import)(const uint8_t* data, size_t size) {
  static const TempDir folder;
  if (size == 0) return 0;
  try {
    const lf::Rig rig =
        import(folder, static_cast<char>(data[0]), {reinterpret_cast<const char*>(data) + 1, size - 1}).rig;
    require(!rig.cameras.empty() && rig.cameras.size() <= lf::kMaxCameras);
    const std::string written = lf::rig_to_json(rig);
    require(lf::rig_to_json(lf::parse_rig(written, "rig.json")) == written);
    require(!lf::build_mesh(rig).faces.empty());
  } catch (const lf::Error& error) {
    require(error.what()[0] != 0);
  }
  return 0;
}
