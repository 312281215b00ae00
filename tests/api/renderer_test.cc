// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/renderer.h"
#include "api/api_fixture.h"
#include "composite/still.h"

namespace lightfield {
namespace {

using test::Array;

// Three machines with interleaved cameras, in arbitrary order.
struct Machines {
  explicit Machines(const Array& array) : Machines(array.rig, array.images) {}
  Machines(const Rig& rig, const std::vector<Image>& images) {
    for (uint32_t number = 0; number < 3; number++) {
      std::vector<uint32_t> cameras;
      for (uint32_t camera = number; camera < rig.size(); camera += 3) cameras.insert(cameras.begin(), camera);
      frames.emplace_back();
      for (const uint32_t camera : cameras) frames.back().push_back(images[camera]);
      nodes.emplace_back(rig, cameras);
    }
  }
  std::vector<Bytes> answer(const Bytes& request) const {
    std::vector<Bytes> parts;
    for (size_t i = 0; i < nodes.size(); i++)
      for (Bytes& part : nodes[i].answer(request, frames[i])) parts.push_back(std::move(part));
    return parts;
  }
  std::vector<Node> nodes;
  std::vector<std::vector<Image>> frames;
};

double psnr(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); i++) sum += std::pow(a.pixels[i] - b.pixels[i], 2);
  return 10 * std::log10(255 * 255 * static_cast<double>(a.pixels.size()) / sum);
}

TEST(ApiNodeCompositor, PicturesEqualTheRenderers) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420})
    for (const Focus focus : {Focus::kPlane, Focus::kAuto}) {
      Array array(format);
      const Machines machines(array);
      Renderer renderer(array.rig);
      Compositor compositor(array.rig, 5);
      size_t most_parts = 0;
      for (int i = 0; i < 14; i++) {
        array.view.world_from_view.position.x += 0.002;
        std::vector<Bytes> parts = machines.answer(compositor.request(array.view, {.focus = focus, .quality = 0}));
        most_parts = std::max(most_parts, parts.size());
        std::reverse(parts.begin(), parts.end());
        for (const Bytes& part : parts) {
          EXPECT_FALSE(compositor.is_complete());
          const Compositor::AddResult added = compositor.add(part);
          EXPECT_TRUE(added) << added.problem;
        }
        EXPECT_TRUE(compositor.is_complete());
        const Image picture = compositor.finish();
        EXPECT_EQ(compositor.missing(), 0u);
        ASSERT_EQ(picture.pixels, renderer.render(array.view, array.images, {.focus = focus}).pixels)
            << "picture " << i << " with focus " << static_cast<int>(focus);
      }
      EXPECT_EQ(most_parts, focus == Focus::kAuto ? 9u : 3u) << "surfaces are tried, and brightness is compared";
    }
}

TEST(ApiNodeCompositor, SurfaceAndBrightnessEqualTheRenderers) {
  const test::Walls walls(0.8);
  const Machines machines(walls.rig, walls.images);
  Renderer renderer(walls.rig);
  Compositor compositor(walls.rig, 1);
  for (int i = 0; i < 24; i++) {
    for (const Bytes& part : machines.answer(compositor.request(walls.view, {.focus = Focus::kAuto, .quality = 0})))
      EXPECT_TRUE(compositor.add(part));
    EXPECT_TRUE(compositor.is_complete());
    ASSERT_EQ(compositor.finish().pixels, renderer.render(walls.view, walls.images, {.focus = Focus::kAuto}).pixels)
        << "picture " << i;
  }
  EXPECT_NE(renderer.render(walls.view, walls.images, {.focus = Focus::kAuto}).pixels,
            Renderer(walls.rig).render(walls.view, walls.images).pixels);
}

TEST(ApiNodeCompositor, JpegAnswersAreSmallAndAccurate) {
  const Array array;
  const Machines machines(array);
  const auto make = [&](int quality, size_t* bytes) {
    Compositor compositor(array.rig, 1);
    for (const Bytes& part : machines.answer(compositor.request(array.view, {.quality = quality}))) {
      EXPECT_TRUE(compositor.add(part));
      *bytes += part.size();
    }
    return compositor.finish();
  };
  size_t exact = 0, coded = 0;
  EXPECT_GT(psnr(make(90, &coded), make(0, &exact)), 32) << "chroma has half the resolution";
  EXPECT_LT(coded, exact / 4);
}

TEST(ApiNodeCompositor, AbsentCamerasAreMissing) {
  const Array array;
  const Machines machines(array);
  Compositor compositor(array.rig, 1);
  const Bytes request = compositor.request(array.view);
  EXPECT_TRUE(compositor.add(machines.nodes[0].answer(request, machines.frames[0]).at(0)));
  EXPECT_FALSE(compositor.is_complete());
  EXPECT_EQ(compositor.finish().pixels.size(), 3u * 96 * 72);
  EXPECT_GT(compositor.missing(), 0u);
  EXPECT_LT(compositor.missing(), array.rig.size());

  std::vector<uint32_t> gone = machines.nodes[1].cameras();
  const Bytes next = compositor.request(array.view, {.out_of_service = gone});
  for (const size_t i : {0, 2}) {
    EXPECT_FALSE(compositor.is_complete());
    for (const Bytes& part : machines.nodes[i].answer(next, machines.frames[i])) EXPECT_TRUE(compositor.add(part));
  }
  EXPECT_TRUE(compositor.is_complete());
  compositor.finish();
  EXPECT_EQ(compositor.missing(), 0u);

  compositor.request(array.view, {.background = {1, 2, 3}});
  EXPECT_EQ(compositor.finish().pixels[1], 2);
}

TEST(ApiNodeCompositor, CameraWithoutFrameIsAnswered) {
  const Array array;
  Machines machines(array);
  std::vector<ImageView> frames(machines.frames[0].begin(), machines.frames[0].end());
  frames[0] = {};
  Compositor compositor(array.rig, 1);
  const Bytes request = compositor.request(array.view);
  EXPECT_TRUE(compositor.add(machines.nodes[0].answer(request, frames).at(0)));
  for (ImageView& frame : frames) frame = {};
  EXPECT_FALSE(machines.nodes[0].answer(request, frames).empty());
}

TEST(ApiNodeCompositor, RequestInfoDescribesTheRequest) {
  const Array array;
  Compositor compositor(array.rig, 17);
  const RequestInfo first = read_request(compositor.request(array.view, {.time = 123'456'789}));
  EXPECT_EQ(first.view_id, 17u);
  EXPECT_EQ(first.time, 123'456'789u);
  const RequestInfo second = read_request(compositor.request(array.view));
  EXPECT_EQ(second.sequence, first.sequence + 1);
  EXPECT_EQ(second.time, kNewest);

  const Node node(array.rig, {7, 2});
  const Bytes request = compositor.request(array.view);
  for (const uint32_t camera : node.cameras_for(request)) EXPECT_TRUE(camera == 7 || camera == 2);
}

TEST(ApiNodeCompositor, MismatchesAreErrors) {
  const Array array;
  const Machines machines(array);
  Compositor compositor(array.rig, 1), other(array.rig, 2);
  EXPECT_MENTIONS(compositor.add({1, 2, 3}).problem, "no picture", "request()");
  EXPECT_API_ERROR(compositor.finish(), "no picture", "request()");
  EXPECT_API_ERROR(compositor.request(array.view, {.quality = 101}), "quality", "0 to 100");
  EXPECT_API_ERROR(compositor.request(array.view, {.out_of_service = {12}}), "out_of_service", "12");
  View view = array.view;
  view.height = 20000;
  EXPECT_API_ERROR(compositor.request(view), "height", "1 to 16384 pixels");

  const Bytes request = compositor.request(array.view);
  const std::vector<Bytes> parts = machines.answer(request);
  EXPECT_TRUE(compositor.add(parts[0]));
  EXPECT_MENTIONS(compositor.add(parts[0]).problem, "duplicate");
  EXPECT_MENTIONS(compositor.add({}).problem, "damaged");
  EXPECT_MENTIONS(compositor.add(request).problem, "damaged");
  other.request(array.view);
  EXPECT_MENTIONS(other.add(parts[1]).problem, "part", "another request");
  compositor.finish();
  compositor.request(array.view);
  EXPECT_MENTIONS(compositor.add(parts[1]).problem, "part", "another request") << "too late";

  std::vector<Camera> cameras;
  for (size_t i = 0; i < array.rig.size(); i++) cameras.push_back(array.rig.camera(i));
  cameras[5].lens.fx += 1;
  const Rig other_rig(cameras);
  Compositor of_other(other_rig, 1);
  const Bytes of_other_rig = of_other.request(array.view);
  EXPECT_API_ERROR(machines.nodes[0].answer(of_other_rig, machines.frames[0]), "made", "another rig");
  EXPECT_API_ERROR(machines.nodes[0].cameras_for(of_other_rig), "made", "another rig");
  EXPECT_MENTIONS(of_other
                      .add(Node(array.rig, {0})
                               .answer(Compositor(array.rig, 1).request(array.view), {ImageView(array.images[0])})
                               .at(0))
                      .problem,
                  "part", "another rig");

  EXPECT_API_ERROR(read_request({}), "not a request");
  EXPECT_API_ERROR(machines.nodes[0].answer(parts[0], machines.frames[0]), "not a request");
  EXPECT_API_ERROR(machines.nodes[0].answer(request, {ImageView(array.images[0])}), "images", "4 cameras");
  EXPECT_API_ERROR(Node(array.rig, {}), "cameras", "at least one");
  EXPECT_API_ERROR(Node(array.rig, {3, 4, 3}), "cameras", "3", "twice");
  EXPECT_API_ERROR(Node(array.rig, {12}), "cameras", "12", "12 cameras");
}

TEST(ApiNodeCompositor, DamagedBytesAreRejected) {
  const Array array;
  const Machines machines(array);
  lf::reference::Random random(3);
  for (const int quality : {0, 80}) {
    Compositor compositor(array.rig, 1);
    Bytes request;
    for (int i = 0; i < 3; i++) {
      request = compositor.request(array.view, {.focus = Focus::kAuto, .quality = quality});
      if (i < 2)
        for (const Bytes& part : machines.answer(request)) compositor.add(part);
      if (i < 2) compositor.finish();
    }
    const std::vector<Bytes> parts = machines.answer(request);
    const auto damaged = [&random](Bytes bytes) {
      const auto place = [&] { return static_cast<size_t>(random.integer(0, static_cast<int>(bytes.size()) - 1)); };
      if (random.one_in(3)) bytes.resize(place());
      for (int flips = random.integer(1, 4); flips > 0 && !bytes.empty(); flips--)
        bytes[random.one_in(2) ? place() % std::min<size_t>(bytes.size(), 100) : place()] ^= 1 << random.integer(0, 7);
      return bytes;
    };
    int refused = 0;
    for (int i = 0; i < 400; i++) {
      refused += !compositor.add(damaged(parts[static_cast<size_t>(i) % parts.size()]));
      if (i % 50 != 49) continue;
      EXPECT_EQ(compositor.finish().pixels.size(), 3u * 96 * 72);
      compositor.request(array.view, {.focus = Focus::kAuto, .quality = quality});
    }
    EXPECT_GT(refused, 200);
    refused = 0;
    for (int i = 0; i < 300; i++) {
      try {
        const Bytes bytes = damaged(request);
        read_request(bytes);
        // The remaining bytes may be valid and large.
        if (bytes.size() == request.size() && std::equal(bytes.begin() + 12, bytes.begin() + 48, request.begin() + 12))
          machines.nodes[0].answer(bytes, machines.frames[0]);
      } catch (const Error&) {
        refused++;
      }
    }
    EXPECT_GT(refused, 100);
  }
}

TEST(ApiNodeCompositor, NodesAreThreadSafe) {
  const Array array;
  const Machines machines(array);
  Compositor compositor(array.rig, 1);
  const Bytes request = compositor.request(array.view);
  const std::vector<Bytes> expected = machines.answer(request);
  std::vector<std::thread> threads;
  std::vector<int> different(4);
  for (int& count : different)
    threads.emplace_back([&] {
      for (int i = 0; i < 10; i++) count += machines.answer(request) != expected;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(different, std::vector<int>(different.size()));
}

constexpr RenderOptions kBilinear{.resampling = Resampling::kBilinear};

lf::Image production(const Array& array, const lf::View& view) {
  const auto image_of = [&](lf::CameraIndex camera) -> const lf::Image& { return array.originals[camera]; };
  return lf::render_still(array.inside, lf::build_mesh(array.inside), view, image_of).picture;
}

TEST(ApiRenderer, PicturesEqualTheInternalRenderers) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420})
    for (const double aperture : {0.0, 0.15}) {
      Array array(format);
      array.view.aperture = aperture;
      Renderer renderer(array.rig);
      const Image picture = renderer.render(array.view, array.images, kBilinear);
      EXPECT_EQ(picture.format, format);
      EXPECT_EQ(picture.pixels, production(array, test::private_view(array.view)).data()) << aperture;
    }
}

TEST(ApiRenderer, DevicesDifferByAtMostOneLevel) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420}) {
    Array array(format);
    Renderer renderer(array.rig);
    EXPECT_EQ(renderer.drawn_by(), "cpu");
    const Image expected = renderer.render(array.view, array.images, kBilinear);
    RenderOptions options = kBilinear;
    for (const auto& [choice, says] :
         {std::pair(RendererChoice::kGl, "gl: "), std::pair(RendererChoice::kAuto, "auto: ")}) {
      options.renderer = choice;
      const Image picture = renderer.render(array.view, array.images, options);
      EXPECT_EQ(renderer.drawn_by().rfind(says, 0), 0u) << renderer.drawn_by();
      ASSERT_EQ(picture.pixels.size(), expected.pixels.size());
      for (size_t i = 0; i < picture.pixels.size(); i++)
        ASSERT_LE(std::abs(picture.pixels[i] - expected.pixels[i]), 1) << i;
    }
    options.renderer = static_cast<RendererChoice>(3);
    EXPECT_THROW(renderer.render(array.view, array.images, options), Error);
  }
}

TEST(ApiRenderer, PicturesAreWithinOneLevelOfTheReference) {
  lf::reference::Random random(7);
  size_t compared = 0;
  for (int i = 0; i < 20; i++) {
    Array array(PixelFormat::kRgb, 100 + i);
    Pose& pose = array.view.world_from_view;
    pose.position = {random.uniform(-0.15, 0.15), random.uniform(-0.1, 0.1), random.uniform(-0.3, 0.1)};
    array.view.focus_distance = random.uniform(0.8, 4);
    Renderer renderer(array.rig, 1 + i % 3);
    const Image picture = renderer.render(array.view, array.images, kBilinear);
    const lf::reference::Picture truth = lf::reference::render(array.inside, lf::build_mesh(array.inside),
                                                               test::private_view(array.view), array.originals);
    const lf::Image rounded = truth.image();
    const std::vector<float> coverage = truth.coverage();
    // The reference renders only the mesh.
    const lf::View view = test::private_view(array.view);
    const lf::ViewPlan plan(array.inside, lf::build_mesh(array.inside), view);
    const lf::FaceIdMap owners(plan, {0, 0, view.width, view.height});
    for (size_t p = 0; p < coverage.size(); p++) {
      const int32_t owner = owners.at(static_cast<int>(p) % view.width, static_cast<int>(p) / view.width);
      if (coverage[p] < 0.999 || !plan.faces()[owner].has_corners()) continue;
      for (int c = 0; c < 3; c++)
        ASSERT_LE(std::abs(picture.pixels[3 * p + c] - rounded.data()[3 * p + c]), 1) << "situation " << i;
      compared++;
    }
  }
  EXPECT_GT(compared, 20u * 96 * 72 / 4);
}

TEST(ApiRenderer, NeighboursFillInForCameraWithoutImage) {
  Array array;
  Renderer renderer(array.rig);
  const std::vector<uint32_t> looked_at = renderer.cameras(array.view);
  ASSERT_GE(looked_at.size(), 3u);
  std::vector<ImageView> images(array.images.begin(), array.images.end());
  images[looked_at[0]] = {};
  const Image picture = renderer.render(array.view, images, {.background = {255, 0, 255}});
  // The middle of the array is fully covered: not black and not the background.
  const size_t middle = 3 * (static_cast<size_t>(36) * 96 + 48);
  const Image whole = renderer.render(array.view, array.images);
  for (size_t c = 0; c < 3; c++) EXPECT_NEAR(picture.pixels[middle + c], whole.pixels[middle + c], 80);
  EXPECT_NE(picture.pixels, whole.pixels);

  const std::vector<ImageView> none(array.images.size());
  const Image empty = renderer.render(array.view, none, {.background = {255, 0, 254}});
  EXPECT_EQ(empty.format, PixelFormat::kRgb);
  EXPECT_EQ(empty.pixels[0], 255);
  EXPECT_EQ(empty.pixels[2], 254);
}

TEST(ApiRenderer, NeedsOnlyContributingCameras) {
  Array array;
  Renderer renderer(array.rig);
  array.view.fov_y = 20;
  const Image whole = renderer.render(array.view, array.images);
  const std::vector<uint32_t> looked_at = renderer.cameras(array.view);
  ASSERT_LT(looked_at.size(), array.images.size());
  for (uint32_t i = 0; i < array.images.size(); i++)
    if (std::find(looked_at.begin(), looked_at.end(), i) == looked_at.end()) array.images[i] = {};
  EXPECT_EQ(renderer.render(array.view, array.images).pixels, whole.pixels);
}

TEST(ApiRenderer, FindsTheFocalSurface) {
  const test::Walls walls;
  Renderer renderer(walls.rig);
  const double on_plane = walls.mean_error(renderer.render(walls.view, walls.images));
  double on_surface = 0;
  for (int i = 0; i < 16; i++)
    on_surface = walls.mean_error(renderer.render(walls.view, walls.images, {.focus = Focus::kAuto}));
  EXPECT_GT(on_plane, 3) << "all of the picture is out of focus";
  EXPECT_LT(on_surface, on_plane / 3);
  renderer.reset_focus();
  EXPECT_NEAR(walls.mean_error(renderer.render(walls.view, walls.images, {.focus = Focus::kAuto})), on_plane, 1e-9);
}

TEST(ApiRenderer, MatchesBrightness) {
  const test::Walls walls(0.8);
  double error[2];
  for (const bool match : {false, true}) {
    Renderer renderer(walls.rig);
    for (int i = 0; i < 40; i++)
      error[match] = walls.mean_error(
          renderer.render(walls.view, walls.images, {.focus = Focus::kAuto, .match_brightness = match}));
  }
  EXPECT_GT(error[false], 3) << "a camera is darker than the others";
  EXPECT_LT(error[true], error[false] / 2);
}

// A picture in the caller's memory, with padding of 5 bytes a row.
struct PaddedPicture {
  PaddedPicture(PixelFormat format, int width, int height) {
    view.format = format;
    view.width = width;
    view.height = height;
    for (int c = 0; c < (format == PixelFormat::kRgb ? 1 : 3); c++) {
      rows[c] = c == 0 ? height : (height + 1) / 2;
      bytes[c] = format == PixelFormat::kRgb ? 3 * width : c == 0 ? width : (width + 1) / 2;
      planes[c].assign(static_cast<size_t>(rows[c] * (bytes[c] + 5)), 99);
      view.plane[c] = planes[c].data();
      view.stride[c] = bytes[c] + 5;
    }
  }
  // Returns the pixels, and removes the padding. Returns nothing if the padding has changed.
  std::vector<uint8_t> pixels() const {
    std::vector<uint8_t> out;
    for (int c = 0; c < 3; c++)
      for (int y = 0; y < rows[c]; y++) {
        const auto row = planes[c].begin() + y * view.stride[c];
        if (std::count(row + bytes[c], row + view.stride[c], 99) != 5) return {};
        out.insert(out.end(), row, row + bytes[c]);
      }
    return out;
  }
  MutableImageView view;
  int rows[3] = {}, bytes[3] = {};
  std::vector<uint8_t> planes[3];
};

TEST(ApiRenderer, RendersIntoTheMemoryOfTheCaller) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420}) {
    Array array(format);
    array.view.width = 95;  // chroma has half the width, rounded up
    const std::vector<ImageView> images(array.images.begin(), array.images.end());
    Renderer renderer(array.rig), other(array.rig);
    Compositor compositor(array.rig, 1);
    const Machines machines(array);
    for (const Focus focus : {Focus::kPlane, Focus::kAuto, Focus::kAuto}) {
      PaddedPicture out(format, 95, 72), composed(format, 95, 72);
      renderer.render_into(array.view, images, out.view, {.focus = focus});
      const Image expected = other.render(array.view, array.images, {.focus = focus});
      EXPECT_EQ(out.pixels(), expected.pixels);
      for (const Bytes& part : machines.answer(compositor.request(array.view, {.focus = focus, .quality = 0})))
        compositor.add(part);
      PaddedPicture wrong(format == PixelFormat::kRgb ? PixelFormat::kI420 : PixelFormat::kRgb, 95, 72);
      EXPECT_API_ERROR(compositor.finish_into(wrong.view), "out", "RGB", "I420");
      compositor.finish_into(composed.view);
      EXPECT_EQ(composed.pixels(), expected.pixels);
      EXPECT_API_ERROR(compositor.finish_into(composed.view), "request()");
    }
    Image picture = make_image(format, 95, 72);
    renderer.render_into(array.view, std::vector<ImageView>(images.size()), picture);
    EXPECT_EQ(picture.pixels, make_image(format, 95, 72).pixels) << "black without images";
  }
}

TEST(ApiRenderer, MemoryThatDoesNotFitIsAnError) {
  const Array array;
  const std::vector<ImageView> images(array.images.begin(), array.images.end());
  Renderer renderer(array.rig);
  const auto with = [&](auto change) {
    PaddedPicture out(PixelFormat::kRgb, 96, 72);
    change(out.view);
    return test::error_of([&] { renderer.render_into(array.view, images, out.view); });
  };
  EXPECT_MENTIONS(with([](MutableImageView& v) { v.format = PixelFormat::kNone; }), "out", "kRgb", "kI420");
  EXPECT_MENTIONS(with([](MutableImageView& v) { v.height = 71; }), "out", "96x71", "96x72");
  EXPECT_MENTIONS(with([](MutableImageView& v) { v.plane[0] = nullptr; }), "out", "plane 0");
  EXPECT_MENTIONS(with([](MutableImageView& v) { v.stride[0] = 287; }), "out", "287 bytes", "288");
  Image broken = make_image(PixelFormat::kRgb, 96, 72);
  broken.pixels.pop_back();
  EXPECT_API_ERROR(renderer.render_into(array.view, images, broken), "bytes", "96x72");
}

TEST(ApiRenderer, MismatchesAreErrors) {
  Array array;
  Renderer renderer(array.rig);
  std::vector<Image> images = array.images;
  images.pop_back();
  EXPECT_API_ERROR(renderer.render(array.view, images), "images", "12 cameras", "11");
  images = array.images;
  images[3] = make_image(PixelFormat::kRgb, 64, 47);
  EXPECT_API_ERROR(renderer.render(array.view, images), "camera 3", "id 3", "64x47", "64x48");
  images[3] = make_image(PixelFormat::kI420, 64, 48);
  EXPECT_API_ERROR(renderer.render(array.view, images), "RGB", "I420");
  images[3] = array.images[3];
  images[3].pixels.pop_back();
  EXPECT_API_ERROR(renderer.render(array.view, images), "9215 bytes", "64x48");
  std::vector<ImageView> views(array.images.begin(), array.images.end());
  views[2].stride[0] = 10;
  EXPECT_API_ERROR(renderer.render(array.view, views), "camera 2", "id 2", "10 bytes", "192");
  views[2].plane[0] = nullptr;
  EXPECT_API_ERROR(renderer.render(array.view, views), "camera 2", "id 2", "plane 0");

  const auto with = [&](auto change) {
    View view = array.view;
    change(view);
    return test::error_of([&] { renderer.render(view, array.images); });
  };
  EXPECT_MENTIONS(with([](View& v) { v.width = 0; }), "width", "1 to 16384 pixels", "0");
  EXPECT_MENTIONS(with([](View& v) { v.fov_y = 180; }), "fov_y", "0", "180 degrees");
  EXPECT_MENTIONS(with([](View& v) { v.focus_distance = -1; }), "focus_distance", "0");
  EXPECT_MENTIONS(with([](View& v) { v.aperture = NAN; }), "aperture", "0");
  EXPECT_MENTIONS(with([](View& v) { v.world_from_view.position.y = INFINITY; }), "position", "finite");
  EXPECT_MENTIONS(with([](View& v) { v.world_from_view.orientation.w = 2; }), "orientation", "quaternion");
  EXPECT_MENTIONS(with([](View& v) { v.lens = Lens{.fx = 0, .fy = 1}; }), "params[0]", "focal length", "positive");
  EXPECT_API_ERROR(renderer.render(array.view, array.images, {.nearest = 3, .farthest = 2}), "nearest, farthest");
  EXPECT_API_ERROR(renderer.render(array.view, array.images, {.resampling = static_cast<Resampling>(9)}), "resampling");
  EXPECT_EQ(renderer.render(array.view, array.images).pixels,
            Renderer(array.rig).render(array.view, array.images).pixels);
}

TEST(ApiRenderer, ConcurrentRenderersMakeTheSamePictures) {
  const Array array;
  std::vector<Image> alone;
  Renderer first(array.rig, 1);
  for (int i = 0; i < 12; i++) alone.push_back(first.render(array.view, array.images, {.focus = Focus::kAuto}));
  std::vector<std::thread> threads;
  std::vector<int> different(4);
  for (size_t t = 0; t < different.size(); t++)
    threads.emplace_back([&, t] {
      Renderer renderer(array.rig, static_cast<unsigned>(t));
      for (const Image& expected : alone)
        different[t] += renderer.render(array.view, array.images, {.focus = Focus::kAuto}).pixels != expected.pixels;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(different, std::vector<int>(different.size()));
}

}  // namespace
}  // namespace lightfield
