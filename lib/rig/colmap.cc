// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"
#include "rig/colmap_model.h"
#include "rig/mesh.h"

namespace lf {

namespace fs = std::filesystem;

namespace {

constexpr size_t kLongestPath = 4096;

// Calls `use` with each proper suffix of `text` that starts a word. For example, "1.jpg" is such a suffix of "cam
// 1.jpg", but not of "11.jpg".
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
      Suffix& ending = suffixes_[text];
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
  if (const auto longer = suffixes_.find(wanted); longer != suffixes_.end())
    for (const std::string& file : {longer->second.first, longer->second.second})
      if (!file.empty()) found.insert(file);
  if (found.empty()) {
    const std::string similar = find_similar(wanted);
    throw Error(directory_ + ": no image file for \"" + name + "\"" +
                (similar.empty()
                     ? "; check that this folder has the images of the model"
                     : ", but there is " + similar + "; rename the files, or correct the names in a text model"));
  }
  if (found.size() > 1)
    throw Error(directory_ + ": more than one image file for \"" + name + "\": " + *found.begin() + ", " +
                *std::next(found.begin()));
  return path(*found.begin());
}

std::string ImageSearch::find_similar(const std::string& name) const {
  const auto stem = [](const std::string& file) {
    std::string text = fs::path(file).stem().string();
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
  };
  const auto similar = std::ranges::find(files_, stem(name), stem);
  return similar == files_.end() ? "" : *similar;
}

namespace {

constexpr double kColmapPixelCentre = 0.5;     // COLMAP's centre of the top-left pixel
constexpr uint32_t kMaxColmapId = 2147483646;  // COLMAP's database checks id < 2147483647

// Returns the lens of the model. Its parameters equal COLMAP's except for the position of pixel centres.
Lens lens_of(const ColmapCamera& camera) {
  const std::optional<LensModel> model = lens_model_from_name(camera.model);
  if (!model)
    throw Error("a rig cannot hold its " + camera.model +
                " lens; run colmap image_undistorter, and import the model in its folder sparse");
  std::array<double, Lens::kMaxParams> params{};
  std::copy_n(camera.params.begin(), lens_model_num_params(*model), params.begin());
  params[camera.num_focal] -= kColmapPixelCentre;
  params[camera.num_focal + 1] -= kColmapPixelCentre;
  return Lens(*model, params);
}

// Undistortion changes the size by a few percent. If both sides are much smaller, the file is a reduced copy.
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

// True for "a.png", but not for "20.23.45": the extension must start with a letter.
bool has_image_ending(const std::string& name) {
  const std::string ending = fs::path(name).extension().string();
  return ending.size() > 1 && std::isalpha(static_cast<unsigned char>(ending[1]));
}

std::string path_in(const std::string& directory, const char* file) { return (fs::path(directory) / file).string(); }

// Returns the image folder of a COLMAP workspace (images beside sparse/0), or "" if there is none.
std::string workspace_images(const std::string& directory) {
  std::error_code ignored;
  for (const char* place : {"..", "../.."}) {
    const fs::path folder = (fs::path(directory) / place / "images").lexically_normal();
    if (fs::is_directory(folder, ignored)) return folder.string();
  }
  return "";
}

std::string size_advice(const ImageSize& size, const ColmapCamera& from) {
  if (is_scaled_copy(size, from))
    return ". A scaled copy has another focal length, so use the pictures that COLMAP has processed, or the model that "
           "image_undistorter writes beside its pictures";
  if (size == ImageSize{from.height, from.width})
    return ". The sides are swapped, so a program has rotated the image file or applied its EXIF orientation; use the "
           "files that COLMAP has processed, or rotate their pixels back";
  return "; if it is an undistorted image, use lf-rig import colmap --undistorted";
}

// Returns the folder of the image files, or "" with a note.
std::string image_folder(const std::string& directory, const ColmapImportOptions& options,
                         std::vector<std::string>& notes) {
  if (!options.images.empty()) return options.images;
  std::error_code ignored;
  if (const std::string own = path_in(directory, "images"); fs::is_directory(own, ignored)) return own;
  if (options.undistorted)
    throw Error(directory +
                ": undistorted images have other sizes than the model states, so give their folder (--images)");
  const std::string beside = workspace_images(directory);
  notes.push_back("no folder of image files was given, so the image files were not found or checked; " +
                  (beside.empty() ? "give it with --images" : "add --images " + beside));
  return "";
}

// The image files of the cameras so far.
struct ImageNames {
  std::map<std::string, std::string> name_of_file;  // names in the model, by path
  std::string renamed;                              // the first file with another name than in the model
  size_t num_renamed = 0;
};

// Finds the file of an image and sets the path and the size of the camera.
void take_file(const ImageSearch& search, const std::string& folder, const ColmapImage& image, const ColmapCamera& from,
               bool undistorted, ImageNames& used, Camera& camera) {
  camera.image = search.find(image.name);
  const auto [other, is_new] = used.name_of_file.emplace(camera.image, image.name);
  if (!is_new)
    throw Error(camera.image + ": is the only file for two images, \"" + other->second + "\" and \"" + image.name +
                "\"; give each a file");
  const std::string file = fs::path(camera.image).lexically_relative(folder).generic_string();
  if (file != image.name && used.num_renamed++ == 0) used.renamed = file + " for \"" + image.name + "\"";
  const ImageSize size = load_image_size(camera.image);
  camera.width = size.width;
  camera.height = size.height;
  if (is_scaled_copy(size, from) || (!undistorted && size != ImageSize{from.width, from.height}))
    throw Error(camera.image + ": is " + size_text(size.width, size.height) + ", but the model gives its camera " +
                std::to_string(image.camera_id) + " the size " + size_text(from.width, from.height) +
                size_advice(size, from));
  camera.image = fs::proximate(camera.image).string();
}

// Throws Error if most cells of a grid are not side by side, otherwise adds a note for the few exceptions.
void check_grid(const Rig& rig, const std::string& path, std::vector<std::string>& notes) {
  constexpr size_t kMaxFolded = 10;  // inverse of the tolerated share
  const std::optional<GridFault> fault = find_grid_fault(rig);
  if (!fault) return;
  const std::string text = path + ": in the order of their names, " + fault->text;
  if (fault->folded * kMaxFolded > fault->triangles)
    throw Error(text + "; rename the files so that the names are in order row by row, or correct or omit --grid");
  notes.push_back(text);
}

// Returns an entry of the frames or rigs of a model. `place` is the folder and the kind of the entry.
template <class Entry>
const Entry& entry_of(const std::map<uint32_t, Entry>& entries, uint32_t id, const std::string& place) {
  const auto entry = entries.find(id);
  if (entry != entries.end()) return entry->second;
  throw Error(place + " " + std::to_string(id) + " does not exist" +
              (entries.empty() ? ", because the model has none"
                               : "; the ids are from " + std::to_string(entries.begin()->first) + " to " +
                                     std::to_string(entries.rbegin()->first)));
}

// Removes all images that are not in the frame `id`.
void select_frame(const std::string& directory, uint32_t id, ColmapModel& model) {
  const std::map<uint32_t, std::set<uint32_t>> frames = read_colmap_frames(directory, model);
  const std::string place = directory + ": frame";
  const std::set<uint32_t>& frame = entry_of(frames, id, place);
  std::erase_if(model.images, [&](const ColmapImage& image) { return !frame.contains(image.id); });
  if (model.images.empty()) throw Error(place + " " + std::to_string(id) + " has no image with a pose");
}

// Replaces the images by an image for each camera of the rig `id`.
void select_rig(const std::string& directory, uint32_t id, ColmapModel& model, std::vector<std::string>& notes) {
  const std::map<uint32_t, ColmapRig> rigs = read_colmap_rigs(directory, model);
  const std::string place = directory + ": rig";
  std::vector<ColmapImage> images;
  std::string left_out;
  for (const auto& [camera, pose] : entry_of(rigs, id, place).cameras) {
    if (!model.cameras.contains(camera))
      throw Error(place + " " + std::to_string(id) + ": camera " + std::to_string(camera) + " is not in " +
                  model.cameras_path);
    if (!pose) {
      left_out += (left_out.empty() ? "" : ", ") + std::to_string(camera);
      continue;
    }
    const auto image = std::ranges::find(model.images, camera, &ColmapImage::camera_id);
    images.push_back({camera, camera, pose->first, pose->second,
                      image == model.images.end() ? "" : fs::path(image->name).parent_path().generic_string()});
  }
  if (images.empty()) throw Error(place + " " + std::to_string(id) + " has no camera with a pose");
  if (!left_out.empty()) notes.push_back("cameras without a pose in the rig were left out: " + left_out);
  model.images = std::move(images);
}

}  // namespace

RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options) {
  ColmapModel model = read_colmap_model(directory);
  RigImport result;
  result.has_unit = false;
  if (options.rig) select_rig(directory, *options.rig, model, result.notes);
  if (options.frame) select_frame(directory, *options.frame, model);
  const std::string &cameras_path = model.cameras_path, &images_path = model.images_path;
  const std::map<uint32_t, ColmapCamera>& cameras = model.cameras;
  std::vector<ColmapImage>& images = model.images;
  if (images.empty()) throw Error(images_path + ": no images, but a rig needs at least one");
  if (images.size() > kMaxCameras)
    throw Error(images_path + ": contains too many images; a rig has at most " + std::to_string(kMaxCameras) +
                " cameras");

  if (std::error_code ignored; !model.is_binary && fs::exists(path_in(directory, "cameras.bin"), ignored))
    result.notes.push_back("cameras.txt and images.txt were read; the binary model in the same folder was not");
  Topology& topology = result.rig.topology;
  if (options.rows > 0 || options.columns > 0) {
    topology = {Topology::Type::kGrid, options.rows, options.columns, {}};
    if (static_cast<size_t>(options.rows) * options.columns != images.size())
      throw Error(images_path + ": " + std::to_string(images.size()) + " images do not make a grid of " +
                  size_text(options.rows, options.columns));
    std::ranges::sort(images, natural_less, &ColmapImage::name);
  }

  const std::string folder = options.rig ? "" : image_folder(directory, options, result.notes);
  const std::optional<ImageSearch> search = folder.empty() ? std::nullopt : std::optional<ImageSearch>(folder);
  ImageNames used;
  for (const ColmapImage& image : images) {
    const ColmapCamera& from = cameras.at(image.camera_id);
    Camera camera;
    camera.id = image.id;
    camera.pose = pose_of(image);
    camera.name = image.name;
    if (!options.rig && has_image_ending(image.name)) {
      camera.name = fs::path(image.name).replace_extension().string();
      camera.image = image.name;
    }
    camera.width = from.width;
    camera.height = from.height;
    if (search) take_file(*search, folder, image, from, options.undistorted, used, camera);
    try {
      camera.lens = options.undistorted ? undistorted_lens(from, camera.width, camera.height) : lens_of(from);
    } catch (const Error& e) {
      throw Error(cameras_path + ": camera " + std::to_string(image.camera_id) + ": " + e.what());
    }
    result.rig.cameras.push_back(camera);
  }
  if (used.num_renamed > 0)
    result.notes.push_back(std::to_string(used.num_renamed) + " image files have other names than in the model: " +
                           used.renamed + (used.num_renamed > 1 ? ", ..." : ""));
  if (search && search->size() > images.size())
    result.notes.push_back(std::to_string(search->size() - images.size()) + " of " + std::to_string(search->size()) +
                           " files in " + folder + " are not in the model and were left out");
  if (topology.type != Topology::Type::kGrid) return with_topology(std::move(result));
  check_grid(result.rig, images_path, result.notes);
  return result;
}

namespace {

// Throws Error if the folder has files that COLMAP or the importer would read instead of the exported model or beside
// it.
void require_no_other_model(const std::string& directory, const ColmapExportOptions& options) {
  const char *const binary[] = {"cameras.bin", "rigs.bin", "frames.bin"}, *const text[] = {"cameras.txt", "rigs.txt",
                                                                                           "frames.txt"};
  for (size_t i = 0; i < std::size(text); i++)
    for (const bool is_binary : {false, true}) {
      const char* const file = is_binary ? binary[i] : text[i];
      if (is_binary == options.binary && (i == 0 || options.rig)) continue;  // will be replaced
      if (std::error_code ignored; fs::exists(path_in(directory, file), ignored))
        throw Error(path_in(directory, file) +
                    ": is not part of the exported model, but COLMAP may read it; remove "
                    "the file, or give another folder");
    }
}

}  // namespace

RigExport export_colmap(const Rig& rig, const std::string& directory, const ColmapExportOptions& options) {
  std::map<uint32_t, ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::map<std::string, uint32_t> id_of_name;
  for (const Camera& camera : rig.cameras) {
    const auto fail = [&](const std::string& what) { throw_camera_error(camera, what); };
    if (camera.id > kMaxColmapId) fail("COLMAP does not accept ids above " + std::to_string(kMaxColmapId));
    const std::string name = camera.image.empty() ? camera.name : camera.image;
    if (name.empty()) fail("the camera has no name, but COLMAP requires one; add a name to the rig file");
    if (!options.binary && name.find_first_of(" \t\r\n") != std::string::npos)
      fail("COLMAP reads the name \"" + name + "\" up to its first space only; use a name without spaces, or --binary");
    const auto [same, is_new] = id_of_name.emplace(name, camera.id);
    if (!is_new) fail("the name \"" + name + "\" is also used by camera " + std::to_string(same->second));

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

  require_no_other_model(directory, options);
  make_folder(directory);
  const auto write = [&](const char* name, const std::string& contents) {
    write_text_file(contents, path_in(directory, name) + (options.binary ? ".bin" : ".txt"));
  };
  write("cameras", colmap_cameras_file(cameras, options.binary));
  write("images", colmap_images_file(images, options.binary));
  write("points3D", colmap_points_file(options.binary));
  if (options.rig) {
    write("rigs", colmap_rigs_file(*options.rig, images, options.binary));
    write("frames", colmap_frames_file(*options.rig, images, options.binary));
  }

  const ColmapModel model = read_colmap_model(directory);
  Rig written;
  for (const Camera& from : rig.cameras) {
    const ColmapImage& image = *std::ranges::find(model.images, from.id, &ColmapImage::id);  // binary: in another order
    Camera camera;
    camera.lens = lens_of(model.cameras.at(image.camera_id));
    camera.pose = pose_of(image);
    written.cameras.push_back(camera);
  }
  return describe_export(rig, written, {});
}

}  // namespace lf
