// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf {

// A file or a folder of another program, with its format.
struct ImportFormat {
  std::string name;    // the command of lf-rig import, such as "colmap"
  std::string path;    // the file or folder that the importer of this format reads
  std::string images;  // colmap only: the folder "images" beside the model or in the given folder; "" if missing
  std::string sign;    // the file that shows the format, such as "scene/sparse/0/images.bin"
};

// Finds the format of a file or folder. The formats and their signs are:
//   caliscope  camera_array.toml
//   colmap     cameras.txt or cameras.bin in the folder, otherwise in its subfolder sparse/0, otherwise in sparse
//   deepview   JSON with the keys "projection_type" and "radial_distortion"
//   hci        parameters.cfg with [intrinsics], and input_Cam000.png in the same folder
//   kalibr     YAML with camchain in its name, or with the keys cam0 and camera_model
//   llff       poses_bounds.npy
//   miv        JSON with the keys "cameras", and "Projection" or "Focal"
//   mrcal      *.cameramodel
//   nerf       transforms.json, otherwise transforms_train.json
//   opencv     YAML with the key camera_matrix, the keys M1 and D1, or the keys Ks and distortions
//   stanford   pictures with names of the form out_ROW_COLUMN_Y_X_.png
//   technicolor cameras_parameters.txt
// In a folder, YAML files end in .yaml or .yml, and JSON files in .json. If `path` is a file, any name can be JSON or
// YAML, and JSON with "transform_matrix" or "camera_angle_x" is nerf. Keys are searched in the first MiB of a file. The
// importer checks the rest of the content.
//
// Throws Error if `path` cannot be read, has no known format or has several formats, if a folder has several files of a
// format with one file, and for a rig file of this project.
ImportFormat find_import_format(const std::string& path);

// Returns the command that imports `format`, without --out: "lf-rig import colmap scene/sparse/0 --images
// scene/images".
std::string import_command(const ImportFormat& format);

}  // namespace lf
