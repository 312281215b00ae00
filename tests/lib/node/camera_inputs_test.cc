// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Also run under ThreadSanitizer (tests/sanitize.sh thread).
#include "node/camera_inputs.h"

#include <gtest/gtest.h>

#include <thread>

namespace lf {
namespace {

std::shared_ptr<const Rig> rig_with(const std::vector<uint32_t>& ids) {
  Rig rig;
  for (const uint32_t id : ids) {
    Camera camera;
    camera.id = id;
    camera.width = camera.height = 8;
    camera.lens = Lens::pinhole(10, 3.5, 3.5);
    camera.pose.position = Vec3(0.1 * id, 0, 0);
    rig.cameras.push_back(camera);
  }
  return std::make_shared<const Rig>(std::move(rig));
}

CameraInputs::Frames input(CameraInputs& inputs, uint32_t id, PixelFamily family = PixelFamily::kI420) {
  const auto frames = std::make_shared<CameraFrames>();
  inputs.add(frames);
  EXPECT_TRUE(inputs.set_camera(frames, id));
  inputs.set_family(frames, family);
  return frames;
}

TEST(CameraInputs, KeepTheIdsOfTheirCamerasFromRigToRig) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({10, 11, 12}));
  const auto ten = input(inputs, 10), twelve = input(inputs, 12);
  const auto before = inputs.array();
  EXPECT_EQ(before->cameras.at(0), ten);
  EXPECT_EQ(before->cameras.at(2), twelve);
  EXPECT_EQ(inputs.set_rig(rig_with({12, 13})), "it has no camera 10");
  EXPECT_EQ(inputs.array()->cameras.size(), 1u);
  EXPECT_EQ(inputs.array()->cameras.at(0), twelve);
  EXPECT_EQ(before->cameras.size(), 2u) << "what is being answered stays as it began";
  EXPECT_EQ(inputs.camera(10), nullptr);
  EXPECT_EQ(inputs.set_rig(rig_with({9, 10, 11, 12})), "");
  EXPECT_EQ(inputs.array()->cameras.at(1), ten);
}

TEST(CameraInputs, OneInputACamera) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({10, 11}));
  const auto first = input(inputs, 10);
  const auto second = std::make_shared<CameraFrames>();
  inputs.add(second);
  EXPECT_FALSE(inputs.set_camera(second, 10));
  inputs.remove(first);
  EXPECT_TRUE(inputs.set_camera(second, 10));
}

TEST(CameraInputs, TheFamilyIsRgbIfAnyHasItAndStays) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({0, 1, 2, 3}));
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kNone);
  input(inputs, 0);
  const auto rgb = input(inputs, 1, PixelFamily::kRgb);
  input(inputs, 2);
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kRgb);
  inputs.remove(rgb);
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kRgb);
  inputs.forget_family();
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kI420);
}

TEST(CameraInputs, AreWaitedForUntilTheyAreKnownOrGivenUpOrNobodyWants) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({0, 1}));
  inputs.set_running(true);
  std::atomic<bool> cancelled = false;
  for (int how = 0; how < 5; how++) {
    const auto frames = std::make_shared<CameraFrames>();
    inputs.add(frames);
    cancelled = false;
    std::thread waiting([&] { inputs.wait_for_all(cancelled); });
    switch (how) {
      case 0:
        inputs.set_family(frames, PixelFamily::kRgb);
        inputs.set_camera(frames, 1);
        break;
      case 1: inputs.give_up(frames); break;
      case 2: inputs.remove(frames); break;
      case 3:
        cancelled = true;
        inputs.wake();
        break;
      default: inputs.set_running(false);
    }
    waiting.join();
    inputs.remove(frames);
  }
}

TEST(CameraInputs, ComeAndGoWhileTheRigIsReplaced) {
  CameraInputs inputs;
  const auto one = rig_with({0, 1, 2}), other = rig_with({2, 1});
  inputs.set_rig(one);
  const auto stays = input(inputs, 2);
  std::thread joining([&] {
    for (int i = 0; i < 500; i++) inputs.remove(input(inputs, 1));
  });
  std::thread replacing([&] {
    for (int i = 0; i < 500; i++) inputs.set_rig(i % 2 ? one : other);
  });
  for (int i = 0; i < 500; i++) {
    const auto array = inputs.array();
    EXPECT_EQ(array->rig_hash, array->rig->hash());
    EXPECT_EQ(array->cameras.at(*array->rig->index_of_id(2)), stays);
  }
  joining.join();
  replacing.join();
}

}  // namespace
}  // namespace lf
