// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/import_format.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/text.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr char kSearched[] =
    "camera_array.toml (caliscope); cameras.txt or cameras.bin in the folder, in sparse/0 or in sparse (colmap); JSON "
    "with \"projection_type\" and \"radial_distortion\" (deepview); parameters.cfg with [intrinsics], and "
    "input_Cam000.png (hci); camchain*.yaml (kalibr); poses_bounds.npy (llff); JSON with \"cameras\" that have "
    "\"Projection\" or \"Focal\" (miv); *.cameramodel (mrcal); transforms.json or transforms_train.json (nerf); YAML "
    "with camera_matrix, M1 and D1, or Ks (opencv); pictures with names such as out_00_01_-381.9_-776.8_.png "
    "(stanford); "
    "cameras_parameters.txt (technicolor)";

// Files that show a format, by the name of the format, in natural order.
using Signs = std::map<std::string, std::vector<fs::path>>;

bool is_folder_format(const std::string& format) {
  return format == "colmap" || format == "hci" || format == "llff" || format == "stanford" || format == "technicolor";
}

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

// Returns the first MiB of a regular file, or "" if the file cannot be read.
std::string beginning(const fs::path& file) {
  std::string text(size_t{1} << 20, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
  return text;
}

// True if a text has the key in the form KEY: or "KEY":, as JSON and YAML have.
bool has_key(const std::string& text, std::string_view key) {
  const auto is_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.'; };
  for (size_t at = text.find(key); at != text.npos; at = text.find(key, at + 1)) {
    if (at > 0 && is_word(text[at - 1])) continue;
    size_t end = at + key.size();
    if (end < text.size() && (text[end] == '"' || text[end] == '\'')) end++;
    end = text.find_first_not_of(' ', end);
    if (end != text.npos && text[end] == ':') return true;
  }
  return false;
}

std::string format_of_yaml(const fs::path& file, const std::string& text) {
  if (file.filename().string().find("camchain") != std::string::npos) return "kalibr";
  if (has_key(text, "cam0") && has_key(text, "camera_model")) return "kalibr";
  const bool is_stereo = has_key(text, "M1") && has_key(text, "D1");
  const bool is_multiview = has_key(text, "Ks") && has_key(text, "distortions");
  return has_key(text, "camera_matrix") || is_stereo || is_multiview ? "opencv" : "";
}

std::string format_of_json(const std::string& text, bool is_given) {
  if (has_key(text, "projection_type") && has_key(text, "radial_distortion")) return "deepview";
  if (has_key(text, "cameras") && (has_key(text, "Projection") || has_key(text, "Focal"))) return "miv";
  if (is_given && (has_key(text, "transform_matrix") || has_key(text, "camera_angle_x"))) return "nerf";
  return "";
}

// Returns the name of the format that a file shows, or "". `is_given`: the user gave this file and not its folder.
std::string format_of_file(const fs::path& file, bool is_given) {
  static const std::map<std::string, const char*, std::less<>> kNames = {
      {"camera_array.toml", "caliscope"},        {"cameras.txt", "colmap"},    {"cameras.bin", "colmap"},
      {"cameras_parameters.txt", "technicolor"}, {"poses_bounds.npy", "llff"}, {"transforms.json", "nerf"},
      {"transforms_train.json", "nerf"}};
  static const std::regex kStanford(
      R"((out_\d{1,5}_\d{1,5}(_-?\d+\.?\d*){2}_?|.+_\d{1,5}_\d{1,5}(_-?\d+\.\d+){2}(_\d+\.?\d*){2})\.(png|jpg|jpeg))",
      std::regex::icase);
  constexpr size_t kLongestName = 255;  // std::regex is recursive
  const std::string name = file.filename().string(), ending = file.extension().string();
  if (const auto known = kNames.find(name); known != kNames.end()) return known->second;
  if (name == "parameters.cfg") {
    const bool has_picture = is_file(file.parent_path() / "input_Cam000.png");
    return has_picture && beginning(file).find("[intrinsics]") != std::string::npos ? "hci" : "";
  }
  if (ending == ".cameramodel") return "mrcal";
  if (name.size() <= kLongestName && std::regex_match(name, kStanford)) return "stanford";
  const bool is_yaml = ending == ".yaml" || ending == ".yml", is_json = ending == ".json";
  if (!is_yaml && !is_json && !is_given) return "";
  const std::string text = beginning(file);
  const size_t first = text.find_first_not_of(" \t\r\n");
  const bool has_braces = first != text.npos && (text[first] == '{' || text[first] == '[');
  return is_json || (has_braces && !is_yaml) ? format_of_json(text, is_given) : format_of_yaml(file, text);
}

Signs find_signs(const fs::path& folder, const std::vector<fs::path>& files) {
  Signs signs;
  for (const fs::path& file : files)
    if (const std::string format = format_of_file(file, false); !format.empty()) signs[format].push_back(file);
  for (const char* model : {"sparse/0", "sparse"})
    for (const char* name : {"cameras.txt", "cameras.bin"})
      if (const fs::path file = folder / model / name; !signs.contains("colmap") && is_file(file))
        signs["colmap"] = {file};
  // transforms_val.json and the like have other cameras of the same scene.
  if (const auto nerf = signs.find("nerf"); nerf != signs.end()) nerf->second.resize(1);
  return signs;
}

// `root` is the folder that the user gave, or the folder of the file that the user gave.
ImportFormat make_format(const std::string& name, const std::vector<fs::path>& files, const fs::path& root,
                         bool is_folder) {
  const fs::path& file = files.front();
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const bool reads_folder = is_folder_format(name) || (name == "mrcal" && is_folder);
  ImportFormat format{name, (reads_folder ? folder : file).lexically_normal().string(), "",
                      file.lexically_normal().string()};
  if (name == "colmap") {
    format.sign =
        (folder / (is_file(folder / "cameras.txt") ? "images.txt" : "images.bin")).lexically_normal().string();
    std::error_code ignored;
    for (const fs::path& place : {folder, root})
      if (format.images.empty() && fs::is_directory(place / "images", ignored))
        format.images = (place / "images").lexically_normal().string();
  } else if (files.size() > 1) {
    format.sign += ", ...";
  }
  return format;
}

std::string join(const std::vector<std::string>& texts, const char* last) {
  std::string joined;
  for (size_t i = 0; i < texts.size(); i++)
    joined += (i == 0 ? "" : i + 1 < texts.size() ? ", " : std::string(" ") + last + " ") + texts[i];
  return joined;
}

[[noreturn]] void fail_with_several_formats(const std::string& path, const Signs& signs) {
  std::vector<std::string> names, commands;
  for (const auto& [name, files] : signs) {
    const ImportFormat format = make_format(name, files, path, true);
    names.push_back(name + " (" + format.sign + ")");
    commands.push_back("\"" + import_command(format) + "\"");
  }
  throw Error(path + ": has files of several formats: " + join(names, "and") + ". Choose one of the commands " +
              join(commands, "or"));
}

ImportFormat find_in_folder(const std::string& path) {
  std::vector<fs::path> files = paths_in(path);
  std::erase_if(files, [](const fs::path& file) { return !is_file(file); });
  const Signs signs = find_signs(path, files);
  if (signs.size() > 1) fail_with_several_formats(path, signs);
  if (signs.empty()) {
    for (const fs::path& file : files)
      if (file.extension() == ".json" && is_rig_file(file.string()))
        throw Error(file.string() + ": is already a rig file, so it does not need an import");
    throw Error(path + ": has no file of a known format. The searched files are: " + kSearched);
  }
  const auto& [name, found] = *signs.begin();
  if (found.size() > 1 && !is_folder_format(name) && name != "mrcal") {
    throw Error(path + ": has " + std::to_string(found.size()) + " files of the format " + name + ", for example " +
                found[0].string() + " and " + found[1].string() + ". Give one file instead of the folder");
  }
  return make_format(name, found, path, true);
}

ImportFormat find_in_file(const std::string& path) {
  if (!std::ifstream(path)) throw Error(path + ": can't be read");
  const std::string name = format_of_file(path, true);
  if (!name.empty()) return make_format(name, {path}, fs::path(path).parent_path(), false);
  if (is_rig_file(path)) throw Error(path + ": is already a rig file, so it does not need an import");
  throw Error(path + ": has no known format. The searched files are: " + kSearched);
}

std::string shell_word(const std::string& word) {
  if (word.find_first_of(" \t\n'\"\\`$&;|<>()*?") == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

ImportFormat find_import_format(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::directory) return find_in_folder(path);
  if (status.type() == fs::file_type::regular) return find_in_file(path);
  throw Error(path + ": can't be read: " + (error ? error.message() : "is not a regular file or a folder"));
}

std::string import_command(const ImportFormat& format) {
  return "lf-rig import " + format.name + " " + shell_word(format.path) +
         (format.images.empty() ? "" : " --images " + shell_word(format.images));
}

}  // namespace lf
