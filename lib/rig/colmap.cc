// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>

#include "base/error.h"
#include "base/json_value.h"
#include "base/number_text.h"
#include "image/image_file.h"
#include "rig/colmap_text.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr double kColmapPixelCentre = 0.5;           // where COLMAP has the centre of the top-left pixel
constexpr uint32_t kMaxColmapId = 2147483646;  // COLMAP's database checks id < 2147483647

// The lens as it is in the model: its parameters are COLMAP's but for where pixels have their centre.
Lens lens_of(const ColmapCamera& camera) {
  std::optional<LensModel> model = lens_model_from_name(camera.model);
  if (!model && camera.model == "FULL_OPENCV" &&
      std::all_of(camera.params.begin() + 8, camera.params.end(), [](double k) { return k == 0; }))
    model = LensModel::kOpenCv;
  if (!model) throw Error("no lens of ours equals its " + camera.model + " without loss");
  std::array<double, Lens::kMaxParams> params{};
  std::copy_n(camera.params.begin(), lens_model_num_params(*model), params.begin());
  params[camera.num_focal] -= kColmapPixelCentre;
  params[camera.num_focal + 1] -= kColmapPixelCentre;
  return Lens(*model, params);
}

Lens undistorted_lens(const ColmapCamera& camera, int width, int height) {
  const double fx = camera.params[0], fy = camera.params[camera.num_focal - 1];
  const double cx = camera.params[camera.num_focal] * width / camera.width;
  const double cy = camera.params[camera.num_focal + 1] * height / camera.height;
  return Lens(LensModel::kPinhole, {fx, fy, cx - kColmapPixelCentre, cy - kColmapPixelCentre});
}

Pose pose_of(const ColmapImage& image) {
  Pose pose;
  pose.orientation = glm::conjugate(image.q);
  pose.position = -(pose.rotation() * image.t);
  return pose;
}

// "a.png", but not "20.23.45": a letter comes first.
bool has_image_ending(const std::string& name) {
  const std::string ending = fs::path(name).extension().string();
  return ending.size() > 1 && std::isalpha(static_cast<unsigned char>(ending[1]));
}

std::string path_in(const std::string& directory, const char* file) { return (fs::path(directory) / file).string(); }

}  // namespace

RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options) {
  const std::string cameras_path = path_in(directory, "cameras.txt"), images_path = path_in(directory, "images.txt");
  const auto cameras = read_colmap_cameras(cameras_path);
  std::vector<ColmapImage> images = read_colmap_images(images_path, cameras);
  if (images.empty()) throw Error(images_path + ": no images");
  if (images.size() > kMaxCameras) throw Error(images_path + ": at most " + std::to_string(kMaxCameras) + " images");

  RigImport result;
  Topology& topology = result.rig.topology;
  if (options.rows > 0 || options.columns > 0) {
    topology = {Topology::Type::kGrid, options.rows, options.columns, {}};
    if (static_cast<size_t>(options.rows) * options.columns != images.size())
      throw Error(images_path + ": " + std::to_string(images.size()) + " images do not make a grid of " +
                  size_text(options.rows, options.columns));
    std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  }

  std::string folder = options.images;
  std::error_code ignored;
  if (folder.empty() && fs::is_directory(path_in(directory, "images"), ignored)) folder = path_in(directory, "images");
  if (folder.empty()) {
    if (options.undistorted)
      throw Error(directory + ": undistorted images have sizes of their own: their folder must be given");
    result.notes.push_back("no folder of image files was given: their sizes were not checked");
  }
  const std::optional<ImageSearch> search = folder.empty() ? std::nullopt : std::optional<ImageSearch>(folder);

  std::map<std::string, std::string> name_of_file;
  std::string renamed;  // the first image whose file has another name
  size_t num_renamed = 0;
  for (const ColmapImage& image : images) {
    const ColmapCamera& from = cameras.at(image.camera_id);
    Camera camera;
    camera.id = image.id;
    camera.pose = pose_of(image);
    camera.name = image.name;
    if (has_image_ending(image.name)) {
      camera.name = fs::path(image.name).replace_extension().string();
      camera.image = image.name;
    }
    camera.width = from.width;
    camera.height = from.height;
    if (search) {
      camera.image = search->find(image.name);
      const auto [other, is_new] = name_of_file.emplace(camera.image, image.name);
      if (!is_new) throw Error(camera.image + ": stands for \"" + other->second + "\" and \"" + image.name + "\"");
      const std::string file = fs::path(camera.image).lexically_relative(folder).generic_string();
      if (file != image.name && num_renamed++ == 0) renamed = file + " for \"" + image.name + "\"";
      const ImageSize size = load_image_size(camera.image);
      camera.width = size.width;
      camera.height = size.height;
      if (!options.undistorted && (camera.width != from.width || camera.height != from.height))
        throw Error(camera.image + ": is " + size_text(camera.width, camera.height) + ", its camera " +
                    std::to_string(image.camera_id) + " in cameras.txt " + size_text(from.width, from.height) +
                    "; is it an undistorted image (lf-rig import colmap --undistorted)?");
      camera.image = fs::proximate(camera.image).string();
    }
    try {
      camera.lens = options.undistorted ? undistorted_lens(from, camera.width, camera.height) : lens_of(from);
    } catch (const Error& e) {
      throw Error(cameras_path + ": camera " + std::to_string(image.camera_id) + ": " + e.what());
    }
    result.rig.cameras.push_back(camera);
  }
  if (num_renamed > 0)
    result.notes.push_back(std::to_string(num_renamed) + " image files have other names than in images.txt: " +
                           renamed + (num_renamed > 1 ? ", ..." : ""));
  return result;
}

RigExport export_colmap(const Rig& rig, const std::string& directory) {
  std::map<uint32_t, ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::map<std::string, uint32_t> id_of_name;
  for (const Camera& camera : rig.cameras) {
    const auto fail = [&](const std::string& what) { refuse_camera(camera, what); };
    if (camera.id > kMaxColmapId) fail("COLMAP has no ids beyond " + std::to_string(kMaxColmapId));
    const std::string name = camera.image.empty() ? camera.name : camera.image;
    if (name.empty()) fail("COLMAP wants a name");
    if (name.find_first_of(" \t\r\n") != std::string::npos)
      fail("COLMAP reads the name \"" + name + "\" up to its first space only");
    const auto [same, is_new] = id_of_name.emplace(name, camera.id);
    if (!is_new) fail("the name \"" + name + "\" is also that of camera " + std::to_string(same->second));

    const Lens& lens = camera.lens;
    const size_t num_focal = lens_model_num_focal(lens.model());
    ColmapCamera to{std::string(lens_model_name(lens.model())),
                    camera.width,
                    camera.height,
                    {lens.params().begin(), lens.params().begin() + lens.num_params()},
                    num_focal};
    to.params[num_focal] += kColmapPixelCentre;
    to.params[num_focal + 1] += kColmapPixelCentre;
    cameras.emplace(camera.id, to);
    const Quat q = glm::conjugate(glm::normalize(camera.pose.orientation));
    images.push_back({camera.id, camera.id, q, -(glm::mat3_cast(q) * camera.pose.position), name});
  }

  std::error_code error;
  fs::create_directories(directory, error);
  if (error) throw Error(directory + ": can't be made: " + error.message());
  write_text_file(colmap_cameras_text(cameras), path_in(directory, "cameras.txt"));
  write_text_file(colmap_images_text(images), path_in(directory, "images.txt"));
  write_text_file("# 3D point list: empty\n", path_in(directory, "points3D.txt"));

  // What a reader will have, from the files themselves.
  const auto written_cameras = read_colmap_cameras(path_in(directory, "cameras.txt"));
  Rig written;
  for (const ColmapImage& image : read_colmap_images(path_in(directory, "images.txt"), written_cameras)) {
    Camera camera;
    camera.lens = lens_of(written_cameras.at(image.camera_id));
    camera.pose = pose_of(image);
    written.cameras.push_back(camera);
  }
  return describe_export(rig, written, {});
}

namespace {

namespace fs = std::filesystem;

// "11.jpg" does not end with the word "1.jpg", "cam 1.jpg" does.
bool ends_with_word(const std::string& text, const std::string& end) {
  if (end.size() >= text.size() || !text.ends_with(end)) return false;
  return !std::isalnum(static_cast<unsigned char>(text[text.size() - end.size() - 1]));
}

}  // namespace

ImageSearch::ImageSearch(const std::string& directory) : directory_(directory) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(directory, error), end; !error && it != end; it.increment(error))
    if (std::error_code ignored; it->is_regular_file(ignored)) files_.push_back(it->path().lexically_relative(directory).generic_string());
  if (error) throw Error(directory + ": can't be read: " + error.message());
  std::sort(files_.begin(), files_.end());
}

std::string ImageSearch::find(const std::string& name) const {
  const auto path = [&](const std::string& file) { return (fs::path(directory_) / file).string(); };
  const std::string wanted = fs::path(name).lexically_normal().generic_string();
  if (std::binary_search(files_.begin(), files_.end(), wanted)) return path(wanted);
  std::vector<std::string> found;
  for (const std::string& file : files_)
    if (ends_with_word(wanted, file) || ends_with_word(file, wanted)) found.push_back(file);
  if (found.empty()) throw Error(directory_ + ": no image file for \"" + name + "\"");
  if (found.size() > 1)
    throw Error(directory_ + ": more than one image file for \"" + name + "\": " + found[0] + ", " + found[1]);
  return path(found[0]);
}

}  // namespace lf
