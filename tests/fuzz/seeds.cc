// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fuzz/seeds.h"

#include "base/json_value.h"
#include "lib/rtp/rtp_test.h"
#include "node/camera_access.h"
#include "rig/colmap_model.h"
#include "rig/exchange.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/colmap_binary.h"
#include "support/jpeg_samples.h"
#include "support/temp_dir.h"
#include "view/navigator.h"
#include "view/view_path.h"
#include "web/offers.h"
#include "wire/command_codec.h"
#include "wire/consistency_codec.h"
#include "wire/surface_codec.h"
#include "wire/unit.h"

namespace lf::fuzz {
namespace {

Bytes join(const std::vector<Bytes>& parts) {
  Bytes out;
  for (const Bytes& part : parts) out.insert(out.end(), part.begin(), part.end());
  return out;
}

Bytes packets(wire::UnitKind kind, const std::vector<Bytes>& units, size_t max_payload) {
  Bytes out{kind == wire::UnitKind::kRequest};
  rtp::Packetizer packetizer(kind);
  for (const Bytes& unit : units)
    for (const rtp::Sent& sent : rtp::packetize(packetizer, unit, max_payload))
      out = join({out,
                  {16, static_cast<uint8_t>(sent.payload.size() >> 8), static_cast<uint8_t>(sent.payload.size())},
                  sent.payload});
  return out;
}

void add_frames(std::vector<Bytes>& seeds) {
  using Kind = test::JpegKind;
  const Image picture = test::noisy_picture(41, 23, 1);
  for (const Kind& kind : {Kind{}, Kind{.restart_interval = 2}, Kind{.v = 1}, Kind{.h = 1}, Kind{.h = 1, .v = 1},
                           Kind{.chroma_v = 2, .quality = 40}, Kind{.grey = true, .h = 1, .v = 1},
                           Kind{.quality = 100, .restart_interval = 1, .optimise = true}, Kind{.progressive = true},
                           Kind{.one_by_one = true}})
    seeds.push_back(test::encode_jpeg(picture, kind));
  seeds.push_back(test::without_huffman_tables(test::encode_jpeg(picture, {})));
}

// Adds a text after the letter that selects its format.
void add_text(std::vector<Bytes>& seeds, char kind, const std::string& text) {
  Bytes bytes{static_cast<uint8_t>(kind)};
  bytes.insert(bytes.end(), text.begin(), text.end());
  seeds.push_back(bytes);
}

void add_texts(std::vector<Bytes>& json, std::vector<Bytes>& import) {
  Rig rig = scene_rig(2, 2, 64, 48);
  for (Camera& camera : rig.cameras) camera.image.clear(), camera.source.clear();
  add_text(json, 'r', rig_to_json(rig));
  const TempDir folder;
  for (const auto& topology :
       {R"({"type": "delaunay"})", R"({"type": "triangles", "triangles": [[0, 1, 2], [1, 3, 2]]})"}) {
    std::string text = rig_to_json(rig);
    text.replace(text.rfind("{"), text.rfind("}") - text.rfind("{"), topology);
    add_text(json, 'r', text);
  }
  add_text(json, 'v',
           R"({"format": "lightfield-views", "version": 1, "views": [{"width": 64, "height": 48, "fov_y": 40,
    "position": [0, 0, -1], "orientation": [1, 0, 0, 0], "focus_distance": 2}, {"name": "b", "time": 1.5, "width": 8,
    "height": 8, "model": "PINHOLE", "params": [9, 8, 4, 4], "position": [0, 0, 0], "orientation": [0, 1, 0, 0],
    "focal_plane": [0, 0, 1, -3]}]})");
  for (const char* bar : {"false", "true"})
    add_text(json, 't',
             std::string(R"({"format": "lightfield-tracks", "version": 1, "bar": )") + bar +
                 R"(, "cameras": [{"id": 3, "width": 64, "height": 48}], "positions": [{"observations":
                              [[3, 1.5, 2)" +
                 (bar[0] == 't' ? ", 1" : "") + R"(]]}, {"observations": []}]})");
  const std::string path = folder / "file";
  export_kalibr(rig, path);
  add_text(import, 'k', read_text_file(path));
  export_opencv_yaml(rig, path);
  add_text(import, 'o', read_text_file(path));
  export_nerf(rig, path);
  add_text(import, 'n', read_text_file(path));
  export_colmap(rig, folder.path());
  const std::string model = read_text_file(folder / "cameras.txt") + "\f" + read_text_file(folder / "images.txt");
  add_text(import, 'c', model);
  add_text(import, 'g', model);
  add_text(import, 'f', model + "\f6 1 1 0 0 0 0.5 0 -2e-1 2 CAMERA 1 1 IMU 1 2\n7 1 1 0 0 0 0 0 0 0\n");
  add_text(import, 'r', model + "\f6 4 CAMERA 0 CAMERA 1 1 1 0 0 0 0.5 0 -2e-1 CAMERA 2 0 IMU 1 0\n7 1 CAMERA 3\n");
  const ColmapModel colmap = read_colmap_model(folder.path());
  const std::string cameras = colmap_cameras_file(colmap.cameras, true);
  add_text(import, 'b', static_cast<char>(cameras.size() / 8) + cameras + colmap_images_file(colmap.images, true));
  add_text(import, 'e',
           test::bytes_of(uint64_t{1}, uint32_t{6}, uint32_t{1}, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.25, uint32_t{2},
                          int32_t{0}, uint32_t{1}, uint64_t{1}, int32_t{0}, uint32_t{2}, uint64_t{2}));
  add_text(import, 'q',
           test::bytes_of(uint64_t{1}, uint32_t{6}, uint32_t{3}, int32_t{0}, uint32_t{1}, int32_t{0}, uint32_t{2},
                          uint8_t{1}, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.25, int32_t{1}, uint32_t{1}, uint8_t{0}));
  // Cameras around a scene, with surrounding triangles.
  export_nerf(make_cylinder_rig({2, 5, 0.3, 1.5, true, 60}), path);
  add_text(import, 'n', read_text_file(path));
  const std::string frame =
      R"({"file_path": "a", "time": 0, "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})";
  add_text(import, 'n',
           R"({"camera_model": "OPENCV", "w": 8.0, "h": 6, "fl_x": 7, "k3": 0, "is_fisheye": false,
    "distortion_params": [0.1, 0, 0, 0, 0, 0], "applied_transform": [[1,0,0,0],[0,0,1,0],[0,-1,0,0]],
    "applied_scale": 0.5, "rolling_shutter": [0, 0, 0, 0], "frames": [)" +
               frame + "," + frame + "]}");
  const std::string camera =
      ":\n  camera_model: pinhole\n  distortion_model: none\n  intrinsics: [9, 9, 4, 3]\n  resolution: [8, 6]\n";
  const std::string motion = "[[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  add_text(import, 'k',
           "cam0" + camera + "  timeshift_cam_imu: 0.002\n  T_cam_imu: " + motion + "cam2" + camera + "  T_cn_cnm1: " +
               motion + "  T_imu_cam: " + motion + "cam3" + camera + "  line_delay: 0\n  T_cn_cnm1: " + motion);
  const std::string matrix = ": { rows: 3, cols: 3, data: [9, 0, 4, 0, 9, 3, 0, 0, 1] }\n";
  add_text(import, 'o', "distortion_model: plumb_bob\nimage_width: 8\nimage_height: 6.0\ncamera_matrix" + matrix);
  add_text(import, 'o',
           "%YAML:1.0\n---\nimage_size: [8, 6]\nM1" + matrix + "M2" + matrix +
               "D1: { rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0] }\n\f%YAML:1.0\n---\nR: { rows: 3, cols: 3, data: "
               "[1, 0, 0, 0, 1, 0, 0, 0, 1] }\nT: { rows: 3, cols: 1, data: [-0.1, 0, 0] }\n");
  for (const char kind : {'o', 'p'})
    add_text(
        import, kind,
        "%YAML:1.0\n---\nRs: { rows: 2, cols: 3, dt: 3d, data: [1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, "
        "1] }\ndistortions: { rows: 10, cols: 1, data: [0.1, 0, 0, 0, 0, 0, 0, 0, 0, 0] }\nKs: { sizes: [2, 3, "
        "3], data: [9, 0, 4, 0, 9, 3, 0, 0, 1, 9, 0, 4, 0, 9, 3, 0, 0, 1] }\nTs: { rows: 2, cols: 3, data: [0, 0, "
        "0, -0.5, 0, 0] }\nmodels: { rows: 2, cols: 1, data: [0, 0] }\nimage_sizes: { rows: 2, cols: 2, data: [8, "
        "6, 8, 6] }\ncam_ids: \"a,b\"\n");
  add_text(import, 'h',
           "[intrinsics]\nfocal_length_mm = 100.0\nimage_resolution_x_px = 1\nimage_resolution_y_px = 1\n"
           "sensor_size_mm = 35.0\nfstop = 8\n\n[extrinsics]\nnum_cams_x = 2\nnum_cams_y = 2\nbaseline_mm = 25.0\n"
           "focus_distance_m = 4.25\ncenter_cam_x_m = -2.4\ncenter_cam_y_m = 0\ncenter_cam_z_m = 1\n"
           "center_cam_rx_rad = 1.32\ncenter_cam_ry_rad = -4e-08\ncenter_cam_rz_rad = -0.6\noffset = 0.01\n"
           "# notes\n[meta]\nscene = cotton\ndisp_min = -1.6\ndisp_max = 1.5\n");
  add_text(import, 'm',
           "# a note\n{\n 'lens_model': 'LENSMODEL_OPENCV5',\n 'intrinsics': [ 9., 9, 4, 3, 0.1, 0, 1e-3, -2e-3, 0,],\n"
           " 'valid_intrinsics_region': [\n [ 0, 1 ],\n],\n # extrinsics are rt_fromref\n 'extrinsics': [ 2e-2, -3e-1, "
           "-1e-2, 1., 2, -3., ],\n 'imagersize': [ 8, 6 ],\n 'optimization_inputs': b'P)h}]',\n}\n");
  const std::string table =
      "size = [8, 6]\nmatrix = [[9.0, 0.0, 4.0], [0.0, 9.0, 3.0], # fy\n [0.0, 0.0, 1.0]]\n"
      "translation = [0.1, 0.2, 1.5]\nignore = false\nerror = \"null\"\n";
  for (const char kind : {'t', 'u'})
    add_text(import, kind,
             "[cameras.0]\nrotation = [0.3, -0.7, 1.1]\ndistortions = [-0.3, 0.1, 1e-3, 2e-3, 0.0]\n" + table +
                 "\n[cameras.10]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n" + table);
  add_text(import, 'v',
           R"({"Content_name": "a", "lengthsInMeters": true, "sourceCameraNames": ["v0", "v1"], "cameras": [
    {"Name": "v0", "Position": [0, 0.5, 0], "Rotation": [20, -10, 5], "Depth_range": [0.5, 2], "Resolution": [8, 6],
     "Projection": "Perspective", "Focal": [9, 9], "Principle_point": [4, 3]},
    {"Name": "v1", "Position": [0, 0, 0], "Rotation": [0, 0, 0], "Depth_range": [0.5, 1000], "Resolution": [8, 6],
     "Projection": "Perspective", "Focal": [9, 8.5], "Principle_point": [4.5, 3], "Depthmap": 1},
    {"Name": "viewport", "Projection": "Equirectangular"}]})");
  add_text(
      import, 'd',
      R"([{"name": "camera_0001", "position": [0.01, 0, 0.5], "orientation": [-0.03, 0.02, -0.5], "focal_length": 9.5,
    "pixel_aspect_ratio": 1.0, "principal_point": [4.5, 3], "height": 6.0, "width": 8, "radial_distortion": [0.1, -0.01, 0],
    "projection_type": "fisheye"}])");
  std::string array = "f cu cv ar sk qw qx qy qz tx ty tz\n", header =
                                                                  "{'descr': '<f4', 'fortran_order': False, 'shape': "
                                                                  "(4, 17), }";
  for (int i = 0; i < 4; i++)
    array += "50 0.5 0.5 1 0.01 1 0 0 0 " + std::to_string(i % 2) + " -0.25 " + std::to_string(i) + "\n";
  add_text(import, 'a', array);
  std::string poses = std::string("\x93NUMPY\1\0", 8) + static_cast<char>(header.size()) + '\0' + header;
  for (int i = 0; i < 4; i++)
    for (const float value :
         {0.F, 1.F, 0.F, 0.1F * i, 1.F, 1.F, 0.F, 0.F, 0.2F, 1.F, 0.F, 0.F, -1.F, 0.F, 5.F, 1.5F, 20.F})
      poses.append(reinterpret_cast<const char*>(&value), sizeof(value));
  add_text(import, 'l', poses);
  add_text(import, 's', "out_00_00_-1.5_2.0_.png\nout_00_01_-1.5_3.0_.png\nout_01_00_-2.5_2_.jpg\nnotes.txt");
}

}  // namespace

std::map<std::string, std::vector<Bytes>> seeds() {
  std::map<std::string, std::vector<Bytes>> all;
  using enum PixelFamily;
  CameraRanges cameras;
  cameras.append({0, 3});
  cameras.append({7, 9});
  const std::vector<Bytes> answers{
      rtp::answer(0, 1, 1, 0),
      rtp::answer(2, 6, 5, 0, kRgb),
      rtp::answer(2, 7, 5, 0, kI420, cameras),
      rtp::answer(5, 16, 16, 50, kI420, cameras),  // an atlas
      rtp::answer(3, 20, 10, 90, kRgb),
      rtp::answer(1, 90, 70, 75, kI420),
      rtp::answer_with_sum(6, 5, true, 2),
      rtp::answer_with_sum(8, 6, false, 0),
  };
  const std::vector<Bytes> requests{rtp::request(1), rtp::request(2), rtp::request(3, 7, 5)};
  for (const Bytes& unit : answers) {
    all["answer"].push_back(unit);
    all["packetizer"].push_back(join({{0, 0}, unit}));
    all["depacketizer"].push_back(packets(wire::UnitKind::kAnswer, {unit}, rtp::kMinPayloadBytes));
  }
  ViewRequest asked;
  asked.view.width = asked.view.height = 64;
  asked.view.lens = Lens::from_fov_y(40, 64, 64);
  asked.view.focus.plane = focal_plane_at(asked.view.pose, 2);
  asked.place = {ViewSetLayout::kQuilt, 8, 6, 5};
  all["request"].push_back(wire::encode_request(asked));
  asked.place = {};
  const Rig rig = scene_rig(2, 2, 64, 48);
  for (const Access access : {Access::kWarp, Access::kPixels})
    all["request"].push_back(wire::encode_any_request(CameraAccess::of(access)->command(rig, build_mesh(rig), asked)));
  FocalMap map = FocalMap::for_view(64, 64);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.1;
  map.nearest = 1;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(i / 20 * 30));
  asked.view.focus.map = std::make_shared<FocalMap>(map);
  for (const Blending blending :
       {Blending{Blending::Kind::kAperture, 0.2, 0}, Blending{Blending::Kind::kAngle, 0, 4}}) {
    asked.view.blending = blending;
    all["request"].push_back(wire::encode_request(asked));
  }
  asked.hypotheses = {
      {DepthHypothesis::Kind::kBlurred}, {DepthHypothesis::Kind::kShifted, 3}, {DepthHypothesis::Kind::kPlane, 60}};
  all["request"].push_back(wire::encode_request(asked));
  asked.gains = {.use = true, .ask = true, .mean = std::vector<uint8_t>(64, 90), .mean_of = 7};
  all["request"].push_back(wire::encode_request(asked));
  std::vector<PhotoConsistency> moments(2);
  for (PhotoConsistency& m : moments) {
    m.reset(5, 4);
    for (size_t i = 6; i < 15; i++) {
      m.weight[i] = &m == &moments[0] ? 32768 : 20000;
      m.luma[i] = m.square[i] = static_cast<uint16_t>(1000 * i);
    }
  }
  const ByteBuffer coded = wire::encode_consistency({1, 2, 3, 4, {}}, moments);
  const Bytes consistency_unit(coded.begin(), coded.end());
  all["moments"].push_back(consistency_unit);
  for (PhotoConsistency& m : moments)
    for (size_t i = 6; i < 15; i++) {
      m.weight[i] = static_cast<uint16_t>(2000 * i);
      m.luma[i] = PhotoConsistency::luma_of(m.weight[i], 77);
      m.square[i] = PhotoConsistency::square_of(m.luma[i], 77);
    }
  const ByteBuffer of_one = wire::encode_consistency({1, 2, 3, 4, {}}, moments, true);
  all["moments"].push_back(Bytes(of_one.begin(), of_one.end()));
  const ByteBuffer gains = wire::encode_consistency({1, 2, 3, 4, GainSum{9000, -77}}, {&moments[1], 1});
  all["moments"].push_back(Bytes(gains.begin(), gains.end()));
  all["packetizer"].push_back(join({{0, 0}, consistency_unit}));
  all["framing"].push_back(join({{9}, consistency_unit, answers[0]}));
  for (const Bytes& unit : requests) {
    all["request"].push_back(unit);
    all["packetizer"].push_back(join({{0, 1}, unit}));
  }
  View shown = make_view({}, 96, 64);
  all["surface"].push_back(wire::encode_surface(*wire::picture_surface(shown, 1)));
  FocalMap slope = FocalMap::for_view(shown.width, shown.height);
  slope.nearest = 1;
  for (int i = 0; i < slope.columns * slope.rows; i++)
    slope.levels.push_back(static_cast<uint8_t>(i % slope.columns * 8));
  shown.focus.map = std::make_shared<FocalMap>(std::move(slope));
  all["surface"].push_back(wire::encode_surface(*wire::picture_surface(shown, 0xffffff00)));
  all["depacketizer"].push_back(packets(wire::UnitKind::kAnswer, answers, 600));
  all["depacketizer"].push_back(packets(wire::UnitKind::kRequest, requests, 1388));
  const auto add_whole = [&all](const char* target, const std::string& text) {
    all[target].emplace_back(text.begin(), text.end());
  };
  add_whole("offer", test::browser_offer());
  std::string formats, maps;
  for (int i = 0; i < 1300; i++) formats += " 1";
  for (int i = 0; i < 400; i++) maps += "a=rtpmap:1\r\n";
  add_whole("offer",
            test::with(test::with(test::browser_offer(), " 96 97", formats + " 96 97"), "a=recvonly\r\n", maps));
  add_whole("http",
            "127.0.0.1:8080\nhttp://127.0.0.1:8080\nsame-origin\nBearer sesame\n10.0.0.1, 192.0.2.7\n/lightfield/"
            "\n640\n480\n0.063");
  add_whole("http",
            "[::1]:8080\nhttps://Example.org:443/\ncross-site\nbearer sesam\n::ffff:192.0.2.7\n//evil.org\n1e9\n"
            "nan\ninf");
  add_whole("http", "cameras.example\nnull\nnone\nBasic sesame\nunknown");
  add_whole("offer", test::with(test::browser_offer(), "H264", "H265"));
  add_whole("control", R"({"id":7,"mid":null,"request":{"type":"navigationEvent","event":{"event":"MouseMove","x":1,)"
                       R"("y":2,"modifier_state":"shift-mask+button1-mask"}}})");
  add_whole("control", R"({"id":8,"request":{"type":"navigationEvent","event":{"event":"KeyPress","key":"Left"}}})");
  add_whole("control", R"({"id":9,"request":{"type":"customUpstreamEvent","structureName":"lightfield-view-request",)"
                       R"("structure":{"x":0.1,"focus-distance":2}}})");
  const Bytes asking = join({requests[0], {0x8f, 'L', 'x'}, requests[1], requests[2]});
  const Bytes answering = join({answers[1], Bytes(40, 'x'), answers[2], answers[0]});
  all["framing"].push_back(join({{30}, asking}));
  all["framing"].push_back(join({{7}, answering}));
  all["parse"].push_back(join({{0, 4}, asking, answering}));
  all["parse"].push_back(join({{1, 1}, asking}));
  all["parse"].push_back(join({{2, 20}, asking, answering}));
  add_frames(all["frame"]);
  add_texts(all["json"], all["import"]);
  return all;
}

}  // namespace lf::fuzz
