// SPDX-License-Identifier: LGPL-2.1-or-later
// Files of other programs: a letter says of which, the text follows (COLMAP's two are divided by a form feed). What is
// taken is a rig that can be written as one, in numbers that are finite.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "fuzz/fuzz.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"

using lf::fuzz::require;

namespace {

lf::RigImport import(const TempDir& folder, char kind, const std::string& text) {
  if (kind == 'c') {
    const size_t end = std::min(text.find('\f'), text.size());
    folder.write("cameras.txt", text.substr(0, end));
    folder.write("images.txt", end < text.size() ? text.substr(end + 1) : "");
    return lf::import_colmap(folder.path());
  }
  const std::string path = folder.write("input", text);
  return kind == 'k' ? lf::import_kalibr(path) : kind == 'n' ? lf::import_nerf(path) : lf::import_opencv_yaml(path);
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
  } catch (const lf::Error& error) {
    require(error.what()[0] != 0);
  }
  return 0;
}
