// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "rig/rig.h"

// Imports and exports rigs in the formats of other programs: Kalibr, NeRF, the Stanford archive, COLMAP, LLFF, the 4D
// Light Field Benchmark, mrcal, Caliscope, MPEG Immersive Video, OpenCV, Technicolor, DeepView Video.
namespace lf {

// Converts the first document of a YAML text to JSON, so that JsonValue can read it and report places. Plain scalars
// that are numeric become numbers, and tags are dropped. Throws Error with the line for aliases, non-scalar keys and
// duplicate keys. `name` is the file name in messages, and `language` names the syntax if it is a subset of YAML.
nlohmann::json parse_yaml(const std::string& text, const std::string& name, const char* language = "YAML");

// Returns a number as text that every YAML reader parses as a number, for example "400.0" or "1.0e-09". (PyYAML reads
// "1e-09" as a string.)
std::string yaml_number(double value);

// The result of an import. Keys that change the meaning of other keys (fisheye lenses, skew, rolling shutters) are
// either supported or cause an Error; see check_foreign_keys().
struct RigImport {
  Rig rig;                         // directory is "", so image paths start from the current folder
  std::vector<std::string> notes;  // assumptions, ignored content, and the chosen topology
  // False if the file does not tell its unit of length, such as after a structure from motion. The importer then takes
  // one unit as a metre; scale_lengths() corrects this.
  bool has_unit = true;
  // Distances of the nearest and the farthest point of the scene, in the unit of the rig. `near` is 0 if the file does
  // not tell, and `far` is infinite if only the nearest point is known.
  double near = 0, far = HUGE_VAL;
};

// Multiplies all lengths of an import by `scale`, the length of one unit of the file in metres. Throws Error if a
// length becomes infinite.
void scale_lengths(RigImport& import, double scale);
// Returns a note with the depths of the scene, or "" if they are unknown.
std::string depth_note(const RigImport& import);

// Returns `import` with a topology that suits its cameras; see fit_topology().
RigImport with_topology(RigImport import);
// Appends a camera. Its id is its index.
void add_camera(Camera camera, RigImport& import);

struct RigExport {
  double max_error = 0;            // largest reprojection error of the written cameras against the rig, pixels
  std::vector<std::string> notes;  // sentences about content that the format cannot hold
};

// Returns a note with the keys of a rig file that no other format can hold, such as colours and covariances, or "".
// `rig_file` is the parsed file of a valid rig.
std::string lost_keys_note(const nlohmann::json& rig_file);

struct FormatSupport {
  bool images = true, names = true, ids = true, time_offsets = false, topology = false;
};

// Measures how much an export has changed a rig. `written` is the rig as read back from the exported file. The
// reprojection error is measured at infinity and at a distance equal to the size of the array.
RigExport describe_export(const Rig& rig, const Rig& written, const FormatSupport& capacity);
// Does the same for a format that can hold some grids only. `grids` says which, as in "a flat grid". Throws Error if
// the largest error exceeds `most`.
RigExport describe_grid_export(const Rig& rig, const Rig& written, double most, const std::string& grids);
// Exports to a text format of one file that has no ids and no images. `text_of` returns the text, and `parse` reads it
// back; its `path` is only for messages.
RigExport export_text(const Rig& rig, const std::string& path, std::string (*text_of)(const Rig&),
                      RigImport (*parse)(const std::string& text, const std::string& path));

// Returns a different file name for each camera, in ascending order: the name of the camera and its ending. If this is
// impossible, for example because cameras have no names, the file names have numbers.
std::vector<std::string> file_names_of(const Rig& rig, std::string (*ending_of)(const Camera&),
                                       bool (*less)(std::string_view, std::string_view));
// Copies a picture of a camera. Throws Error if the rig has no picture, or if `to` cannot be written.
void copy_picture(const Rig& rig, const Camera& camera, const std::string& to);

// Throws an Error with the text "camera ID: what", for example for a lens or a name that a format cannot hold.
[[noreturn]] void throw_camera_error(const Camera& camera, const std::string& what);

// Returns the largest difference in pixels between two descriptions of the same cameras. Projects 9 x 9 points of each
// image of `a`, at `distance` metres along the axis and at infinity, into `b`. Returns infinity if the numbers of
// cameras differ or a camera of `b` does not see a point.
double max_reprojection_error(const Rig& a, const Rig& b, double distance);

// Kalibr's camchain.yaml (https://github.com/ethz-asl/kalibr/wiki/yaml-formats): cam0, cam1, ..., each with
//   camera_model: pinhole; intrinsics: [fx, fy, cx, cy];
//   distortion_model: radtan (k1 k2 p1 p2), equidistant (k1 k2 k3 k4) or none;
//   distortion_coeffs; resolution: [width, height]; rostopic;
//   T_cn_cnm1 (from cam1 on): camera n from camera n - 1, metres; T_cam_imu (or its inverse, T_imu_cam): camera from
//   the body's frame; timeshift_cam_imu: the camera's time_offset, seconds.
// Pixel coordinates and axes are the same as in a rig. Other lens models (omni, eucm, ds; fov) are rejected. The world
// is the IMU frame if the first camera has T_cam_imu, otherwise the first camera's frame. Camera numbers may have gaps;
// the camera after a gap needs T_cam_imu. The id is the camera number, and the name is the topic without a leading "/"
// and a trailing "/image_raw". All functions throw Error with file and place.
RigImport import_kalibr(const std::string& path);
// T_cam_imu holds the rig's world. Kalibr numbers cameras from 0 and cannot hold images and sources.
RigExport export_kalibr(const Rig& rig, const std::string& path);

// NeRF's transforms.json as read and written by instant-ngp and nerfstudio. A camera is an element of "frames":
//   file_path, transform_matrix (4x4, world from camera; the camera's x right, y up, z back)
// The lens is in the frame, or at the top level for all frames: camera_model (OPENCV, OPENCV_FISHEYE, PINHOLE,
// SIMPLE_PINHOLE) or is_fisheye, fl_x, fl_y, cx, cy, w, h, k1, k2, p1, p2, k3, k4 (or nerfstudio's distortion_params:
// k1 k2 k3 k4 p1 p2); or only camera_angle_x (radians). k4 and p1, p2 must be 0 where the lens has no such term. Pixel
// centres are at (0.5, 0.5). nerfstudio's applied_transform and applied_scale are undone, which restores the units of
// the capture; these are taken as metres. instant-ngp's scale and offset do not affect the poses in the file. Rejects
// other lens models and terms, and frames with different "time", because a rig is a single instant. If w and h are
// missing, the size comes from the image file. A file_path may lack its ".png". The camera name is the file name
// without folder and extension. All functions throw Error with file and place.
RigImport import_nerf(const std::string& path);
RigExport export_nerf(const Rig& rig, const std::string& path);

// The Stanford light field archive (http://lightfield.stanford.edu): rectified images with the camera position in the
// file name, out_ROW_COLUMN_Y_X_.png, such as out_00_01_-381.909271_1038.347534_.png. y points down and x to the right;
// the unit is unspecified. All cameras have the same orientation. A point at the focus distance is at the same pixel in
// all images, because the lens moves with the camera.

struct StanfordOptions {
  double f = 0;               // pixels; must be positive
  double focus_distance = 0;  // metres; 0: infinity, for unshifted images
  double unit = 1e-3;         // metres
};

// Returns the focal length that the file names contain, in pixels, or 0. linusmossberg's light-field-renderer
// (blender-exporter.py) renders unshifted images with the names NAME_ROW_COLUMN_Y_X_LENS_SENSOR.jpg, such as
// camera_00_01_400.000000_369.230769_30_36.jpg, in millimetres. SENSOR is the width of the image. Throws Error with the
// file if names contain different lenses.
double stanford_focal_length(const std::string& directory);

// Imports all matching files in `directory`, row by row. The result is a grid if no position is empty. The optical axis
// in the middle of the array passes through the middle of the images. Throws Error with the file or the option.
RigImport import_stanford(const std::string& directory, const StanfordOptions& options);

// Copies the images into `directory`, which is created if missing, under the archive's file names. The rig must be a
// grid of cameras in one plane, which look perpendicular to the plane and have one focal length and no distortion.
// Their principal points must be shifted for one focus distance. The whole rig may be rotated. Otherwise throws Error
// with the difference in pixels. The notes contain the import options that restore the rig.
RigExport export_stanford(const Rig& rig, const std::string& directory, double unit = StanfordOptions().unit);

// COLMAP's models, as text or binary (see rig/colmap_model.h). COLMAP puts the centre of the top-left pixel at
// (0.5, 0.5), stores camera_from_world, and has its own lens models. All functions throw Error with the file, and with
// the line, byte or camera.

struct ColmapImportOptions {
  // Folder of the image files. If "", the model's folder `images` is used if it exists; otherwise, no files are read,
  // and Camera::image is NAME if NAME has an image extension.
  std::string images;
  // True if the image files are undistorted (COLMAP's image_undistorter). The lens is then PINHOLE with the focal
  // length of the model and the size of the file; the principal point keeps its offset from the image centre. If
  // false, it is an error if a file and its camera differ in size.
  bool undistorted = false;
  // Size of a grid that the cameras form in natural order of their names (see natural_less()). Error is thrown if the
  // cells are not side by side in space. 0 keeps the order of the model, with a topology by fit_topology().
  int rows = 0, columns = 0;
  // FRAME_ID of the only frame to import. A frame has the images of a rig of cameras at one instant.
  std::optional<uint32_t> frame;
  // RIG_ID of a rig of cameras. Imports the cameras of this rig instead of the images, in the coordinates of its
  // reference sensor: id = CAMERA_ID, name = the folder of the images of the camera. There are no image files.
  std::optional<uint32_t> rig;
};

// Makes a camera for each image: id = IMAGE_ID, name = NAME without its extension. If no image file has exactly this
// name, the only file with a matching suffix is used, in either direction ("20.23.45.jpg" for "2021-05-19
// 20.23.45.jpg"). Lens models without an exact equivalent are rejected, unless `undistorted`.
RigImport import_colmap(const std::string& directory, const ColmapImportOptions& options = {});

struct ColmapExportOptions {
  bool binary = false;  // false: text
  // RIG_ID of a rig with all cameras, which is written together with its only frame, 1 (COLMAP 3.12). The first camera
  // is the reference camera.
  std::optional<uint32_t> rig;
};

// Writes cameras.txt, images.txt and an empty points3D.txt (which COLMAP requires), or the same files in binary, into
// `directory`, which is created if missing. NAME is Camera::image, or the camera's name if there is no image. Numbers
// keep their full precision. Throws Error if the folder has files of another model that would be read instead.
RigExport export_colmap(const Rig& rig, const std::string& directory, const ColmapExportOptions& options = {});

// LLFF's poses_bounds.npy (https://github.com/Fyusion/LLFF), which most public forward-facing captures have. For each
// image, it has a 3x5 matrix, row by row, and the depths of the nearest and the farthest point. The columns of the
// matrix are the camera's axes down, right and backward in world coordinates, its position, and height, width and focal
// length in pixels. Lengths have the unit of the COLMAP model.
//
// Makes a pinhole camera for each image in the folder `images` ("": the folder images in `directory`), in the order of
// the names. The principal point is the middle of the image. Reduced images, such as the images in images_4, get a
// shorter focal length. If there is no folder `images`, the videos in `directory` are the sources of the cameras, as in
// the Neural 3D Video dataset. Throws Error with the file and the image.
RigImport import_llff(const std::string& directory, const std::string& images = "");
// Copies the images into the folder images in `directory`. The lenses must be pinholes with the principal point in the
// middle of the image. `near` and `far` are the depths of the nearest and the farthest point of the scene, in metres.
RigExport export_llff(const Rig& rig, const std::string& directory, double near, double far);

// The 4D Light Field Benchmark (Honauer et al. 2016, https://lightfield-analysis.uni-konstanz.de), as written by its
// Blender add-on: parameters.cfg, an INI file, and the images input_Cam000.png, input_Cam001.png, ..., row by row from
// the top left.
//   [intrinsics]  focal_length_mm, sensor_size_mm (of the longer side), image_resolution_x_px, image_resolution_y_px
//   [extrinsics]  num_cams_x, num_cams_y, baseline_mm (between neighbours), focus_distance_m (0: infinity),
//                 center_cam_x_m, _y_m, _z_m and center_cam_rx_rad, _ry_rad, _rz_rad: Blender's location and Euler
//                 angles in the order XYZ; the camera looks along its -z axis, and the z axis of the world points up
//   [meta]        disp_min, disp_max: disparities between neighbours in pixels, positive in front of the focus distance
// All cameras have the same orientation, and points at the focus distance are at the same pixel in all images. The
// world of the rig has Blender's axes x, -z, y. All functions throw Error with file and place.
RigImport import_hci(const std::string& directory);
// Copies the images, which must be PNG files, into `directory`. The rig must be a flat grid of equal pinhole cameras
// with the same direction and equal distances, otherwise throws Error with the difference in pixels.
RigExport export_hci(const Rig& rig, const std::string& directory);

// mrcal's .cameramodel files (https://mrcal.secretsauce.net/cameramodels.html), one for each camera: a dictionary of
// Python with
//   'lens_model' (newer: 'lensmodel'): 'LENSMODEL_PINHOLE' or 'LENSMODEL_OPENCV4', OPENCV5, OPENCV8; also OPENCV12 if
//     all terms beyond k6 are 0
//   'intrinsics': [fx, fy, cx, cy, k1, k2, p1, p2, ...]; 'imagersize': [width, height]
//   'extrinsics' (newer: 'rt_cam_ref'): a Rodrigues vector r and a translation t, x_camera = R(r) x_reference + t
// Pixel coordinates and camera axes are the same as in a rig. `path` is a file, or a folder with files *.cameramodel,
// which are read in the natural order of their names. The name of a camera is the file name without its extension.
// All functions throw Error with file and place.
RigImport import_mrcal(const std::string& path);
// Writes a file for each camera into `directory`, which is created if missing.
RigExport export_mrcal(const Rig& rig, const std::string& directory);

// Caliscope's camera_array.toml (https://github.com/mprib/caliscope): a table [cameras.N] for each camera, with
//   cam_id (older: port); size = [width, height]; matrix (3x3)
//   fisheye; distortions = [k1, k2, p1, p2, k3], or [k1, k2, k3, k4] of a fisheye lens
//   rotation (a Rodrigues vector or 3x3) and translation: x_camera = R x_world + t, metres
//   ignore: the camera is not used
// Pixel coordinates and axes are the same as in a rig. If `undistorted`, the videos were undistorted with the same
// matrix, so that `distortions` have no effect, and the lenses are pinholes. Cameras without a pose and ignored cameras
// are left out, with a note. The id is cam_id. All functions throw Error with file and place.
RigImport import_caliscope(const std::string& path, bool undistorted = false);
RigExport export_caliscope(const Rig& rig, const std::string& path);  // numbers the cameras from 0

// The JSON camera files of MPEG's Reference View Synthesizer (RVS) and Test Model for Immersive Video (TMIV): a list
// "cameras" with
//   Name; Resolution: [width, height]; Projection: "Perspective"; Focal: [fx, fy]; Principle_point: [cx, cy]
//   Position: [x, y, z] and Rotation: [yaw, pitch, roll] in degrees, Rz(yaw) Ry(pitch) Rx(roll), world from camera.
//     The axes of world and camera are x forward, y left, z up.
//   Depth_range: [near, far], in the unit of Position; far = 1000 means infinity
// Pixel centres are at (0.5, 0.5). The world of the rig has the axes right, down and forward of this world. Cameras
// with the name "viewport" (an output), and cameras that "sourceCameraNames" does not list, are left out, with a note.
// The files do not refer to the pictures. All functions throw Error with file and place.
RigImport import_miv(const std::string& path);
// `near` and `far` are the depths of the nearest and the farthest point of the scene, in metres. The formats of videos
// and depth maps, which MPEG's programs need, are not in the file.
RigExport export_miv(const Rig& rig, const std::string& path, double near, double far);

// The undistorted films of Technicolor's array of 4x4 cameras (Sabater et al. 2017, "Dataset and Pipeline for
// Multi-View Light-Field Video"): cameras_parameters.txt and the pictures SCENE_undist_FRAME_CAMERA.png, in `directory`
// or in its folder images. The file has a line of titles and a line for each camera, in the order of CAMERA:
//   f cu cv ar sk qw qx qy qz tx ty tz
// The camera matrix is [f sk cu; 0 ar f cv; 0 0 1], and x_camera = R(q) x_world + t, with the axes of a rig. The centre
// of the top-left pixel is taken as (0.5, 0.5). The set has no documentation of this file; this is how HyperReel
// (datasets/technicolor.py) and SpacetimeGaussians (script/pre_technicolor.py) read it. The distorted films, which have
// the columns d1 and d2 after sk, are rejected, because the formula of their distortion is unknown.
//
// The source of a camera is its picture sequence, or its picture of the first frame if the frames do not start with 0
// or
// 1. Skew is dropped with a note, and is an Error if it moves a point by a pixel. Throws Error with file and line.
RigImport import_technicolor(const std::string& directory);

// models.json of the DeepView Video dataset (Broxton et al. 2020, "Immersive Light Field Video with a Layered Mesh
// Representation"; https://github.com/augmentedperception/deepview_video_dataset, README.md): a list with, for each
// camera,
//   name, width, height; focal_length and principal_point: [x, y] in pixels; pixel_aspect_ratio: 1;
//   projection_type: "fisheye"; radial_distortion: [k1, k2, 0], OPENCV_FISHEYE with k3 = k4 = 0;
//   position: the centre of projection; orientation: a Rodrigues vector r; x_camera = R(r) (x_world - position), with
//   the axes of a rig.
// The centre of the top-left pixel is taken as (0, 0); the README does not tell. The source of a camera is the film
// NAME.mp4 beside the file, if it exists. Throws Error with file and place.
RigImport import_deepview(const std::string& path);

class ImageSearch {
 public:
  // Lists the files of a folder and its subfolders. Throws Error if `directory` is not a folder.
  explicit ImageSearch(const std::string& directory);

  // Returns the path of the file `name`, which may include folders. If there is none, returns the only file with a
  // matching suffix: its name ends with `name`, or `name` ends with its name, at the start of a word. Throws Error if
  // no file or several files match.
  std::string find(const std::string& name) const;
  size_t size() const { return files_.size(); }

 private:
  struct Suffix {
    size_t files = 0;
    std::string first, second;
  };
  // Returns a file with the same name except for its extension or upper and lower case, or "".
  std::string find_similar(const std::string& name) const;

  std::string directory_;
  std::vector<std::string> files_;                    // relative to directory_, sorted
  std::unordered_map<std::string, Suffix> suffixes_;  // suffixes of file names that start at a word
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
//
// Pixel coordinates are the same as in a rig: (0, 0) is the centre of the top-left pixel. The first camera may lack R
// and T, and then defines the world. All other cameras need R and T. A note lists missing distortion coefficients.
// Also read:
// - camera_matrix at the top level, as written by OpenCV's calibration sample and ROS: one camera at the origin;
// - M1, D1, M2, D2, R, T, as written by OpenCV's stereo sample: two cameras. R and T may be in extrinsics.yml next to
//   the file. The file must hold the size: image_width and image_height, or image_size: [width, height].
// - image_sizes, Ks, distortions, Rs (older: rvecs), Ts, models (older: is_fisheye) and cam_ids, as written by OpenCV's
//   multiview_calibration.py: any number of cameras, in the coordinates of the first.
// distortion_model is equidistant (ROS), fisheye_model is 1 (OpenCV's sample) or models has a 1 for a fisheye lens with
// k1 k2 k3 k4. All functions throw Error with file and place. Terms beyond k6 must be 0. If `undistorted`, the pictures
// were undistorted with the same camera matrices, so that the distortion is ignored, and the lenses are pinholes.
RigImport import_opencv_yaml(const std::string& path, bool undistorted = false);
// Parses a file with Ks. `path` is the file name in messages.
std::vector<Camera> parse_opencv_multiview(const nlohmann::json& root, const std::string& path, bool undistorted);
RigExport export_opencv_yaml(const Rig& rig, const std::string& path);

// Parses a number. Returns nullopt unless it is the whole text.
template <class T>
std::optional<T> number_of_text(std::string_view text) {
  T number{};
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && rest == end ? std::optional(number) : std::nullopt;
}

// Returns a list of numbers as text that is valid JSON, YAML, TOML and Python.
std::string number_list_text(std::span<const double> numbers);

// Return the elements of a list of numbers. Throws Error unless it has exactly `count` elements, if given.
std::vector<double> parse_numbers(const JsonValue& list);
std::vector<double> parse_numbers(const JsonValue& list, size_t count);
// Parse the size of a camera's images: the list [width, height], or two numbers.
void parse_image_size(const JsonValue& list, Camera& camera);
void parse_image_size(const JsonValue& width, const JsonValue& height, Camera& camera);

// Returns the paths in a folder, in the natural order of their names. Throws Error if the folder cannot be read.
std::vector<std::filesystem::path> paths_in(const std::string& folder);

// Lenses and poses in the conventions that OpenCV, Kalibr and NeRF files share.

using PinholeParams = std::array<double, 4>;  // fx, fy, cx, cy
// Returns the parameters in a camera matrix, which is given row by row. Returns nullopt if the matrix is not [fx, 0,
// cx, 0, fy, cy, 0, 0, 1].
std::optional<PinholeParams> pinhole_of_matrix(std::span<const double> rows);

// Returns a lens with the distortion terms k1, k2, p1, p2, k3, k4, k5, k6 of OpenCV (missing terms are 0), in the
// simplest model that holds these terms. The centre of the top-left pixel is (0, 0). Throws Error, also if OpenCV's
// further terms (thin prism, tilt) are not 0.
Lens lens_from_opencv(const PinholeParams& pinhole, const std::vector<double>& distortion);
// Returns a lens of OpenCV's fisheye module, with the terms k1, k2, k3, k4.
Lens lens_from_opencv_fisheye(const PinholeParams& pinhole, const std::vector<double>& distortion);
// Does the same as one of the two functions above. If the lens is invalid, the error names the place in the file, and
// `remedy` is the end of the message.
Lens lens_from_opencv(const JsonValue& place, const PinholeParams& pinhole, const std::vector<double>& distortion,
                      bool fisheye, const std::string& remedy = "");
// Returns the distortion terms of a lens in OpenCV's order: k1 k2 p1 p2, or also k3 k4 k5 k6 if some of these are not
// 0; k1 k2 k3 k4 for a fisheye lens. Throws Error for terms that OpenCV's fisheye module does not have.
std::vector<double> opencv_terms(const Lens& lens);
std::vector<double> opencv_terms(const Camera& camera);  // errors name the camera

// A rigid transform: x -> rotation x + translation.
struct RigidTransform {
  Mat3 rotation{1};
  Vec3 translation{0, 0, 0};

  Vec3 operator()(const Vec3& x) const { return rotation * x + translation; }
  RigidTransform operator*(const RigidTransform& first) const;  // applies `first`, then this transform
  RigidTransform inverse() const;
};

RigidTransform camera_from_world(const Pose& pose);
Pose pose_of_camera_from_world(const RigidTransform& motion);
Pose pose_of_world_from_camera(const RigidTransform& motion);

// Returns Rz(angles.z) Ry(angles.y) Rx(angles.x). The angles are in radians.
Mat3 rotation_from_euler(const Vec3& angles);
// Returns the rotation by |vector| radians about the axis `vector`, like cv::Rodrigues().
Mat3 rotation_from_vector(const Vec3& vector);
// Are the inverse of the two functions above.
Vec3 euler_from_rotation(const Mat3& rotation);
Vec3 vector_from_rotation(const Mat3& rotation);

Mat3 matrix_of_rows(std::span<const double> rows);  // 9 numbers, row by row
// Returns the rotation nearest to `matrix`. Calls value.fail() if the difference is larger than rounding to 4 digits
// explains.
Mat3 nearest_rotation(const Mat3& matrix, const JsonValue& value);
// Parses [[r, r, r, t], ...] with 3 rows, or with 4 rows if the last is 0 0 0 1.
RigidTransform parse_rigid_transform(const JsonValue& rows);
// Returns the transform with its fourth row, as text that is valid JSON and YAML.
std::string rigid_transform_text(const RigidTransform& motion);

// Checks the keys of all objects in another program's file.
//
// Some keys change the meaning of other keys: they select a fisheye or panoramic lens, skew, a rolling shutter or other
// axes, which no importer supports. If such a key has a value other than false, 0, null, "" or "none", Error is thrown
// with file, place, key and a remedy. The same applies to keys with another lens model than a pinhole with radial and
// tangential distortion.
//
// Returns a note with the harmless keys that are not in `known`, or nothing. `known` lists the keys that the importer
// reads and the keys that have no effect on a rig. `supported` are keys and lens models, in lower case, that this
// importer supports although others do not. `path` is the file name in messages.
std::vector<std::string> check_foreign_keys(const nlohmann::json& root, const std::string& path,
                                            const std::set<std::string_view>& known,
                                            const std::set<std::string_view>& supported = {});

// The remedy at the end of messages about a lens that a rig cannot hold.
extern const char kUndistortRemedy[];

}  // namespace lf
