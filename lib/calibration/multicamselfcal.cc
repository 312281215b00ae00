// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/multicamselfcal.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "base/error.h"
#include "base/json_value.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

using Table = std::vector<std::vector<double>>;

Table read_table(const fs::path& path) {
  Table table;
  std::istringstream text(read_text_file(path.string()));
  size_t number = 0;
  for (std::string line; std::getline(text, line);) {
    number++;
    std::vector<double> row;
    const char* at = line.c_str();
    for (char* end;; at = end) {
      const double value = std::strtod(at, &end);  // knows "nan"
      if (end == at) break;
      row.push_back(value);
    }
    if (std::string_view(at).find_first_not_of(" \t\r") != std::string_view::npos)
      throw Error(path.string() + ": line " + std::to_string(number) + ": not a number: \"" + at + "\"");
    if (row.empty()) continue;
    if (!table.empty() && row.size() != table[0].size())
      throw Error(path.string() + ": line " + std::to_string(number) + ": has " + std::to_string(row.size()) +
                  " columns, the first has " + std::to_string(table[0].size()));
    table.push_back(std::move(row));
  }
  if (table.empty()) throw Error(path.string() + ": is empty");
  return table;
}

Lens read_rad(const fs::path& path, double first_pixel) {
  std::map<std::string, double> values;
  std::istringstream text(read_text_file(path.string()));
  for (std::string line; std::getline(text, line);) {
    char name[16];
    double value;
    if (std::sscanf(line.c_str(), " %15[A-Za-z0-9] = %lf", name, &value) == 2) values[name] = value;
  }
  for (const char* name : {"K11", "K22", "K13", "K23"})
    if (!values.count(name)) throw Error(path.string() + ": " + name + " is missing");
  return Lens(LensModel::kOpenCv,
              {values["K11"], values["K22"], values["K13"] - first_pixel, values["K23"] - first_pixel, values["kc1"],
               values["kc2"], values["kc3"], values["kc4"]});
}

}  // namespace

MultiCamSelfCal load_multicamselfcal(const std::string& directory, double first_pixel) {
  const fs::path folder(directory);
  const Table points = read_table(folder / "points.dat"), seen = read_table(folder / "IdMat.dat"),
              sizes = read_table(folder / "Res.dat");
  const size_t cameras = sizes.size(), positions = points[0].size();
  if (sizes[0].size() != 2) throw Error((folder / "Res.dat").string() + ": must have 2 columns, width and height");
  const auto require = [&](const char* file, const Table& table, size_t rows) {
    if (table.size() != rows || table[0].size() != positions)
      throw Error((folder / file).string() + ": must have " + std::to_string(rows) + " rows of " +
                  std::to_string(positions) + " columns for " + std::to_string(cameras) + " cameras, has " +
                  std::to_string(table.size()) + " of " + std::to_string(table[0].size()));
  };
  require("points.dat", points, 3 * cameras);
  require("IdMat.dat", seen, cameras);
  MultiCamSelfCal result;
  result.tracks.num_positions = positions;
  for (size_t i = 0; i < cameras; i++)
    result.tracks.cameras.push_back(
        {static_cast<uint32_t>(i), static_cast<int>(sizes[i][0]), static_cast<int>(sizes[i][1])});
  for (size_t j = 0; j < positions; j++)
    for (size_t i = 0; i < cameras; i++) {
      const double u = points[3 * i][j], v = points[3 * i + 1][j];
      if (seen[i][j] == 0) continue;
      if (!std::isfinite(u) || !std::isfinite(v))
        throw Error((folder / "points.dat").string() + ": camera " + std::to_string(i) + ", position " +
                    std::to_string(j) + ": not a number, but seen by IdMat.dat");
      result.tracks.observations.push_back(
          {static_cast<uint32_t>(i), static_cast<uint32_t>(j), 0, Vec2(u - first_pixel, v - first_pixel)});
    }
  check_tracks(result.tracks, (folder / "points.dat").string());

  std::vector<fs::path> lenses;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".rad") lenses.push_back(entry.path());
  if (lenses.empty()) return result;
  std::sort(lenses.begin(), lenses.end(), [](const fs::path& a, const fs::path& b) {
    const std::string x = a.filename(), y = b.filename();
    return x.size() != y.size() ? x.size() < y.size() : x < y;  // cam2 before cam10
  });
  if (lenses.size() != cameras)
    throw Error(directory + ": " + std::to_string(lenses.size()) + " files *.rad for " + std::to_string(cameras) +
                " cameras");
  result.lenses.emplace();
  for (size_t i = 0; i < cameras; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(i);
    camera.name = "cam_" + std::to_string(i);
    camera.width = result.tracks.cameras[i].width, camera.height = result.tracks.cameras[i].height;
    camera.lens = read_rad(lenses[i], first_pixel);
    result.lenses->cameras.push_back(camera);
  }
  return result;
}

}  // namespace lf
