// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "geometry/pose.h"

// The cameras and images of a COLMAP model, with unconverted numbers in COLMAP's conventions. import_colmap() converts
// a model to a rig. A model is a folder with cameras.txt and images.txt, or with cameras.bin and images.bin
// (https://colmap.github.io/format.html). Its 3D points are not needed.
namespace lf {

struct ColmapCamera {
  std::string model;
  int width = 0, height = 0;   // pixels, 1..kMaxImageSize
  std::vector<double> params;  // `num_focal` focal lengths, cx, cy, distortion
  size_t num_focal = 1;
};

struct ColmapImage {
  uint32_t id = 0, camera_id = 0;
  Quat q{1, 0, 0, 0};  // camera_from_world, unit norm
  Vec3 t{0, 0, 0};     // camera_from_world
  std::string name;    // name of the image file, UTF-8; may have spaces and folders
};

struct ColmapModel {
  std::string cameras_path, images_path;
  std::map<uint32_t, ColmapCamera> cameras;  // by CAMERA_ID
  std::vector<ColmapImage> images;           // in the order of a text file, or by IMAGE_ID; their cameras exist
  bool is_binary = false;
};

// Reads the model in a folder. If the folder has a text model and a binary model, the text model is read, because
// people edit text files. Throws Error with a remedy if the folder has no model.
ColmapModel read_colmap_model(const std::string& directory);

// Reads frames.txt or frames.bin of a model in the same form as `model`, which COLMAP writes since version 3.12.
// Returns the ids of the images of each frame, by FRAME_ID. A frame has the images of a rig of cameras at one instant.
// Throws Error with the file and the line or byte, also if there is no such file.
std::map<uint32_t, std::set<uint32_t>> read_colmap_frames(const std::string& directory, const ColmapModel& model);

// A rig of sensors with fixed relative poses, such as cameras on a board.
struct ColmapRig {
  // Pose sensor_from_rig of each camera by CAMERA_ID; identity for the reference camera, which defines the coordinates,
  // and nullopt if COLMAP has not estimated the pose. Other sensors than cameras are omitted.
  std::map<uint32_t, std::optional<std::pair<Quat, Vec3>>> cameras;
};

// Reads rigs.txt or rigs.bin in the same way. Returns the rigs by RIG_ID.
std::map<uint32_t, ColmapRig> read_colmap_rigs(const std::string& directory, const ColmapModel& model);

// The four files. The 2D points of images are checked for syntax and dropped. The work and the memory are proportional
// to the size of a file. Throws Error with the file and the line or byte.
std::map<uint32_t, ColmapCamera> read_colmap_cameras_text(const std::string& path);
std::vector<ColmapImage> read_colmap_images_text(const std::string& path,
                                                 const std::map<uint32_t, ColmapCamera>& cameras);
std::map<uint32_t, ColmapCamera> read_colmap_cameras_binary(const std::string& path);
std::vector<ColmapImage> read_colmap_images_binary(const std::string& path,
                                                   const std::map<uint32_t, ColmapCamera>& cameras);

// The contents of the files of a model, as text or binary. Numbers keep their full precision. Images have no 2D points.
std::string colmap_cameras_file(const std::map<uint32_t, ColmapCamera>& cameras, bool binary);
std::string colmap_images_file(const std::vector<ColmapImage>& images, bool binary);
std::string colmap_points_file(bool binary);  // without points

// The contents of the files of a rig with the cameras of all images, which must differ, and of its frame 1 with all
// images. The camera of the first image is the reference camera of the rig.
std::string colmap_rigs_file(uint32_t rig_id, const std::vector<ColmapImage>& images, bool binary);
std::string colmap_frames_file(uint32_t rig_id, const std::vector<ColmapImage>& images, bool binary);

}  // namespace lf
