// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rig/exchange.h"

namespace lf {

// COLMAP's text models (https://colmap.github.io/format.html): cameras.txt and images.txt; points3D.txt is not needed.
// COLMAP puts the centre of the top-left pixel at (0.5, 0.5) and stores camera_from_world; lens models are its own.
// All functions throw Error naming file and line, or the camera.

struct ColmapImportOptions {
  // Folder of the image files. "": `images` in the model's folder if there is one; else files are not looked at and
  // Camera::image is NAME (nothing if that has no ending like an image's).
  std::string images;
  // The image files are the undistorted ones (COLMAP's image_undistorter): PINHOLE with the focal length of cameras.txt
  // and the size of each file; the principal point moves with the size, so that the middle stays the middle.
  // Otherwise a file of another size than its camera is an error.
  bool undistorted = false;
  // A grid of the cameras in the order of their names; 0: Delaunay, cameras in the order of images.txt.
  int rows = 0, columns = 0;
};

// One camera per image: id = IMAGE_ID, name = NAME without its ending. An image file that is not there under its name
// is the one whose name ends NAME, or the other way round ("20.23.45.jpg" for "2021-05-19 20.23.45.jpg"), where there
// is exactly one. Models that our lenses can't express exactly are refused, unless `undistorted`.
RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options = {});

// Writes cameras.txt, images.txt and an empty points3D.txt (COLMAP wants one) into `directory`, which is made where it
// is missing. NAME is Camera::image, or the camera's name where it has none. Numbers round-trip to the last bit.
RigExport export_colmap(const Rig& rig, const std::string& directory);

// The image files below a folder, to be found by the names that some other program knew them by.
class ImageSearch {
 public:
  // Throws Error if `directory` is not a folder.
  explicit ImageSearch(const std::string& directory);

  // The path of the file called `name` (which may have folders in it). Where there is none: of the one file whose name
  // ends `name`, or that `name` ends with, at a place where a word begins. Throws Error if there is no such file, or
  // more than one.
  std::string find(const std::string& name) const;

 private:
  std::string directory_;
  std::vector<std::string> files_;  // relative to directory_, sorted
};

}  // namespace lf
