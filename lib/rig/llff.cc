// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <regex>
#include <span>
#include <string_view>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"
#include "rig/exchange.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr size_t kColumns = 17;  // 3 x 5 numbers and two depths
constexpr std::string_view kMagic = "\x93NUMPY";

// Reads an array of kColumns columns from a file of NumPy's format 1.0 to 3.0
// (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html), row by row.
std::vector<std::array<double, kColumns>> read_poses(const std::string& path) {
  constexpr size_t kLongestHeader = 65536;
  const std::string bytes = read_file(path);
  const auto fail = [&](const std::string& what) { throw Error(path + ": " + what); };
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<uint8_t>(bytes[i])); };
  if (bytes.size() < 12 || !bytes.starts_with(kMagic)) fail("is not a file of NumPy (.npy)");
  const bool is_long = byte(6) > 1;
  const size_t begin = is_long ? 12 : 10;
  const size_t size = byte(8) | byte(9) << 8 | (is_long ? byte(10) << 16 | byte(11) << 24 : 0);
  if (size > kLongestHeader || size > bytes.size() - begin) fail("the header is truncated");
  const std::string header = bytes.substr(begin, size);
  std::smatch shape;
  static const std::regex kShape(R"('shape': \((\d{1,6}), (\d{1,6})\))");
  if (!std::regex_search(header, shape, kShape) || std::stoul(shape[2]) != kColumns)
    fail("the array must have the shape (number of images, " + std::to_string(kColumns) + ")");
  const bool is_double = header.find("'<f8'") != std::string::npos;
  if (!is_double && header.find("'<f4'") == std::string::npos) fail("the numbers must have the type <f8 or <f4");
  if (header.find("'fortran_order': False") == std::string::npos) fail("the array must not be in Fortran order");
  const size_t rows = std::stoul(shape[1]), width = is_double ? sizeof(double) : sizeof(float);
  if (rows == 0 || rows > kMaxCameras)
    fail("must have 1 to " + std::to_string(kMaxCameras) + " images, but has " + std::to_string(rows));
  if (bytes.size() - begin - size != rows * kColumns * width)
    fail("has another size than its header states, so it is truncated or damaged");
  static_assert(std::endian::native == std::endian::little);
  std::vector<std::array<double, kColumns>> poses(rows);
  const char* from = bytes.data() + begin + size;
  for (size_t i = 0; i < rows; i++)
    for (double& value : poses[i]) {
      float single = 0;
      std::memcpy(is_double ? static_cast<void*>(&value) : &single, from, width);
      if (!is_double) value = single;
      from += width;
      if (!is_finite(value)) fail("image " + std::to_string(i) + " has a number that is not finite");
    }
  return poses;
}

constexpr std::string_view kImages[] = {".jpg", ".jpeg", ".png"}, kFilms[] = {".mp4", ".mkv", ".mov", ".avi", ".webm"};

// Returns the files of a folder with one of the endings, in the order of the poses: sorted by the bytes of their names.
std::vector<std::string> files_with(const std::string& folder, std::span<const std::string_view> endings) {
  std::vector<std::string> files;
  for (const fs::path& path : paths_in(folder)) {
    std::string ending = path.extension().string();
    std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (std::ranges::find(endings, ending) != endings.end()) files.push_back(path.string());
  }
  std::ranges::sort(files);
  return files;
}

ImageSize film_size(double width, double height, const std::string& place) {
  if (!(width <= kMaxImageSize && height <= kMaxImageSize && std::trunc(width) == width &&
        std::trunc(height) == height))
    throw Error(place + ": its width and height must be integers of at most " + std::to_string(kMaxImageSize));
  return {static_cast<int>(width), static_cast<int>(height)};
}

// The axes of LLFF's camera are down, right and backward; ours are right, down and forward. Columns 0 to 3 of each of
// the three rows are these axes and the position, and column 4 is the height, the width and the focal length.
Camera make_camera(const std::array<double, kColumns>& pose, const std::string& file, bool is_film,
                   const std::string& place) {
  const auto at = [&](int row, int column) { return pose[static_cast<size_t>(5 * row + column)]; };
  const auto column = [&](int k) { return Vec3(at(0, k), at(1, k), at(2, k)); };
  constexpr double kMaxError = 1e-2;  // of unit length and right angles; float32 has less
  const Mat3 axes(column(1), column(0), -column(2));
  const Mat3 product = glm::transpose(axes) * axes;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      if (!(std::abs(product[i][j] - (i == j ? 1 : 0)) < kMaxError))
        throw Error(place + ": its axes are not a rotation");
  if (glm::determinant(axes) < 0) throw Error(place + ": its axes are left-handed");
  const double height = at(0, 4), width = at(1, 4), f = at(2, 4);
  if (!(height > 0 && width > 0 && f > 0)) throw Error(place + ": height, width and focal length must be positive");

  const ImageSize size = is_film ? film_size(width, height, place) : load_image_size(file);
  const double scale = size.width / width;
  // Reduced images have rounded sides.
  if (!(std::abs(size.height - height * scale) <= 1 + 0.01 * size.height))
    throw Error(file + ": is " + size_text(size.width, size.height) + ", which is another aspect ratio than the " +
                number_text(width) + "x" + number_text(height) + " of " + place +
                ". The file may have been rotated or cropped");
  Camera camera;
  camera.name = fs::path(file).stem().string();
  (is_film ? camera.source : camera.image) = fs::proximate(file).string();
  camera.width = size.width;
  camera.height = size.height;
  camera.lens = Lens::pinhole(f * scale, (size.width - 1) / 2.0, (size.height - 1) / 2.0);
  camera.pose = {column(3), glm::normalize(glm::quat_cast(axes))};
  return camera;
}

// Returns a file of NumPy's format 1.0.
std::string npy_text(const std::vector<double>& numbers) {
  constexpr size_t kAlignment = 64, kPrefix = kMagic.size() + 4;
  std::string header = format_text("{'descr': '<f8', 'fortran_order': False, 'shape': (%zu, %zu), }",
                                   numbers.size() / kColumns, kColumns);
  header.append(kAlignment - (kPrefix + header.size() + 1) % kAlignment, ' ');
  header += '\n';
  std::string bytes(kMagic);
  for (const size_t byte : {size_t{1}, size_t{0}, header.size() & 255, header.size() >> 8})
    bytes += static_cast<char>(byte);
  bytes += header;
  return bytes.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double));
}

void require_llff_lens(const Camera& camera) {
  constexpr double kTolerance = 1e-6;  // pixels
  const Lens& lens = camera.lens;
  const Vec2 off(lens.cx() - (camera.width - 1) / 2.0, lens.cy() - (camera.height - 1) / 2.0);
  if (lens.has_distortion() || lens.distortion().fisheye || std::abs(lens.fx() - lens.fy()) > kTolerance ||
      glm::length(off) > kTolerance)
    throw_camera_error(camera,
                       "the format can hold only pinhole lenses with equal fx and fy, and the principal point in the "
                       "middle of the image");
}

}  // namespace

RigImport import_llff(const std::string& directory, const std::string& images) {
  const std::string path = (fs::path(directory) / "poses_bounds.npy").string();
  const auto poses = read_poses(path);
  std::error_code ignored;
  const std::string folder = images.empty() ? (fs::path(directory) / "images").string() : images;
  const bool has_films = images.empty() && !fs::exists(folder, ignored);
  const std::vector<std::string> files = has_films ? files_with(directory, kFilms) : files_with(folder, kImages);
  if (files.size() != poses.size())
    throw Error(path + ": has " + std::to_string(poses.size()) + " poses, but " + (has_films ? directory : folder) +
                " has " + std::to_string(files.size()) +
                (has_films ? " videos and no folder images" : " images (.jpg, .png)") +
                ". The poses belong to the files in the order of their names, so the numbers must be equal");
  RigImport result;
  result.has_unit = false;
  double near = HUGE_VAL, far = 0;
  for (size_t i = 0; i < poses.size(); i++) {
    add_camera(make_camera(poses[i], files[i], has_films, path + ": image " + std::to_string(i)), result);
    near = std::min(near, poses[i][15]);
    far = std::max(far, poses[i][16]);
  }
  if (near > 0 && far > near) result.near = near, result.far = far;
  return with_topology(std::move(result));
}

RigExport export_llff(const Rig& rig, const std::string& directory, double near, double far) {
  std::vector<double> numbers;
  for (const Camera& camera : rig.cameras) {
    require_llff_lens(camera);
    const Pose& pose = camera.pose;
    const Vec3 columns[] = {pose.down(), pose.right(), -pose.forward(), pose.position,
                            Vec3(camera.height, camera.width, camera.lens.fx())};
    for (int row = 0; row < 3; row++)
      for (const Vec3& column : columns) numbers.push_back(column[row]);
    numbers.insert(numbers.end(), {near, far});
  }
  const std::vector<std::string> names = file_names_of(
      rig, [](const Camera& camera) { return fs::path(camera.image).extension().string(); },
      [](std::string_view a, std::string_view b) { return a < b; });
  const fs::path images = fs::path(directory) / "images";
  make_folder(images.string());
  for (size_t i = 0; i < names.size(); i++) copy_picture(rig, rig.cameras[i], (images / names[i]).string());
  write_text_file(npy_text(numbers), (fs::path(directory) / "poses_bounds.npy").string());
  const bool has_names = fs::path(names[0]).stem() == rig.cameras[0].name;
  return describe_export(rig, import_llff(directory).rig, {.names = has_names, .ids = false});
}

}  // namespace lf
