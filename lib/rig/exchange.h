// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "rig/rig.h"

// Rigs from and to the files of other programs: Kalibr, NeRF, the Stanford archive, COLMAP, OpenCV.
namespace lf {

// The first document of a YAML text as the JSON value that says the same, so that a JsonValue can read it and name the
// place of what is wrong. Plain scalars that are numbers become numbers; tags are dropped. Aliases, keys that are not
// scalars and keys that are there twice are refused. `name` stands for the file in messages; throws Error with the
// line.
nlohmann::json parse_yaml(const std::string& text, const std::string& name);

// A number that every reader of YAML takes for one: "400.0", "1.0e-09" (to PyYAML "1e-09" is a text).
std::string yaml_number(double value);

// The result of reading a file. Keys that change the meaning of others (fisheye lenses, skew, rolling shutters) are
// read or refused with an Error, see check_foreign_keys().
struct RigImport {
  Rig rig;                         // directory "": image paths start at the current folder
  std::vector<std::string> notes;  // what was assumed, what was not read, and which topology was chosen
};

// `import` with the topology that suits its cameras, see fit_topology().
RigImport with_topology(RigImport import);

// What a writer has made of a rig.
struct RigExport {
  double max_error = 0;            // pixels: reprojection error of what was written against the rig
  std::vector<std::string> notes;  // sentences that tell a person what the format can't hold
};

// What a format can hold beside lenses and poses.
struct FormatCapacity {
  bool images = true, names = true, ids = true, time_offsets = false;
};

// `written` is what a reader has of `rig`; the error is at the rig's own extent and far away.
RigExport describe_export(const Rig& rig, const Rig& written, const FormatCapacity& capacity);
// Writes the file of a format of one text, without ids and with images beside it: as `text_of` makes it, and `parse`
// reads it back, with the path for errors.
RigExport export_text(const Rig& rig, const std::string& path, std::string (*text_of)(const Rig&),
                      RigImport (*parse)(const std::string& text, const std::string& path));

// Throws Error "Camera ID: what", for lenses and names that a format can't hold.
[[noreturn]] void refuse_camera(const Camera& camera, const std::string& what);

// How far apart two descriptions of the same cameras are, in pixels: the largest distance between where camera i of `b`
// and camera i of `a` see the same point, over 9 x 9 points of each image of `a`, at `distance` metres along the axis
// and far away. Infinity if the numbers of cameras differ or `b` does not see a point.
double max_reprojection_error(const Rig& a, const Rig& b, double distance);

// Kalibr's camchain.yaml (https://github.com/ethz-asl/kalibr/wiki/yaml-formats): cam0, cam1, ..., each with
//   camera_model: pinhole; intrinsics: [fx, fy, cx, cy]; distortion_model: radtan (k1 k2 p1 p2) or none;
//   distortion_coeffs; resolution: [width, height]; rostopic;
//   T_cn_cnm1 (from cam1 on): camera n from camera n - 1, metres; T_cam_imu (or its inverse, T_imu_cam): camera from
//   the body's frame; timeshift_cam_imu: the camera's time_offset, seconds.
// Pixels and axes as ours. All functions throw Error naming file and place.
// Other models (omni, eucm, ds; equidistant, fov) are refused. The world is the IMU's frame where the first camera has
// T_cam_imu, else the first camera's. Numbers may have gaps: the camera after a gap needs T_cam_imu. A camera's id is
// its number, its name the topic without a leading "/" and a trailing "/image_raw".
RigImport import_kalibr(const std::string& path);
// T_cam_imu carries the rig's world. Kalibr numbers cameras from 0 and has no place for images and sources.
RigExport export_kalibr(const Rig& rig, const std::string& path);

// NeRF's transforms.json as instant-ngp and nerfstudio read and write it. A camera is an element of "frames":
//   file_path, transform_matrix (4x4, world from camera; the camera's x right, y up, z back)
// with its lens there or, for all, at the top: camera_model (OPENCV, PINHOLE, SIMPLE_PINHOLE), fl_x, fl_y, cx, cy, w,
// h, k1, k2, p1, p2 (or nerfstudio's distortion_params); or camera_angle_x (radians) alone. Pixels have their centres
// at (0.5, 0.5). nerfstudio's applied_transform and applied_scale are undone, so that positions are in the units of the
// capture, which are taken as metres. instant-ngp's scale and offset do not change the file's poses.
// All functions throw Error naming file and place. Refused: other lens models and terms, and frames of different
// "time", because a rig is one instant. Without w and h the size is that of the image file, whose name may lack its
// ".png". A camera's name is the file's without folder and ending.
RigImport import_nerf(const std::string& path);
// Every frame has a lens of its own. Images are given relative to `path`.
RigExport export_nerf(const Rig& rig, const std::string& path);

// The Stanford light field archive (http://lightfield.stanford.edu): rectified images whose names say where they were
// taken, out_ROW_COLUMN_Y_X_.png, such as out_00_01_-381.909271_1038.347534_.png: y downwards, x to the right, in units
// that the archive leaves open. All cameras look the same way, and a point at the focus distance is at the same pixel
// in all images: the lens moves with the camera.

struct StanfordOptions {
  double f = 0;               // pixels; the names do not tell
  double focus_distance = 0;  // metres; 0: far away, where points stand still in unshifted images
  double unit = 1e-3;         // metres
};

// Imports all files in `directory` with such names, row by row; a grid where no place is empty. The axis of the middle
// of the array goes through the middle of the images. Throws Error naming the file or the option.
RigImport import_stanford(const std::string& directory, const StanfordOptions& options);

// Copies the images under such names into `directory`, which is made where it is missing. The rig must be a grid of
// cameras in one plane that look at right angles to it with one focal length and without distortion, their principal
// points shifted for one focus distance; up to a turn of the whole: otherwise Error says by how many pixels it differs.
// The notes have the options that bring it back.
RigExport export_stanford(const Rig& rig, const std::string& directory, double unit = StanfordOptions().unit);

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
  // A grid of the cameras in the natural order of their names (see natural_less()), refused where its cells do not lie
  // side by side in space; 0: see fit_topology(), cameras in the order of images.txt.
  int rows = 0, columns = 0;
};

// Makes one camera of each image: id = IMAGE_ID, name = NAME without its ending. An image file that is not there under
// its name is the one whose name ends NAME, or the other way round ("20.23.45.jpg" for "2021-05-19 20.23.45.jpg"),
// where there is exactly one. Models that our lenses can't express exactly are refused, unless `undistorted`.
RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options = {});

// Writes cameras.txt, images.txt and an empty points3D.txt (COLMAP wants one) into `directory`, which is made where it
// is missing. NAME is Camera::image, or the camera's name where it has none. Numbers round-trip to the last bit.
RigExport export_colmap(const Rig& rig, const std::string& directory);

// The text files of a COLMAP model (https://colmap.github.io/format.html), with the numbers as they stand there:
// COLMAP's conventions, not ours. See import_colmap() for a rig.

struct ColmapCamera {
  std::string model;           // any of COLMAP's
  int width = 0, height = 0;   // pixels, 1..kMaxImageSize
  std::vector<double> params;  // as many numbers as the model takes: `num_focal` focal lengths, cx, cy, distortion
  size_t num_focal = 1;
};

struct ColmapImage {
  uint32_t id = 0, camera_id = 0;
  Quat q{1, 0, 0, 0};  // camera_from_world, of unit norm
  Vec3 t{0, 0, 0};     // camera_from_world
  std::string name;    // name of the image file; may have spaces and folders
};

// Reads cameras.txt; cameras by CAMERA_ID. Throws Error naming file and line.
std::map<uint32_t, ColmapCamera> read_colmap_cameras(const std::string& path);
// Reads images.txt, in the order of the file; 2D points are checked for form and dropped. Throws Error naming file and
// line.
std::vector<ColmapImage> read_colmap_images(const std::string& path, const std::map<uint32_t, ColmapCamera>& cameras);

// Numbers are written so that they read back as the same numbers.
std::string colmap_cameras_text(const std::map<uint32_t, ColmapCamera>& cameras);
std::string colmap_images_text(const std::vector<ColmapImage>& images);

// The image files below a folder, to be found by the names that some other program knew them by.
class ImageSearch {
 public:
  // Throws Error if `directory` is not a folder.
  explicit ImageSearch(const std::string& directory);

  // The path of the file called `name` (which may have folders in it). Where there is none: of the one file whose name
  // ends `name`, or that `name` ends with, at a place where a word begins. Throws Error if there is no such file, or
  // more than one.
  std::string find(const std::string& name) const;
  size_t size() const { return files_.size(); }

 private:
  struct Ending {
    size_t files = 0;
    std::string first, second;  // in the order of files_
  };
  std::string directory_;
  std::vector<std::string> files_;                   // relative to directory_, sorted
  std::unordered_map<std::string, Ending> endings_;  // what a file's name ends with, from where a word begins
};

// OpenCV's FileStorage in YAML, with the key names of its calibration samples. One entry per camera:
//   cameras:
//      -
//         name: cam_00_00
//         image: cam_00_00.png                            # optional, from the folder of the file
//         image_width: 320
//         image_height: 240
//         camera_matrix: !!opencv-matrix                  # 3x3: fx 0 cx, 0 fy cy, 0 0 1
//         distortion_coefficients: !!opencv-matrix        # a row or a column of 4, 5, 8, 12 or 14: k1 k2 p1 p2 ...
//         R: !!opencv-matrix                              # 3x3, X_camera = R X_world + T, metres
//         T: !!opencv-matrix                              # 3x1
// Pixels as ours: (0, 0) is the centre of the top-left one. R and T default to none. Also read:
// - camera_matrix at the top, as OpenCV's calibration sample and ROS write it: one camera at the origin;
// - M1, D1, M2, D2, R, T, as OpenCV's stereo sample writes them: two cameras. R and T may be in extrinsics.yml beside
//   the file. The size must be there: image_width and image_height, or image_size: [width, height].
// All functions throw Error naming file and place. Terms beyond p2 must be 0.
RigImport import_opencv_yaml(const std::string& path);
RigExport export_opencv_yaml(const Rig& rig, const std::string& path);

// Lenses and poses in the terms that OpenCV, Kalibr and NeRF files share.

// fx, fy, cx, cy.
using FocalAndCentre = std::array<double, 4>;

// The lens with `distortion` k1, k2, p1, p2 (fewer: the rest is 0), under the shortest of our model names that holds
// it. (0, 0) is the centre of the top-left pixel. Throws Error.
Lens lens_of_opencv_terms(const FocalAndCentre& pinhole, const std::vector<double>& distortion);

// A rotation with what comes after it: x -> rotation x + translation.
struct RigidMotion {
  Mat3 rotation{1};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& x) const { return rotation * x + translation; }
  RigidMotion operator*(const RigidMotion& first) const;  // `first`, then this
  RigidMotion inverse() const;
};

RigidMotion camera_from_world(const Pose& pose);
Pose pose_of_camera_from_world(const RigidMotion& motion);
Pose pose_of_world_from_camera(const RigidMotion& motion);

// The rotation nearest to `matrix`. `value` fails if that is farther than the rounding of a file of 4 digits.
Mat3 nearest_rotation(const Mat3& matrix, const JsonValue& value);
// [[r, r, r, t], ...]: 3 rows, or 4 with 0 0 0 1.
RigidMotion parse_rigid_motion(const JsonValue& rows);
// The motion as text that is JSON and YAML at once, with a fourth row.
std::string rigid_motion_text(const RigidMotion& motion);

// Checks the keys of another program's file, in every object of it.
//
// Some keys change the meaning of others: they select a fisheye or a panoramic lens, skew, a rolling shutter or other
// axes. No importer reads these keys, so any value but a neutral one (false, 0, null, "", "none") throws Error with
// file, place, key and a remedy. The same holds for keys that name a lens model other than a pinhole with radial and
// tangential distortion.
//
// Returns a note that lists the keys that are neither in `known` nor dangerous, or nothing. `known` holds what the
// importer reads and what does not matter to a rig. `path` stands for the file in messages.
std::vector<std::string> check_foreign_keys(const nlohmann::json& root, const std::string& path,
                                            const std::set<std::string_view>& known);

// What to do about a lens that no rig can hold; ends messages.
extern const char kUndistortRemedy[];

}  // namespace lf
