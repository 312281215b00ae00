// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/camera_trials_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "lib/wire/wire_test.h"

namespace lf::wire {
namespace {

const MomentsShape kShape{40, 30, 2};
const MomentsHeader kHeader{7, 9, 0x1122334455667788, 3, {}};

std::vector<CameraTrials> two_cameras() {
  std::vector<CameraTrials> cameras{{5, {1, 2, 11, 8}, {}}, {9, {30, 20, 40, 30}, {}}};
  for (CameraTrials& camera : cameras)
    for (int t = 0; t < 2; t++) {
      std::vector<uint8_t> luma(static_cast<size_t>(camera.rect.width()) * camera.rect.height());
      for (size_t i = 0; i < luma.size(); i++) luma[i] = static_cast<uint8_t>(i * 7 + t + camera.camera);
      camera.luma.push_back(luma);
    }
  return cameras;
}

std::vector<uint8_t> encoded() {
  const ByteBuffer bytes = encode_camera_trials(kHeader, kShape, two_cameras());
  return {bytes.begin(), bytes.end()};
}

TEST(CameraTrialsCodec, HeaderIsAsSpecified) {
  const std::vector<uint8_t> bytes = encoded(), begin(bytes.begin() + 12, bytes.begin() + 40);
  EXPECT_EQ(bytes[5], 6);
  EXPECT_EQ(begin, from_hex("00000007" "00000009" "1122334455667788" "00000003" "0028" "001e" "02" "00" "0002"));
  const std::vector<uint8_t> camera(bytes.begin() + 40, bytes.begin() + 50);
  EXPECT_EQ(camera, from_hex("0005" "0001" "0002" "000a" "0006"));
}

TEST(CameraTrialsCodec, RoundTrips) {
  EXPECT_TRUE(is_camera_trials(encoded()));
  EXPECT_FALSE(is_moments(encoded()));
  const std::optional<MomentsHeader> header = parse_camera_trials_header(encoded());
  ASSERT_TRUE(header.has_value());
  EXPECT_EQ(*header, kHeader);
  std::string reason;
  const std::optional<CameraTrialsUnit> unit = decode_camera_trials(encoded(), kShape, &reason);
  ASSERT_TRUE(unit.has_value()) << reason;
  EXPECT_EQ(unit->cameras, two_cameras());
}

TEST(CameraTrialsCodec, OnlyWhatWasAskedForIsRead) {
  for (const MomentsShape& other : {MomentsShape{41, 30, 2}, {40, 30, 3}, {0, 0, 0}})
    EXPECT_FALSE(decode_camera_trials(encoded(), other).has_value());
}

TEST(CameraTrialsCodec, EveryCutAndEveryFlippedBitIsRefusedOrRead) {
  const std::vector<uint8_t> whole = encoded();
  for (size_t size = 0; size < whole.size(); size++)
    EXPECT_FALSE(decode_camera_trials(std::span(whole).first(size), kShape).has_value()) << size;
  for (size_t bit = 0; bit < 8 * whole.size(); bit++) {
    std::vector<uint8_t> flipped = whole;
    flipped[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    decode_camera_trials(flipped, kShape);
  }
  std::vector<uint8_t> longer = whole;
  longer.push_back(0);
  EXPECT_FALSE(decode_camera_trials(longer, kShape).has_value());
}

TEST(CameraTrialsCodec, NamesWhatIsWrong) {
  const auto with = [](size_t at, uint8_t value) {
    std::vector<uint8_t> bytes = encoded();
    bytes[at] = value;
    std::string reason;
    EXPECT_FALSE(decode_camera_trials(bytes, kShape, &reason).has_value());
    return reason;
  };
  EXPECT_THAT(with(37, 1), testing::StartsWith("reserved: "));
  EXPECT_THAT(with(47, 60), testing::StartsWith("rectangle: "));
  EXPECT_THAT(with(41, 9), testing::HasSubstr("order"));
  std::vector<uint8_t> nobody = encoded();
  nobody[40] = nobody[41] = 0xff;
  std::string reason;
  EXPECT_FALSE(decode_camera_trials(nobody, kShape, &reason).has_value());
  EXPECT_THAT(reason, testing::StartsWith("camera: "));
  std::vector<CameraTrials> bad = two_cameras();
  bad[0].luma.pop_back();
  EXPECT_THROW(encode_camera_trials(kHeader, kShape, bad), Error);
  EXPECT_THROW(encode_camera_trials(kHeader, {40, 30, 0}, {}), Error);
}

// Units of a few bytes that would fill the memory.
TEST(CameraTrialsCodec, WhatInflatesToTooMuchIsRefused) {
  const MomentsShape shape{1024, 1024, 8};
  std::vector<CameraTrials> cameras(17);
  for (size_t i = 0; i < cameras.size(); i++) {
    cameras[i] = {static_cast<CameraIndex>(i), {0, 0, 1024, 1024}, {}};
    cameras[i].luma.assign(8, std::vector<uint8_t>(1024 * 1024));
  }
  const std::span<const CameraTrials> all(cameras);
  std::string reason;
  EXPECT_TRUE(decode_camera_trials(encode_camera_trials(kHeader, shape, all.first(16)), shape, &reason)) << reason;
  EXPECT_FALSE(decode_camera_trials(encode_camera_trials(kHeader, shape, all), shape, &reason));
  EXPECT_THAT(reason, testing::HasSubstr("134217728 bytes"));
}

}  // namespace
}  // namespace lf::wire
