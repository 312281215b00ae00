// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/text.h"
#include "composite/assembly.h"
#include "node/camera_access.h"
#include "node/request_renderer.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"

namespace lf {

inline constexpr Access kAccesses[] = {Access::kSelf, Access::kWarp, Access::kPixels};

// Returns a rig with only lenses and sizes, for cameras with explicit homographies.
inline Rig without_places(Rig rig) {
  for (Camera& camera : rig.cameras) camera.pose = {Vec3(7, 7, 7), Quat(0.6, 0, 0.8, 0)};
  return rig;
}

class AccessPictures {
 public:
  // All images have the same family. An empty image: the camera has no frame.
  AccessPictures(const Rig& rig, const ViewRequest& request, const std::vector<Image>& images)
      : rig_(std::make_shared<const Rig>(rig)),
        rig_without_poses_(without_places(rig)),
        request_(request),
        images_(images) {
    for (const Image& image : images)
      if (image.family() != PixelFamily::kNone) family_ = image.family();
  }

  std::unique_ptr<const RequestPlan> plan(Access access, std::span<const CameraIndex> own) const {
    const Mesh mesh = build_mesh(*rig_, request_.out_of_service);
    if (access == Access::kSelf) return std::make_unique<const RequestPlan>(*rig_, mesh, request_, own);
    const auto bytes = wire::encode_any_request(CameraAccess::of(access)->command(*rig_, mesh, request_));
    MeshCache none;
    return plan_request(rig_without_poses_, none, wire::decode_any_request(bytes).value(), own);
  }

  ByteBuffer answer(Access access, const std::vector<CameraIndex>& own, const RenderOptions& options) const {
    const auto plan = this->plan(access, own);
    const Rig& known = access == Access::kSelf ? *rig_ : rig_without_poses_;
    std::vector<Source> sources;
    CameraSet blind;
    for (const CameraIndex camera : plan->cameras()) {
      sources.push_back({camera, &known.cameras[camera], images_[camera].view()});
      if (images_[camera].family() == PixelFamily::kNone) blind.push_back(camera);
    }
    wire::AnswerHeader header;
    header.view_id = request_.view_id;
    header.sequence = request_.sequence;
    header.view_width = request_.view.width;
    header.view_height = request_.view.height;
    header.family = family_;
    header.rig_hash = rig_->hash();
    header.cameras = CameraRanges(own);
    header.blind = CameraRanges(blind);
    ImageMemory scratch;
    return RequestRenderer().render({plan.get(), header}, sources, options, scratch).bytes;
  }

  Image picture(const std::vector<ByteBuffer>& answers) {
    assembly_.set_rig(rig_);
    assembly_.begin(request_);
    for (const ByteBuffer& bytes : answers) {
      std::string reason;
      const auto answer = wire::parse_answer(bytes, &reason);
      EXPECT_TRUE(answer) << reason;
      if (!answer) return {};
      EXPECT_EQ(assembly_.add(*answer), Assembly::Verdict::kAdded);
    }
    assembly_.finish(family_, true);
    return assembly_.picture().resolve();
  }
  Image picture(Access access, const RenderOptions& options) {
    std::vector<CameraIndex> all(rig_->cameras.size());
    for (CameraIndex i = 0; i < all.size(); i++) all[i] = i;
    return picture({answer(access, all, options)});
  }
  const Assembly& assembly() const { return assembly_; }

 private:
  const std::shared_ptr<const Rig> rig_;
  const Rig rig_without_poses_;
  const ViewRequest request_;
  const std::vector<Image>& images_;
  PixelFamily family_ = PixelFamily::kNone;
  Assembly assembly_;
};

}  // namespace lf
