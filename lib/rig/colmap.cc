// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>

#include "base/error.h"
#include "base/json_value.h"
#include "base/natural_order.h"
#include "base/number_text.h"
#include "image/image_file.h"
#include "rig/colmap_text.h"
#include "rig/mesh_fit.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr double kColmapPixelCentre = 0.5;     // where COLMAP has the centre of the top-left pixel
constexpr uint32_t kMaxColmapId = 2147483646;  // COLMAP's database checks id < 2147483647

// The lens as it is in the model: its parameters are COLMAP's but for where pixels have their centre.
Lens lens_of(const ColmapCamera& camera) {
  std::optional<LensModel> model = lens_model_from_name(camera.model);
  if (!model && camera.model == "FULL_OPENCV" &&
      std::all_of(camera.params.begin() + 8, camera.params.end(), [](double k) { return k == 0; }))
    model = LensModel::kOpenCv;
  if (!model)
    throw Error(
        "a rig cannot hold its " + camera.model +
        " lens; run colmap image_undistorter, and import the model that it writes (its sparse folder, as text)");
  std::array<double, Lens::kMaxParams> params{};
  std::copy_n(camera.params.begin(), lens_model_num_params(*model), params.begin());
  params[camera.num_focal] -= kColmapPixelCentre;
  params[camera.num_focal + 1] -= kColmapPixelCentre;
  return Lens(*model, params);
}

// Undistorting changes sides by some percent. Both sides much smaller: a copy for viewing, or for quicker training.
bool is_scaled_copy(const ImageSize& size, const ColmapCamera& camera) {
  constexpr double kMost = 0.7;
  return size.width < kMost * camera.width && size.height < kMost * camera.height;
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

// A folder that is no text model: says how to make one.
void require_text_model(const std::string& directory) {
  std::error_code ignored;
  if (fs::exists(path_in(directory, "cameras.txt"), ignored)) return;
  if (fs::exists(path_in(directory, "cameras.bin"), ignored))
    throw Error(directory + ": is a binary model; run colmap model_converter --input_path " + directory +
                " --output_path TEXT --output_type TXT, and import TEXT");
  for (const char* model : {"sparse/0", "sparse", "0"})
    if (fs::exists(path_in(directory, model) + "/cameras.txt", ignored))
      throw Error(directory + ": cameras.txt can't be read, the model is in " + path_in(directory, model));
  throw Error(path_in(directory, "cameras.txt") +
              ": can't be read. A folder of pictures alone has no positions: run COLMAP on it, and import the text "
              "model that colmap model_converter --output_type TXT writes");
}

// Throws Error where most cells of a grid do not lie side by side, else returns a note for the few that do not.
void check_grid(const Rig& rig, const std::string& path, std::vector<std::string>& notes) {
  constexpr size_t kMostFolded = 10;  // one in so many
  const std::optional<GridFault> fault = find_grid_fault(rig);
  if (!fault) return;
  const std::string text = path + ": by the order of their names " + fault->text;
  if (fault->folded * kMostFolded > fault->triangles)
    throw Error(text + "; name the files row by row, give the right --grid, or leave it out");
  notes.push_back(text);
}

}  // namespace

RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options) {
  const std::string cameras_path = path_in(directory, "cameras.txt"), images_path = path_in(directory, "images.txt");
  require_text_model(directory);
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
    std::ranges::sort(images, natural_less, &ColmapImage::name);
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
      const bool is_copy = is_scaled_copy(size, from);
      if (is_copy || (!options.undistorted && (camera.width != from.width || camera.height != from.height)))
        throw Error(camera.image + ": is " + size_text(camera.width, camera.height) + ", its camera " +
                    std::to_string(image.camera_id) + " in cameras.txt " + size_text(from.width, from.height) +
                    (is_copy ? "; a scaled copy has another focal length: use the pictures that COLMAP saw, or the "
                               "model that image_undistorter writes beside its pictures"
                             : "; is it an undistorted image (lf-rig import colmap --undistorted)?"));
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
  if (search && search->size() > images.size())
    result.notes.push_back(std::to_string(search->size() - images.size()) + " of " + std::to_string(search->size()) +
                           " files in " + folder + " are not in images.txt and were left out");
  if (topology.type != Topology::Type::kGrid) return with_topology(std::move(result));
  check_grid(result.rig, images_path, result.notes);
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

constexpr size_t kLongestPath = 4096;  // as Linux has it

// Calls `use` with each proper ending of `text` that begins with a word: "1.jpg" of "cam 1.jpg", not of "11.jpg".
template <typename Use>
void for_each_ending(const std::string& text, Use use) {
  for (size_t i = 1; i < text.size(); i++)
    if (!std::isalnum(static_cast<unsigned char>(text[i - 1]))) use(text.substr(i));
}

}  // namespace

ImageSearch::ImageSearch(const std::string& directory) : directory_(directory) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(directory, error), end; !error && it != end; it.increment(error))
    if (std::error_code ignored; it->is_regular_file(ignored))
      files_.push_back(it->path().lexically_relative(directory).generic_string());
  if (error) throw Error(directory + ": can't be read: " + error.message());
  std::sort(files_.begin(), files_.end());
  for (const std::string& file : files_)
    for_each_ending(file, [&](const std::string& text) {
      Ending& ending = endings_[text];
      if (ending.files++ < 2) (ending.files == 1 ? ending.first : ending.second) = file;
    });
}

std::string ImageSearch::find(const std::string& name) const {
  const auto path = [&](const std::string& file) { return (fs::path(directory_) / file).string(); };
  const std::string wanted = fs::path(name).lexically_normal().generic_string();
  const auto exists = [&](const std::string& file) { return std::binary_search(files_.begin(), files_.end(), file); };
  if (exists(wanted)) return path(wanted);
  std::set<std::string> found;
  if (wanted.size() > kLongestPath) throw Error(directory_ + ": no image file for \"" + name.substr(0, 80) + "...\"");
  for_each_ending(wanted, [&](const std::string& file) {
    if (exists(file)) found.insert(file);
  });
  if (const auto longer = endings_.find(wanted); longer != endings_.end())
    for (const std::string& file : {longer->second.first, longer->second.second})
      if (!file.empty()) found.insert(file);
  if (found.empty()) throw Error(directory_ + ": no image file for \"" + name + "\"");
  if (found.size() > 1)
    throw Error(directory_ + ": more than one image file for \"" + name + "\": " + *found.begin() + ", " +
                *std::next(found.begin()));
  return path(*found.begin());
}

}  // namespace lf
