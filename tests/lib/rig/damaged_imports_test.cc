// SPDX-License-Identifier: LGPL-2.1-or-later
// Damages the files of all importers: cut files, missing keys, and numbers that are words or not finite.
#include <regex>

#include "base/text.h"
#include "image/image.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

struct Sample {
  const char* name;
  const char* file;  // the file that is damaged
  void (*write)(const Rig& rig, const TempDir& dir);
  RigImport (*import)(const TempDir& dir);
};

std::ostream& operator<<(std::ostream& out, const Sample& sample) { return out << sample.name << " " << sample.file; }

// A flat grid of pinhole cameras with pictures, which all formats can hold.
Rig sample_rig(const TempDir& dir) {
  Rig rig = make_grid_rig({2, 2, 0.1, 60, 8, 6});
  for (Camera& camera : rig.cameras) {
    camera.name = "cam" + std::to_string(camera.id);
    camera.image = camera.name + ".png";
    camera.pose.position += Vec3(1, 2, 3);
    save_image(Image(PixelFamily::kRgb, 8, 6), dir / camera.image);
  }
  rig.directory = dir.path();
  return rig;
}

Rig distorted(Rig rig) {
  for (Camera& camera : rig.cameras) camera.lens = Lens(LensModel::kOpenCv, {7, 7, 3.5, 2.5, 0.01, 0.02, 0.03, 0.04});
  return rig;
}

const std::string kMatrix = ": { rows: 3, cols: 3, data: [9, 0, 4, 0, 9, 3, 0, 0, 1] }\n";
const std::string kTerms = ": { rows: 1, cols: 5, data: [0.1, 0.01, 0.02, 0.03, 0] }\n";

template <auto kExport>
void write_file(const Rig& rig, const TempDir& dir) {
  kExport(distorted(rig), dir / "file");
}
template <auto kImport>
RigImport import_file(const TempDir& dir) {
  return kImport(dir / "file");
}
RigImport read_opencv(const TempDir& dir) { return import_opencv_yaml(dir / "file"); }
RigImport read_model(const TempDir& dir) { return import_colmap(dir / "model"); }
RigImport read_frame(const TempDir& dir) { return import_colmap(dir / "model", {.frame = 1}); }
RigImport read_rig(const TempDir& dir) { return import_colmap(dir / "model", {.rig = 1}); }
template <bool kBinary>
void write_model(const Rig& rig, const TempDir& dir) {
  export_colmap(distorted(rig), dir / "model", {.binary = kBinary, .rig = 1});
}

const Sample kSamples[] = {
    {"caliscope", "file", write_file<export_caliscope>, [](const TempDir& d) { return import_caliscope(d / "file"); }},
    {"caliscope, undistorted", "file", write_file<export_caliscope>,
     [](const TempDir& d) { return import_caliscope(d / "file", true); }},
    {"colmap", "model/cameras.txt", write_model<false>, read_model},
    {"colmap", "model/images.txt", write_model<false>, read_model},
    {"colmap, frame", "model/frames.txt", write_model<false>, read_frame},
    {"colmap, rig", "model/rigs.txt", write_model<false>, read_rig},
    {"colmap", "model/cameras.bin", write_model<true>, read_model},
    {"colmap", "model/images.bin", write_model<true>, read_model},
    {"colmap, frame", "model/frames.bin", write_model<true>, read_frame},
    {"colmap, rig", "model/rigs.bin", write_model<true>, read_rig},
    {"deepview", "file",
     [](const Rig&, const TempDir& d) {
       d.write("file", R"([{"name": "camera_0001", "position": [0.01, 0, 0.5], "orientation": [-0.03, 0.02, -0.5],
"focal_length": 9.5, "pixel_aspect_ratio": 1.0, "principal_point": [4.5, 3], "height": 6.0, "width": 8,
"radial_distortion": [0.1, -0.01, 0], "projection_type": "fisheye"}])");
     },
     import_file<import_deepview>},
    {"hci", "hci/parameters.cfg", [](const Rig& rig, const TempDir& d) { export_hci(rig, d / "hci"); },
     [](const TempDir& d) { return import_hci(d / "hci"); }},
    {"kalibr", "file", write_file<export_kalibr>, import_file<import_kalibr>},
    {"llff", "llff/poses_bounds.npy", [](const Rig& rig, const TempDir& d) { export_llff(rig, d / "llff", 1, 9); },
     [](const TempDir& d) { return import_llff(d / "llff"); }},
    {"miv", "file", [](const Rig& rig, const TempDir& d) { export_miv(rig, d / "file", 1, 9); },
     import_file<import_miv>},
    {"mrcal", "models/cam0.cameramodel",
     [](const Rig& rig, const TempDir& d) { export_mrcal(distorted(rig), d / "models"); },
     [](const TempDir& d) { return import_mrcal(d / "models"); }},
    {"nerf", "file", write_file<export_nerf>, import_file<import_nerf>},
    {"opencv", "file", write_file<export_opencv_yaml>, read_opencv},
    {"opencv, one camera", "file",
     [](const Rig&, const TempDir& d) {
       d.write("file", "image_width: 8\nimage_height: 6\ncamera_matrix" + kMatrix + "distortion_coefficients" + kTerms);
     },
     read_opencv},
    {"opencv, two cameras", "file",
     [](const Rig&, const TempDir& d) {
       d.write("file", "image_size: [8, 6]\nM1" + kMatrix + "D1" + kTerms + "M2" + kMatrix + "D2" + kTerms + "R" +
                           ": { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }\n"
                           "T: { rows: 3, cols: 1, data: [-0.1, 0.2, 0.3] }\n");
     },
     read_opencv},
    {"opencv, several cameras", "file",
     [](const Rig&, const TempDir& d) {
       d.write("file",
               "Rs: { rows: 2, cols: 3, dt: 3d, data: [1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1] }\n"
               "distortions: { rows: 10, cols: 1, data: [0.1, 0, 0, 0, 0, 0, 0, 0, 0, 0] }\n"
               "Ks: { sizes: [2, 3, 3], data: [9, 0, 4, 0, 9, 3, 0, 0, 1, 9, 0, 4, 0, 9, 3, 0, 0, 1] }\n"
               "Ts: { rows: 2, cols: 3, data: [0, 0, 0, -0.5, 0, 0] }\nmodels: { rows: 2, cols: 1, data: [0, 0] }\n"
               "image_sizes: { rows: 2, cols: 2, data: [8, 6, 8, 6] }\n");
     },
     read_opencv},
    {"technicolor", "array/cameras_parameters.txt",
     [](const Rig& rig, const TempDir& d) {
       std::string text = "f cu cv ar sk qw qx qy qz tx ty tz\n";
       for (const Camera& camera : rig.cameras) {
         const std::string number = std::to_string(camera.id);
         save_image(Image(PixelFamily::kRgb, 8, 6), d.write("array/a_undist_00001_" + number + ".png", ""));
         text += "50 4.5 3.5 1 0.01 1 0 0 0 " + number + " -0.25 1.5\n";
       }
       d.write("array/cameras_parameters.txt", text);
     },
     [](const TempDir& d) { return import_technicolor(d / "array"); }},
};

class DamagedImports : public testing::TestWithParam<Sample> {
 protected:
  DamagedImports() {
    GetParam().write(sample_rig(dir_), dir_);
    whole_ = read_binary(dir_ / GetParam().file);
    intact_ = GetParam().import(dir_);
  }

  // Imports a damaged file. Returns false if that has no effect on the lenses and poses. Otherwise, there must be an
  // error with the file and one of `places`, a further note, or fewer cameras.
  bool has_effect(const std::string& text, const std::vector<std::string>& places) const {
    dir_.write(GetParam().file, text);
    try {
      const RigImport result = GetParam().import(dir_);
      if (text_of(result.rig) == text_of(intact_.rig)) return false;
      EXPECT_TRUE(result.notes.size() > intact_.notes.size() || result.rig.cameras.size() < intact_.rig.cameras.size());
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_THAT(what, HasSubstr((fs::path(dir_ / GetParam().file).parent_path()).c_str()));
      EXPECT_TRUE(std::ranges::any_of(places, [&](const std::string& p) { return what.find(p) != what.npos; })) << what;
    }
    return true;
  }
  static std::string text_of(Rig rig) {
    for (Camera& camera : rig.cameras) camera.name.clear(), camera.image.clear();
    return rig_to_json(rig);
  }
  bool is_binary() const { return whole_.find('\0') != whole_.npos; }

  const TempDir dir_;
  std::string whole_;
  RigImport intact_;
};

// A number outside of names and texts.
struct Token {
  size_t at, size;
  std::string key;  // the last key before the number
};

std::vector<Token> numbers_of(const std::string& text) {
  static const std::regex kToken(R"(["']?(\b[A-Za-z_]\w*)["']?\s*[:=]|[\s\[,:=](-?\d[\d.]*(e[-+]?\d+)?)(?=[\s\],}]))");
  std::vector<Token> tokens;
  std::string key;
  for (std::sregex_iterator i(text.begin(), text.end(), kToken), end; i != end; ++i) {
    if ((*i)[1].matched)
      key = (*i)[1];
    else
      tokens.push_back({static_cast<size_t>(i->position(2)), static_cast<size_t>(i->length(2)), key});
  }
  return tokens;
}

TEST_P(DamagedImports, NumbersMustBeFiniteNumbers) {
  if (is_binary()) GTEST_SKIP() << "binary";
  size_t effects = 0;
  const std::vector<Token> tokens = numbers_of(whole_);
  for (const Token& token : tokens)
    for (const char* by : {"nan", ".nan", "1e999", "word"}) {
      std::string text = whole_;
      text.replace(token.at, token.size, by);
      SCOPED_TRACE(text.substr(token.at - std::min<size_t>(30, token.at), 60));
      effects += has_effect(text, {token.key, "line ", "camera "});
    }
  EXPECT_GT(effects, 2 * tokens.size());
}

TEST_P(DamagedImports, MissingKeysAreErrorsOrNoted) {
  if (is_binary()) GTEST_SKIP() << "binary";
  static const std::regex kKey(R"((\b[A-Za-z_]\w*)["']?\s*[:=])");
  for (std::sregex_iterator i(whole_.begin(), whole_.end(), kKey), end; i != end; ++i) {
    std::string text = whole_;
    text.replace(static_cast<size_t>(i->position(1)), static_cast<size_t>(i->length(1)), "zz");
    SCOPED_TRACE((*i)[1]);
    has_effect(text, {(*i)[1], "missing"});
  }
}

TEST_P(DamagedImports, CutFilesAreErrors) {
  // A cut inside of the last number leaves a shorter number, which is not an error.
  const size_t last = std::min(whole_.find_last_of(" ,=", whole_.size() - 2), whole_.size() - 2);
  size_t effects = 0, cuts = 0;
  for (size_t size = 0; size <= last; size += 5, cuts++) {
    SCOPED_TRACE(whole_.substr(size - std::min<size_t>(30, size), std::min<size_t>(30, size)));
    effects += has_effect(whole_.substr(0, size), {""});
  }
  EXPECT_GT(effects, cuts * 9 / 10);
}

TEST_P(DamagedImports, BinaryNumbersMustBeFinite) {
  if (!is_binary()) GTEST_SKIP() << "text";
  int numbers = 0;
  for (size_t at = 0; at + sizeof(double) <= whole_.size(); at++) {
    double number = 0;
    std::memcpy(&number, &whole_[at], sizeof(number));
    if (!(std::abs(number) > 1e-3 && std::abs(number) < 1e3)) continue;
    numbers++;
    std::string bytes = whole_;
    bytes.replace(at, sizeof(double), sizeof(double), '\xff');
    SCOPED_TRACE(at);
    EXPECT_TRUE(has_effect(bytes, {""}));
  }
  EXPECT_GT(numbers, 3);
}

INSTANTIATE_TEST_SUITE_P(Formats, DamagedImports, testing::ValuesIn(kSamples), [](const auto& info) {
  std::string name = info.param.name + std::string(info.param.file);
  std::erase_if(name, [](unsigned char c) { return !std::isalnum(c); });
  return name;
});

}  // namespace
}  // namespace lf
