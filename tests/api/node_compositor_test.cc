// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/compositor.h>

#include "api/api_fixture.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "reference/generators.h"

namespace lightfield {
namespace {

using test::Array;

// Three machines, whose cameras lie among each other's and are named in no order.
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

TEST(ApiNodeCompositor, PicturesAreTheRenderersToTheBit) {
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
          const Compositor::Added added = compositor.add(part);
          EXPECT_TRUE(added) << added.why_not;
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

TEST(ApiNodeCompositor, SurfaceAndBrightnessAreTheRenderersToTheBit) {
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

TEST(ApiNodeCompositor, JpegIsSmallAndNear) {
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
  const Image picture = make(0, &exact);
  EXPECT_GT(psnr(make(90, &coded), picture), 32) << "chroma has half the resolution";
  EXPECT_LT(coded, exact / 4);
}

TEST(ApiNodeCompositor, WhatNeverCameIsMissing) {
  const Array array;
  const Machines machines(array);
  Compositor compositor(array.rig, 1);
  const Bytes request = compositor.request(array.view);
  EXPECT_TRUE(compositor.add(machines.nodes[0].answer(request, machines.frames[0]).at(0)));
  EXPECT_FALSE(compositor.is_complete());
  EXPECT_EQ(compositor.finish().pixels.size(), 3u * 96 * 72);
  EXPECT_GT(compositor.missing(), 0u);
  EXPECT_LT(compositor.missing(), array.rig.size());

  // Whoever knows which cameras are gone has the others close the gap.
  std::vector<uint32_t> gone = machines.nodes[1].cameras();
  const Bytes next = compositor.request(array.view, {.out_of_service = gone});
  for (const size_t i : {0, 2}) {
    EXPECT_FALSE(compositor.is_complete());
    for (const Bytes& part : machines.nodes[i].answer(next, machines.frames[i])) EXPECT_TRUE(compositor.add(part));
  }
  EXPECT_TRUE(compositor.is_complete());
  compositor.finish();
  EXPECT_EQ(compositor.missing(), 0u);

  // Nothing at all is a picture, too.
  compositor.request(array.view, {.background = {1, 2, 3}});
  EXPECT_EQ(compositor.finish().pixels[1], 2);
}

TEST(ApiNodeCompositor, ACameraWithoutAFrameIsAnswered) {
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

TEST(ApiNodeCompositor, RequestsSayWhatTheyAskFor) {
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

TEST(ApiNodeCompositor, SaysWhatDoesNotFit) {
  const Array array;
  const Machines machines(array);
  Compositor compositor(array.rig, 1), other(array.rig, 2);
  EXPECT_EQ(compositor.add({1, 2, 3}).why_not, "no picture was begun");
  EXPECT_API_ERROR(compositor.finish(), "no picture was begun");
  EXPECT_API_ERROR(compositor.request(array.view, {.quality = 101}), "quality: must be 0 to 100");
  EXPECT_API_ERROR(compositor.request(array.view, {.out_of_service = {12}}), "out_of_service: 12 is not one of");
  View view = array.view;
  view.height = 20000;
  EXPECT_API_ERROR(compositor.request(view), "height: must be 1 to 16384 pixels");

  const Bytes request = compositor.request(array.view);
  const std::vector<Bytes> parts = machines.answer(request);
  EXPECT_TRUE(compositor.add(parts[0]));
  EXPECT_NE(compositor.add(parts[0]).why_not.find("is there already"), std::string::npos);
  EXPECT_NE(compositor.add({}).why_not.find("damaged"), std::string::npos);
  EXPECT_NE(compositor.add(request).why_not.find("damaged"), std::string::npos);
  other.request(array.view);
  EXPECT_EQ(other.add(parts[1]).why_not, "of another request");
  compositor.finish();
  compositor.request(array.view);
  EXPECT_EQ(compositor.add(parts[1]).why_not, "of another request") << "too late";

  // The same array, seen through other lenses.
  std::vector<Camera> cameras;
  for (size_t i = 0; i < array.rig.size(); i++) cameras.push_back(array.rig.camera(i));
  cameras[5].lens.fx += 1;
  const Rig other_rig(cameras);
  Compositor of_other(other_rig, 1);
  const Bytes of_other_rig = of_other.request(array.view);
  EXPECT_API_ERROR(machines.nodes[0].answer(of_other_rig, machines.frames[0]), "made for another rig");
  EXPECT_API_ERROR(machines.nodes[0].cameras_for(of_other_rig), "made for another rig");
  EXPECT_EQ(of_other
                .add(Node(array.rig, {0})
                         .answer(Compositor(array.rig, 1).request(array.view), {ImageView(array.images[0])})
                         .at(0))
                .why_not,
            "of another rig");

  EXPECT_API_ERROR(read_request({}), "not a request");
  EXPECT_API_ERROR(machines.nodes[0].answer(parts[0], machines.frames[0]), "not a request");
  EXPECT_API_ERROR(machines.nodes[0].answer(request, {ImageView(array.images[0])}),
                   "images: must be one for each of 4 cameras");
  EXPECT_API_ERROR(Node(array.rig, {}), "cameras: a node needs at least one");
  EXPECT_API_ERROR(Node(array.rig, {3, 4, 3}), "cameras: 3 is named twice");
  EXPECT_API_ERROR(Node(array.rig, {12}), "cameras: 12 is not one of the rig's 12 cameras");
}

TEST(ApiNodeCompositor, DamagedBytesDoNoHarm) {
  const Array array;
  const Machines machines(array);
  lf::reference::Random random(3);
  for (const int quality : {0, 80}) {
    Compositor compositor(array.rig, 1);
    Bytes request;
    for (int i = 0; i < 3; i++) {  // until there are trials
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
        // What is left of it may be sound and large.
        if (bytes.size() == request.size() && std::equal(bytes.begin() + 12, bytes.begin() + 48, request.begin() + 12))
          machines.nodes[0].answer(bytes, machines.frames[0]);
      } catch (const Error&) {
        refused++;
      }
    }
    EXPECT_GT(refused, 100);
  }
}

TEST(ApiNodeCompositor, NodesAnswerSeveralThreads) {
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

}  // namespace
}  // namespace lightfield
