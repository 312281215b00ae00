// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig: creates, describes, checks, reduces and converts rig files. Subcommands that open cameras are in
// cameras/commands.cc.
#include "lf_rig.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "cameras/rig_cameras.h"
#include "command_line.h"
#include "image/image_file.h"
#include "render/contribution_map.h"
#include "render/focus_range.h"
#include "render/stanford_focus.h"
#include "rig/camera_source.h"
#include "rig/epipolar_check.h"
#include "rig/exchange.h"
#include "rig/import_format.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "rig/rig_report.h"
#include "rig/source_security.h"
#include "rig/still_image_cache.h"
#include "terminal.h"
#include "view/navigator.h"

namespace {

namespace fs = std::filesystem;

using lf::Rig;

struct Arguments {
  std::string grid;
  int line = 0, arc = 0, ring = 0, inward = 0, outward = 0, rows = 2;
  double radius = 0;
  lf::GridRigOptions new_rig;
  bool devices = false;
  std::string rig, other, out, cameras, sheet;
  int every = 0;
  std::optional<int> frame, rig_id;
  bool binary = false;
  std::optional<double> scale;  // metres per unit of the file
  double near = 0, far = 0;     // depths of the scene, metres
  lf::ColmapImportOptions colmap;
  lf::StanfordOptions stanford{.focus_distance = -1};  // unknown
};

void parse_grid(const std::string& text, int& rows, int& columns) {
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, rows);
  if (first.ec == std::errc() && first.ptr != end && *first.ptr == 'x') {
    const auto second = std::from_chars(first.ptr + 1, end, columns);
    if (second.ec == std::errc() && second.ptr == end && rows >= 1 && columns >= 1) return;
  }
  throw lf::Error("--grid " + text + ": must be ROWSxCOLUMNS, such as 8x8");
}

void print_notes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes) terminal::print("note: %s\n", note.c_str());
}

// Throws Error if the output would replace another file than a rig file. Such a file is probably an input, for example
// the imported file or a picture of a camera.
void require_replaceable(const std::string& out) {
  std::error_code ignored;
  if (!fs::is_regular_file(out, ignored) || fs::file_size(out, ignored) == 0 || lf::is_rig_file(out)) return;
  throw lf::Error("--out " + out + ": exists and is not a rig file, so it is not overwritten; give another file");
}

void save(Rig rig, const std::string& out, const nlohmann::json* original = nullptr) {
  require_replaceable(out);
  lf::rebase_paths(rig, fs::path(out).parent_path().string());
  lf::save_rig(rig, out, original);
  terminal::print("%s: %zu cameras\n", out.c_str(), rig.cameras.size());
}

// Throws Error if the output is not a name of a picture.
void require_picture(const std::string& sheet) {
  const std::string ending = fs::path(sheet).extension().string();
  if (!sheet.empty() && ending != ".png" && ending != ".jpg")
    throw lf::Error("--sheet " + sheet + ": must be NAME.png or NAME.jpg");
}

void save_sheet(const Rig& rig, const std::string& sheet, const std::string& name) {
  if (sheet.empty()) return;
  lf::save_image(array_sheet(rig, name), sheet);
  terminal::print("%s: contact sheet of %s\n", sheet.c_str(), name.c_str());
}

void assign_devices(Rig& rig) {
  gst_init(nullptr, nullptr);
  const std::vector<VideoDevice> devices = find_video_devices();
  if (devices.empty())
    throw lf::Error(
        "--devices: GStreamer finds no camera; check that the cameras are plugged in and that gst-device-monitor-1.0 "
        "lists them");
  for (size_t i = 0; i < devices.size(); i++) {
    const bool used = i < rig.cameras.size();
    if (used) rig.cameras[i].source = devices[i].source;
    terminal::print("%s: %s (%s)%s\n", used ? rig.cameras[i].name.c_str() : "not used", devices[i].source.c_str(),
                    devices[i].name.c_str(),
                    devices[i].stable ? "" : ", but this name may denote another camera after a restart");
  }
  if (devices.size() < rig.cameras.size())
    terminal::print(
        "warning: %zu cameras have no device, because too few cameras are connected; connect them and repeat the "
        "command, or add their sources to the rig file\n",
        rig.cameras.size() - devices.size());
}

Rig make_rig(Arguments& arguments) {
  lf::GridRigOptions& grid = arguments.new_rig;
  const bool around = arguments.inward || arguments.outward;
  if (arguments.radius != 0 && !arguments.arc && !arguments.ring && !around)
    throw lf::Error("--radius: applies only to --arc, --ring, --inward and --outward");
  if (around)
    return lf::make_cylinder_rig({arguments.rows, arguments.inward + arguments.outward, grid.pitch, arguments.radius,
                                  arguments.inward > 0, grid.fov_y_deg, grid.width, grid.height});
  if (arguments.arc)
    return lf::make_arc_rig({arguments.arc, grid.pitch, arguments.radius, grid.fov_y_deg, grid.width, grid.height});
  if (arguments.ring) {
    if (grid.pitch != 0) throw lf::Error("--pitch: does not apply to --ring; use --radius to set its size");
    return lf::make_ring_rig({arguments.ring, arguments.radius, grid.fov_y_deg, grid.width, grid.height});
  }
  grid.rows = 1;
  grid.columns = arguments.line;
  if (!arguments.line) parse_grid(arguments.grid, grid.rows, grid.columns);
  return lf::make_grid_rig(grid);
}

void run_new(Arguments& arguments) {
  Rig rig = make_rig(arguments);
  if (arguments.devices) assign_devices(rig);
  save(rig, arguments.out);
}

void run_info(const Arguments& arguments) {
  const Rig rig = lf::load_rig(arguments.rig);
  const lf::RigSummary summary = lf::summarize(rig);
  const lf::Topology& topology = rig.topology;
  std::string shape = "delaunay";
  if (topology.type == lf::Topology::Type::kGrid)
    shape = "grid of " + std::to_string(topology.rows) + "x" + std::to_string(topology.columns);
  else if (topology.type == lf::Topology::Type::kTriangles)
    shape = "triangles";
  terminal::print("cameras     %zu (%zu with an image, %zu with a source)\n", rig.cameras.size(), summary.images,
                  summary.sources);
  terminal::print("hash        %016llx\n", static_cast<unsigned long long>(rig.hash()));
  terminal::print("topology    %s\n", shape.c_str());
  terminal::print("mesh        %zu triangles", summary.triangles);
  if (summary.other_faces > 0) terminal::print(", %zu other faces", summary.other_faces);
  terminal::print("\nextent      %.6g x %.6g x %.6g m\n", summary.extent.x, summary.extent.y, summary.extent.z);
  terminal::print("baseline    %.6g m (farthest pair)\n", summary.baseline);
  terminal::print("neighbours  %.6g m (mean distance to the nearest)\n", summary.mean_neighbour);
  for (const std::string& lens : summary.lenses) terminal::print("lens        %s\n", lens.c_str());
}

void check_home_view(const Rig& rig, std::vector<lf::RigFinding>& findings) {
  constexpr double kMinSeen = 0.5;
  const double aspect = static_cast<double>(rig.cameras[0].width) / rig.cameras[0].height;
  const lf::VisibleFraction visible(rig);
  if (const double seen = visible(visible.home(aspect), aspect); seen < kMinSeen)
    findings.push_back(
        {lf::RigFinding::Severity::kWarning,
         lf::format_text("topology: cameras see only %.0f %% of the first view: they look along the mesh "
                         "or past each other (lf-show contributions --rig shows what each camera sees)",
                         100 * seen)});
}

// Prints the findings. Returns the number of errors.
size_t print_findings(const std::vector<lf::RigFinding>& findings, const std::string& file) {
  size_t errors = 0;
  for (const lf::RigFinding& finding : findings) {
    const bool is_error = finding.severity == lf::RigFinding::Severity::kError;
    errors += is_error;
    terminal::print("%s: %s: %s\n", file.c_str(), is_error ? "error" : "warning", finding.text.c_str());
  }
  return errors;
}

// Compares stills and the first pictures of image sequences with the geometry.
void check_images(const Rig& rig, std::vector<lf::RigFinding>& findings) {
  lf::Image image;
  const auto load = [&](lf::CameraIndex i) -> const lf::Image& {
    const lf::Camera& camera = rig.cameras[i];
    std::string path = rig.resolve(camera.image);
    if (camera.image.empty()) {
      const lf::CameraSource source = lf::find_camera_source(rig, camera);
      if (source.kind != lf::CameraSource::Kind::kSequence && source.kind != lf::CameraSource::Kind::kStill)
        throw lf::Error("no image file");
      path = source.kind == lf::CameraSource::Kind::kStill ? source.location : lf::sequence_file(source, 0);
    }
    return image = lf::load_image_of_size(path, {camera.width, camera.height});
  };
  for (const lf::RigFinding& finding : lf::describe(lf::check_epipolar_geometry(rig, load)))
    findings.push_back(finding);
}

int run_check(const Arguments& arguments) {
  require_picture(arguments.sheet);
  lf::load_controls(arguments.rig);
  const Rig rig = lf::load_rig(arguments.rig);
  std::vector<lf::RigFinding> findings = lf::check_rig(rig);
  for (const auto& check : {lf::cameras::check_still_decoders, lf::cameras::check_films})
    for (const lf::RigFinding& finding : check(rig)) findings.push_back(finding);
  check_images(rig, findings);
  check_home_view(rig, findings);
  if (const std::string warning = lf::secret_warning(rig, arguments.rig); !warning.empty())
    findings.push_back({lf::RigFinding::Severity::kWarning, warning});
  const size_t errors = print_findings(findings, arguments.rig);
  terminal::print("%s: %zu errors, %zu warnings\n", arguments.rig.c_str(), errors, findings.size() - errors);
  if (errors == 0) save_sheet(rig, arguments.sheet, arguments.rig);
  return errors > 0 ? 1 : 0;
}

void run_subset(const Arguments& arguments) {
  const nlohmann::json original = lf::parse_json(lf::read_text_file(arguments.rig), arguments.rig);
  const Rig rig = lf::load_rig(arguments.rig);
  save(arguments.every > 0 ? lf::subsample_grid(rig, arguments.every)
                           : lf::rig_subset(rig, lf::parse_camera_list(rig, arguments.cameras)),
       arguments.out, &original);
}

std::optional<uint32_t> rig_id_of(const Arguments& arguments) {
  return arguments.rig_id ? std::optional(static_cast<uint32_t>(*arguments.rig_id)) : std::nullopt;
}

struct Format {
  const char* name;
  const char* place;
  const char* about;
  lf::RigImport (*read)(const Arguments&);
  lf::RigExport (*write)(const Rig&, const Arguments&);
  cli::App* import_ = nullptr;
  cli::App* export_ = nullptr;
};

Format formats[] = {
    {"caliscope", "FILE", "Caliscope's camera_array.toml",
     [](const Arguments& a) { return lf::import_caliscope(a.other, a.colmap.undistorted); },
     [](const Rig& rig, const Arguments& a) { return lf::export_caliscope(rig, a.other); }},
    {"colmap", "DIR", "a COLMAP model (cameras and images, .txt or .bin)",
     [](const Arguments& a) { return lf::import_colmap(a.other, a.colmap); },
     [](const Rig& rig, const Arguments& a) {
       return lf::export_colmap(rig, a.other, {a.binary, rig_id_of(a)});
     }},
    {"deepview", "FILE", "models.json of the DeepView Video dataset (Google's rig of 46 cameras)",
     [](const Arguments& a) { return lf::import_deepview(a.other); }, nullptr},
    {"hci", "DIR", "a scene of the 4D Light Field Benchmark (parameters.cfg, and input_Cam000.png, ...)",
     [](const Arguments& a) { return lf::import_hci(a.other); },
     [](const Rig& rig, const Arguments& a) { return lf::export_hci(rig, a.other); }},
    {"kalibr", "FILE", "Kalibr's camchain.yaml", [](const Arguments& a) { return lf::import_kalibr(a.other); },
     [](const Rig& rig, const Arguments& a) { return lf::export_kalibr(rig, a.other); }},
    {"llff", "DIR", "an LLFF capture (poses_bounds.npy and the folder images)",
     [](const Arguments& a) { return lf::import_llff(a.other, a.colmap.images); },
     [](const Rig& rig, const Arguments& a) { return lf::export_llff(rig, a.other, a.near, a.far); }},
    {"miv", "FILE", "a JSON camera file of MPEG's RVS and TMIV (MPEG Immersive Video)",
     [](const Arguments& a) { return lf::import_miv(a.other); },
     [](const Rig& rig, const Arguments& a) { return lf::export_miv(rig, a.other, a.near, a.far); }},
    {"mrcal", "PATH", "mrcal's .cameramodel files (a file, or a folder with a file for each camera)",
     [](const Arguments& a) { return lf::import_mrcal(a.other); },
     [](const Rig& rig, const Arguments& a) { return lf::export_mrcal(rig, a.other); }},
    {"nerf", "FILE", "NeRF's transforms.json", [](const Arguments& a) { return lf::import_nerf(a.other); },
     [](const Rig& rig, const Arguments& a) { return lf::export_nerf(rig, a.other); }},
    {"opencv", "FILE", "OpenCV's YAML (camera_matrix, distortion_coefficients, R, T)",
     [](const Arguments& a) { return lf::import_opencv_yaml(a.other, a.colmap.undistorted); },
     [](const Rig& rig, const Arguments& a) { return lf::export_opencv_yaml(rig, a.other); }},
    {"stanford", "DIR", "images with file names of the Stanford light field archive (out_00_01_Y_X_.png)",
     [](const Arguments& a) { return lf::import_stanford_pictures(a.other, a.stanford); },
     [](const Rig& rig, const Arguments& a) {
       return lf::export_stanford(rig, a.other, a.scale.value_or(lf::StanfordOptions().unit));
     }},
    {"technicolor", "DIR",
     "undistorted films of Technicolor's array (cameras_parameters.txt and Scene_undist_00001_00.png, ...)",
     [](const Arguments& a) { return lf::import_technicolor(a.other); }, nullptr},
};

// Returns the row of a format that exists.
Format& format_of(std::string_view name) { return *std::ranges::find(formats, name, &Format::name); }

// The focus distance of a Stanford import is in metres, so this importer converts the unit itself.
bool converts_unit(const Format& format) { return std::string_view(format.name) == "stanford"; }

// Reads the files of another program, with lengths in metres.
lf::RigImport read_import(Arguments& arguments, const Format& format) {
  if (arguments.scale) arguments.stanford.unit = *arguments.scale;
  lf::RigImport result = format.read(arguments);
  if (arguments.scale) lf::scale_lengths(result, converts_unit(format) ? 1 : *arguments.scale);
  return result;
}

// Sets the focus distance of a rig to the middle of the scene that its images show. It stays unknown if the images do
// not show it, or if an image cannot be read, which `lf-rig check` reports.
void estimate_focus(Rig& rig) {
  if (!lf::has_images(rig)) return;
  try {
    lf::StillImageCache images(rig);
    const auto range =
        lf::estimate_focus_range(rig, [&](lf::CameraIndex i) -> const lf::Image& { return images.get(i); });
    if (!range) return;
    const lf::Pose& middle = rig.cameras[lf::middle_camera(rig)].pose;
    const lf::Vec3 point = middle.position + std::sqrt(range->near * range->far) * middle.forward();
    const double distance = lf::default_viewpoint(rig).pose.camera_from_world(point).z;
    if (distance > 0) rig.focus_distance = distance;
  } catch (const lf::Error&) {
  }
}

void finish_import(const Arguments& arguments, const Format& format, lf::RigImport result) {
  estimate_focus(result.rig);
  print_notes(result.notes);
  if (const std::string note = lf::depth_note(result); !note.empty()) terminal::print("note: %s\n", note.c_str());
  if (lf::has_no_pictures(result.rig))
    terminal::print(
        "note: the imported rig has no images; add a \"source\" (or an \"image\", a still) to each camera in %s\n",
        arguments.out.c_str());
  if (const std::string notice = lf::orientation_notice(result.rig); !notice.empty())
    terminal::print("note: %s\n", notice.c_str());
  print_findings(lf::check_lenses(result.rig), arguments.out);
  const nlohmann::json unknown_unit = {{"unit", "unknown"}};
  save(result.rig, arguments.out, result.has_unit || arguments.scale ? nullptr : &unknown_unit);
  if (const std::string text = lf::arrangement_text(result.rig); !text.empty())
    terminal::print("%s: %s%s\n", arguments.out.c_str(), text.c_str(),
                    result.has_unit ? ""
                                    : lf::format_text(" (the file does not tell its unit of length, which is taken as "
                                                      "%g m; --scale gives the metres per unit)",
                                                      converts_unit(format) ? lf::StanfordOptions().unit : 1)
                                          .c_str());
  save_sheet(result.rig, arguments.sheet, arguments.out);
}

void run_format_import(Arguments& arguments, const Format& format) {
  require_replaceable(arguments.out);
  require_picture(arguments.sheet);
  if (arguments.frame) arguments.colmap.frame = static_cast<uint32_t>(*arguments.frame);
  arguments.colmap.rig = rig_id_of(arguments);
  if (!arguments.grid.empty()) parse_grid(arguments.grid, arguments.colmap.rows, arguments.colmap.columns);
  finish_import(arguments, format, read_import(arguments, format));
}

void run_export(const Arguments& arguments, const Format& format) {
  const Rig rig = lf::load_rig(arguments.rig);
  if (std::error_code ignored; fs::equivalent(arguments.rig, arguments.other, ignored))
    throw lf::Error(arguments.other + ": is the rig file itself, which is not overwritten; give another file");
  if (arguments.far < arguments.near) throw lf::Error("--focus-far: must not be less than --focus-near");
  const lf::RigExport result = format.write(rig, arguments);
  print_notes(result.notes);
  if (const std::string note = lf::lost_keys_note(lf::parse_json(lf::read_text_file(arguments.rig), arguments.rig));
      !note.empty())
    terminal::print("note: %s\n", note.c_str());
  terminal::print("%s: %zu images, maximum error %.2g px\n", arguments.other.c_str(), rig.cameras.size(),
                  result.max_error);
}

// Imports a file or folder of a format that the user did not give.
void run_import(Arguments& arguments) {
  if (arguments.other.empty() || arguments.out.empty()) {
    std::string names;
    for (const Format& format : formats) names += (names.empty() ? "" : ", ") + std::string(format.name);
    throw lf::Error("import: needs PATH and --out, or one of the commands " + names + " (see lf-rig import --help)");
  }
  require_replaceable(arguments.out);
  require_picture(arguments.sheet);
  const lf::ImportFormat found = lf::find_import_format(arguments.other);
  const Format& format = format_of(found.name);
  arguments.other = found.path;
  arguments.colmap.images = found.images;
  lf::RigImport result;
  try {
    result = read_import(arguments, format);
  } catch (const lf::Error& e) {
    throw lf::Error(std::string(e.what()) + " (" + found.sign + " shows the format " + found.name +
                    "; to give options, use \"" + lf::import_command(found) + "\")");
  }
  terminal::print("%s: %zu %s from %s%s\n", format.name, result.rig.cameras.size(),
                  result.rig.cameras.size() == 1 ? "camera" : "cameras", found.sign.c_str(),
                  found.images.empty() ? "" : (", images in " + found.images).c_str());
  finish_import(arguments, format, result);
}

void add_sheet_option(cli::App& command, Arguments& arguments) {
  command
      .add_option(
          "--sheet", arguments.sheet,
          "Picture to write (.png or .jpg): a contact sheet with the camera images, the home view, and plans of "
          "the array from behind and from above")
      ->type_name("PICTURE");
}

void add_common_import_options(cli::App& command, Arguments& arguments) {
  command
      .add_option("--scale", arguments.scale,
                  "Length of one unit of the file, in metres. All lengths are multiplied by this factor, for example "
                  "0.001 for a file with millimetres (default: 1, or 0.001 for the format stanford)")
      ->check(cli::PositiveNumber);
  add_sheet_option(command, arguments);
}

void add_images_option(cli::App& command, Arguments& arguments) {
  command.add_option("--images", arguments.colmap.images,
                     "Folder that contains the image files, if they are not in the usual place (default: DIR/images)");
}

void add_colmap_options(Arguments& arguments) {
  cli::App* colmap = format_of("colmap").import_;
  add_images_option(*colmap, arguments);
  colmap->add_flag("--undistorted", arguments.colmap.undistorted,
                   "The image files are already undistorted, for example by COLMAP's image_undistorter. The rig then "
                   "uses pinhole lenses, and takes the image size from each file");
  cli::Option* frame = colmap->add_option(
      "--frame", arguments.frame,
      "FRAME_ID of the frame to import, for a model with rigs of cameras (COLMAP 3.12 or newer). A frame contains the "
      "images of all cameras at one instant. Without this option, each image of the model becomes a camera");
  frame->check(cli::NonNegativeNumber);
  colmap
      ->add_option(
          "--rig-id", arguments.rig_id,
          "RIG_ID of a rig of cameras (COLMAP 3.12 or newer). Imports the calibrated cameras of this rig, without "
          "images, instead of the images of the model")
      ->check(cli::NonNegativeNumber)
      ->excludes(frame);
  colmap
      ->add_option("--grid", arguments.grid,
                   "Rows and columns of the array, for example 4x8. The cameras are assigned to the grid in the order "
                   "of their names")
      ->type_name("RxC");
  cli::App* colmap_export = format_of("colmap").export_;
  colmap_export->add_flag("--binary", arguments.binary,
                          "Write a binary model, as COLMAP does by default, instead of a text model");
  colmap_export
      ->add_option("--rig-id", arguments.rig_id,
                   "Also write the array as the rig of cameras RIG_ID, and the images as the only frame of this rig, 1 "
                   "(COLMAP 3.12 or newer). COLMAP's database must have the same rig")
      ->check(cli::NonNegativeNumber);
}

void add_stanford_options(Arguments& arguments) {
  cli::App *stanford = format_of("stanford").import_, *stanford_export = format_of("stanford").export_;
  stanford
      ->add_option("--f", arguments.stanford.f,
                   "Focal length of the cameras, in pixels (default: from the file names, otherwise a horizontal field "
                   "of view of 50 degrees)")
      ->check(cli::PositiveNumber);
  stanford
      ->add_option("--focus-distance", arguments.stanford.focus_distance,
                   "Distance of objects that have the same position in all images, in metres; 0 means infinity. Images "
                   "of an archive are often shifted so that one plane has no disparity (default: estimated from the "
                   "images)")
      ->check(cli::NonNegativeNumber);
  stanford_export
      ->add_option("--scale", arguments.scale,
                   "Length of one unit of the camera positions in the file names, in metres (default: 0.001, for "
                   "millimetres)")
      ->check(cli::PositiveNumber);
}

// Adds the options of single formats.
void add_format_options(Arguments& arguments) {
  add_colmap_options(arguments);
  add_stanford_options(arguments);
  add_images_option(*format_of("llff").import_, arguments);
  for (const char* name : {"caliscope", "opencv"})
    format_of(name).import_->add_flag("--undistorted", arguments.colmap.undistorted,
                                      "The pictures are already undistorted with the same camera matrix, as by "
                                      "OpenCV's undistort(). The rig then uses pinhole lenses");
  for (const char* name : {"llff", "miv"}) {
    cli::App* command = format_of(name).export_;
    command->add_option("--focus-near", arguments.near, "Distance of the nearest point of the scene, in metres")
        ->required()
        ->check(cli::PositiveNumber);
    command
        ->add_option("--focus-far", arguments.far,
                     "Distance of the farthest point of the scene, in metres, for example 1000 if there is no limit")
        ->required()
        ->check(cli::PositiveNumber);
  }
}

// Adds the commands "import", which finds the format if it is used without a command for a format, and "export".
void add_formats(cli::App& app, Arguments& arguments) {
  cli::App* imports = app.add_subcommand(
      "import",
      "Converts files of another program to a rig file. Without a command, it finds the format of PATH by its files "
      "and contents. The commands have further options");
  cli::App* exports = app.add_subcommand("export", "Converts a rig file to files of another program");
  imports->add_option("PATH", arguments.other, "File or folder to read, of any of the formats");
  imports->add_option("--out", arguments.out, "Rig file to write. PATH and --out are required without a command");
  add_common_import_options(*imports, arguments);
  imports->require_subcommand(0, 1);
  exports->require_subcommand(1);
  for (Format& format : formats) {
    format.import_ = imports->add_subcommand(format.name, std::string("From ") + format.about);
    format.import_->excludes_options_of(*imports);
    format.import_->add_option(format.place, arguments.other, "File or folder to read")->required();
    format.import_->add_option("--out", arguments.out, "Rig file to write")->required();
    add_common_import_options(*format.import_, arguments);
    format.import_->callback([&] { run_format_import(arguments, format); });
    if (!format.write) continue;
    format.export_ = exports->add_subcommand(format.name, std::string("As ") + format.about);
    format.export_->add_option("RIG", arguments.rig, "Rig file")->required();
    format.export_->add_option(format.place, arguments.other, "File or folder to write")->required();
    format.export_->callback([&] { run_export(arguments, format); });
  }
  const auto is_used = [](const Format& format) { return static_cast<bool>(*format.import_); };
  imports->callback([&arguments, is_used] {
    if (std::ranges::none_of(formats, is_used)) run_import(arguments);
  });
  add_format_options(arguments);
}

void add_new_command(cli::App& app, Arguments& arguments) {
  cli::App* make = app.add_subcommand("new",
                                      "Creates a nominal rig file for newly mounted cameras, from the intended shape "
                                      "of the array. lf-calibrate then measures the true positions");
  cli::App* shape = make->add_option_group("shape");
  std::vector<const cli::Option*> flat = {
      shape
          ->add_option("--grid", arguments.grid,
                       "Rows and columns of a rectangular grid, for example 4x8. Row 0 is at the top")
          ->type_name("RxC")};
  const std::tuple<const char*, int&, const char*> shapes[] = {
      {"--line", arguments.line,
       "Number of cameras in a straight row, from left to right. Neighbours are --pitch "
       "apart"},
      {"--arc", arguments.arc,
       "Number of cameras on an arc of a circle with --radius, from left to right. All cameras look at the centre of "
       "the arc"},
      {"--ring", arguments.ring,
       "Number of cameras on a circle with --radius, clockwise from the top. All cameras "
       "look forward"},
      {"--inward", arguments.inward,
       "Number of cameras in each row around a cylinder with --radius. All cameras look inwards, at the axis"},
      {"--outward", arguments.outward,
       "Number of cameras in each row around a cylinder with --radius. All cameras look outwards, away from the axis"}};
  for (const auto& [name, cameras, help] : shapes) {
    const cli::Option* option = shape->add_option(name, cameras, help)->check(cli::PositiveNumber);
    if (&cameras != &arguments.inward && &cameras != &arguments.outward) flat.push_back(option);
  }
  shape->require_option(1);
  cli::Option* rows = make->add_option(
      "--rows", arguments.rows, "Number of rows of a cylinder (--inward, --outward). The rows are --pitch apart");
  for (const cli::Option* option : flat) rows->excludes(option);
  make->add_option("--pitch", arguments.new_rig.pitch,
                   "Distance between the centres of neighbouring cameras, in "
                   "metres");
  make->add_option("--radius", arguments.radius,
                   "Radius of the arc, ring or cylinder, in metres, measured to the "
                   "centres of the cameras");
  make->add_option("--fov", arguments.new_rig.fov_y_deg,
                   "Vertical field of view of the cameras, in degrees, as in the "
                   "data sheet of the lens. A calibration measures the exact "
                   "value later")
      ->required();
  make->add_option("--width", arguments.new_rig.width,
                   "Image width of the cameras, in pixels. It must be a size that "
                   "the cameras can deliver");
  make->add_option("--height", arguments.new_rig.height,
                   "Image height of the cameras, in pixels. It must be a size "
                   "that the cameras can deliver");
  make->add_flag("--devices", arguments.devices,
                 "Use the connected cameras as sources, in the order of their ports. This finds all cameras known to "
                 "GStreamer, for example from v4l2, libcamera and Aravis. Without this option, the rig file has no "
                 "sources, and you must add them yourself");
  make->add_option("--out", arguments.out, "Rig file to write")->required();
  make->callback([&] { run_new(arguments); });
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  cli::App app(
      "Creates, describes, checks, reduces and converts rig files, which describe the cameras of an array. Other "
      "commands open the cameras to test, arrange, lock or record them all together",
      "lf-rig");
  app.require_subcommand(1);

  add_new_command(app, arguments);

  cli::App* info = app.add_subcommand(
      "info", "Describes a rig: number of cameras, shape, extent and distances between neighbouring cameras");
  info->add_option("RIG", arguments.rig, "Rig file")->required();
  info->callback([&] { run_info(arguments); });

  cli::App* check = app.add_subcommand(
      "check", "Checks a rig file and prints errors and warnings. The exit status is 1 if there is an error");
  check->add_option("RIG", arguments.rig, "Rig file")->required();
  add_sheet_option(*check, arguments);
  check->callback([&] { return run_check(arguments); });

  cli::App* subset = app.add_subcommand("subset", "Writes a rig file with some of the cameras of a rig");
  subset->add_option("RIG", arguments.rig, "Rig file")->required();
  cli::App* which = subset->add_option_group("which");
  which
      ->add_option("--every", arguments.every,
                   "Keep only every N-th row and column of a grid, starting with row and column 0. For example, 2 "
                   "keeps a quarter of the cameras, which shows the quality of a sparser array")
      ->check(cli::PositiveNumber);
  which->add_option("--cameras", arguments.cameras,
                    "Ids of the cameras to keep, as numbers and ranges, for example "
                    "0-3,7");
  which->require_option(1);
  subset->add_option("--out", arguments.out, "Rig file to write")->required();
  subset->callback([&] { run_subset(arguments); });

  add_formats(app, arguments);
  add_deploy_command(app);
  add_doctor_command(app);
  add_identify_command(app);
  add_lock_command(app);
  add_record_command(app);
  add_snapshot_command(app);
  return cli::run_tool(app, argc, argv);
}
